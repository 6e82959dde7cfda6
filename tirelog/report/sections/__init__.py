"""Sections of the page: what was recorded, the tables, and what a model says of them."""
