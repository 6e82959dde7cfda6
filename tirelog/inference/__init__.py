"""Measured revolutions, their noise, and the fit of a model to them; `measured` is the door."""
