"""What the best model still leaves, in physical words."""
