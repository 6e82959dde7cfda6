"""HDF5 logs: columns named by the setup, read in slabs, damage distinguished from absence."""
