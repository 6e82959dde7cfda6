"""Raw blocks to a recording: clock, scaling to SI, and the checksummed run file."""
