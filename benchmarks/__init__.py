"""Speed and memory, side by side with the plain way, as ratios in one run.

`make bench` runs those of `bench`; none is a test.
"""
