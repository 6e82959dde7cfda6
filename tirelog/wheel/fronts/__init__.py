"""Fronts of the contact patch in a radial acceleration, found, sampled and matched."""
