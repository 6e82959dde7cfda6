"""A log that nobody has described yet: what is in it, and a first setup for it."""
