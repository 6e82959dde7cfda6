"""What a grating in the tire tells: speed, footprint, dissipation, inflation."""
