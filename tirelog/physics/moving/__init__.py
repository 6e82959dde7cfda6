"""A coupled ring in motion: equations, steady state, contact, road, modes."""
