"""Passages of a sensor through the contact patch: found, fitted, marked."""
