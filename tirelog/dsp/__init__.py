"""Signal processing: arrays in, arrays out; no knowledge of tires."""
