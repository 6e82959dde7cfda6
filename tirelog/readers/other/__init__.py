"""Formats that are brought to one of the others: MATLAB 5 to HDF5, Parquet to text; and WAV."""
