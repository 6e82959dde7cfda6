"""Edges of the contact patch and slip onset from one passage each, and their errors."""
