"""MCAP logs: records walked in one pass, messages decoded as columns of numbers."""
