"""Bytes on discs and in buckets: files that appear whole or not at all, addresses, documents."""
