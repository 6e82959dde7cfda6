"""The 48-step encoder: pulses to teeth, tooth errors, and the angle of the wheel."""
