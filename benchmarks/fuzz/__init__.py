"""Hostile input by the thousand: does every command end with a message and a status?

`python -m benchmarks.fuzz --cases 10000` makes small good files of each kind (`bases`), damages
them (`damage`), runs one command on each in a process of its own (`case`) and counts what may not
happen.
"""
