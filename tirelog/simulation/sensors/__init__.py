"""From truth to a recorded log: sampling, encoder, accelerometer, and the writers."""
