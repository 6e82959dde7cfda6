"""Columns to csv, ndjson, json and parquet, written whole; and `check` against older tables."""
