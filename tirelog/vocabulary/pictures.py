"""Which pictures a command can draw, and which tables of errors, by name.

`--plot-kind` takes the one (the first is drawn without it), `compare --by` the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tirelog.errors import UsageError

FOOTPRINT: Mapping[str, str] = {
    "page": "the drive, contact lengths, and passages with their derivatives (P2)",
    "waterfall": "strain over angle and revolution, in colour",
    "polar": "mean strain around the wheel by speed, with the patch",
    "edges": "entry and exit edge close up by speed, with bands and the edges found",
    "lengths": "contact length with error bars over speed and time, a colour per log",
    "orders": "strain over speed (or time) and frequency, order by order",
}
COMPARE: Mapping[str, str] = {
    "page": "waveforms with the floor's band, and maps of what the model misses",
    "polar": "measured and predicted around the wheel, with the model's contact pressure",
    "edges": "entry and exit edge close up, with the floor's band, and what is left there",
}
#: tables of errors that `compare` has of obstacles, and all that it can have
BY_OBSTACLE = ("hit", "time", "frequency")
ERRORS_BY = ("revolution", "angle", "speed", "regime", "conditions", *BY_OBSTACLE)
#: of files that a picture can be written to
SUFFIXES = (".png", ".svg", ".pdf")


def refuse_no_picture(path: Path) -> None:
    """UsageError: the path's suffix is not a picture's."""
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(
            f"--plot {path}: suffix {path.suffix!r}",
            allowed=f"allowed are {', '.join(SUFFIXES)}",
            do="rename it",
        )


def no_matplotlib() -> UsageError:
    """The error that says how to come by what draws pictures."""
    return UsageError(
        "--plot needs matplotlib",
        allowed="allowed without it are tables",
        do="install it: pip install 'tirelog[plot]'",
    )
