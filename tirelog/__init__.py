"""tirelog: from the recorded logs of a sensorised tire to tidy tables, and from tables to the
physics a model lacks.
"""

__version__ = "0.2.0.dev0"
