"""A model against hits on obstacles: fit in time, comparison, what a motion tells."""
