"""What the strain pictures share.

A page, its colours, long signals drawn so that no peak vanishes, and writing it whole.

matplotlib is an extra (`pip install 'tirelog[plot]'`): it is imported here, when a picture was
asked for, and its absence is said in words.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.data.recording import BLOCK_SAMPLES, Channel
from tirelog.storage.whole import whole_file
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.tables import no_matplotlib, refuse_no_picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: colours that the colour-blind tell apart (Okabe and Ito)
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
RAW, EDGE, MARK = "#999999", "#D55E00", "#009E73"
MICRO = 1e6
#: pixels per inch in a notebook: a page of 13 inches is as wide as its column
NOTEBOOK_DPI = 72
#: columns of a decimated signal
COLUMNS = 1500


@cache
def _page() -> type[Figure]:
    """A figure that a notebook shows without pyplot, which would keep every one of them."""
    from matplotlib.figure import Figure

    class Page(Figure):
        """A figure with a form in PNG."""

        def _repr_png_(self) -> bytes:
            made = BytesIO()
            self.savefig(made, format="png", dpi=NOTEBOOK_DPI)
            return made.getvalue()

    return Page


def figure_page(width: float, height: float) -> Figure:
    """An empty page, inches.  UsageError: matplotlib is not there."""
    try:
        kind = _page()
    except ImportError:
        raise no_matplotlib() from None
    return kind(figsize=(width, height), layout="constrained")


def write(figure: Figure, path: Path) -> None:
    """The page as a file of its suffix's format, whole or not at all.

    UsageError: not a picture's suffix.
    """
    refuse_no_picture(path)
    with whole_file(path) as target:
        figure.savefig(target, format=path.suffix.lower()[1:], dpi=120)


def label(axes: Axes, x: str, y: str, title: str = "", **limits: Any) -> None:
    """Axis labels, a title at the left, a faint grid."""
    axes.set(xlabel=x, ylabel=y, **limits)
    if title:
        axes.set_title(title, loc="left", fontsize=10)
    axes.grid(alpha=0.25, linewidth=0.6)


def least_and_most(
    channel: Channel, columns: int = COLUMNS
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time, least and largest value of the channel in `columns` cells.

    The cells have equal numbers of samples: no peak is lost on the page.
    """
    size = max(-(-channel.size // columns), 1)
    times, low, high = [], [], []
    step = max(BLOCK_SAMPLES // size, 1) * size
    for start in range(0, channel.size, step):
        values = np.asarray(channel.read(start, start + step), dtype=np.float64)
        short = -values.size % size
        rows = np.pad(values, (0, short), constant_values=np.nan).reshape(-1, size)
        rows = rows[np.isfinite(rows).any(axis=1)]
        times.append(
            channel.axis.at(np.asarray(start + size * (np.arange(rows.shape[0]) + 0.5), np.float64))
        )
        low.append(np.nanmin(rows, axis=1) if rows.size else np.zeros(0))
        high.append(np.nanmax(rows, axis=1) if rows.size else np.zeros(0))
    return np.concatenate(times), np.concatenate(low), np.concatenate(high)


def draw_signal(axes: Axes, signal: tuple[FloatArray, FloatArray, FloatArray]) -> None:
    """The whole strain of a channel in microstrain over time.

    `signal` as `least_and_most` gives it.
    """
    time, low, high = signal
    axes.fill_between(time, MICRO * low, MICRO * high, color=COLOURS[0], linewidth=0.5, alpha=0.9)


def robust_range(
    *values: FloatArray, share: float = 0.01, margin: float = 0.15
) -> tuple[float, float]:
    """Limits that hold all but `share` of the finite values at either end, with a margin."""
    finite = np.concatenate([v[np.isfinite(v)] for v in values] or [np.zeros(0)])
    if not finite.size:
        return 0.0, 1.0
    low, high = (float(q) for q in np.quantile(finite, (share, 1.0 - share)))
    room = margin * (high - low) or 0.05 * abs(high) or 1.0
    return low - room, high + room


#: a slide of 16:9 [inches]
SLIDE = (13.3, 7.5)
#: sizes that the back row reads; a legend of many logs has to fit beside the lines
_LARGE: dict[Any, Any] = {
    "font.size": 14.0,
    "axes.labelsize": 14.0,
    "axes.titlesize": 14.0,
    "legend.fontsize": 11.0,
    "figure.titlesize": 16.0,
    "lines.linewidth": 1.8,
}


@contextmanager
def on_a_slide() -> Iterator[None]:
    """Large letters and lines for what is drawn, and written, inside."""
    figure_page(1.0, 1.0)  # says it if matplotlib is missing
    from matplotlib import rc_context

    with rc_context(_LARGE):
        yield


def by_value(values: Sequence[float] | FloatArray) -> list[Any]:
    """A colour for each of ordered values, dark to light: told apart by the colour-blind too."""
    from matplotlib import colormaps

    given = np.asarray(values, float)
    span = np.ptp(given) if given.size else 0.0
    place = (given - given.min()) / span if span > 0.0 else np.zeros(given.size)
    return list(colormaps["viridis"](0.88 * place))
