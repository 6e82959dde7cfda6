"""Speed and memory, side by side with the plain way, as ratios in one run.

`make bench` runs every bench_*.py; none is a test.
"""
