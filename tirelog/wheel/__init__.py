"""What encoder and in-tire accelerometer tell: angle, phase shift, calibration, forces."""
