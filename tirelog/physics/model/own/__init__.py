"""Effects of your own: formulas and their units, measured shapes, Python files, packages."""
