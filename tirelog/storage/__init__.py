"""Bytes on discs: files that appear whole or not at all, and documents."""
