"""The metric in which residuals are compared: whitening, free offsets, projections."""
