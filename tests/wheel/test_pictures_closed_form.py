"""Closed form: a passage's error bar in P4's pictures is two standard errors to each side."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from tirelog.plots.record import Panel
from tirelog.plots.style import draw_panel
from tirelog.plots.tables import _points


def test_bars_are_two_standard_errors_to_each_side() -> None:
    axes = Figure().subplots()
    mark = _points(np.arange(3.0), np.ones(3), np.array([0.1, np.nan, 0.3]), "k")
    draw_panel(axes, Panel(marks=[mark]))
    (bars,) = axes.containers[0].lines[2]
    heights = [np.ptp(segment[:, 1]) for segment in bars.get_segments()]
    assert heights == pytest.approx([0.4, 0.0, 1.2])
