"""A channel cut into revolutions and laid on one grid of angles."""
