"""Formats that other libraries read, each in a process of its own, made HDF5, MCAP or text."""
