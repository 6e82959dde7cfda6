"""HDF5 logs: columns named by the setup, read in slabs, damage told apart from absence."""
