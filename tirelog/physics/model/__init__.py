"""A model as a list of effects: its file, its stages, its prediction, user expressions."""
