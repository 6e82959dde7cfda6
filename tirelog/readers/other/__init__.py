"""Formats that libraries convert: MATLAB 5, WAV, Parquet, Feather and those of the extras."""
