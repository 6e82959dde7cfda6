"""Estimators: a Recording in, a table out, a row a passage of the sensor through the patch."""
