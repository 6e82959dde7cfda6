"""Bytes to raw blocks: one folder per file format; no reader holds a whole file."""
