"""Closed form: what `--plot` draws of rows made by hand, and how long an error bar is."""

from types import SimpleNamespace

import numpy as np
from matplotlib.figure import Figure

from tirelog.plots import tables as speed
from tirelog.plots.record import Panel, draw_panel


def rows(channel, n, flagged=()):
    quality = np.full(n, "ok", dtype=object)
    quality[list(flagged)] = "edge_of_log"
    return {
        "channel": np.full(n, channel),
        "time_s": np.arange(n, dtype=float),
        "speed_m_s": 10.0 + np.arange(n),
        "speed_se_m_s": np.full(n, 0.5),
        "acceleration_m_s2": np.ones(n),
        "quality": quality,
    }


def drawn(kept):
    return speed.speed_picture(
        [(SimpleNamespace(log=log), SimpleNamespace(columns=c)) for log, c in kept]
    )


def test_a_row_per_log_a_colour_per_channel_and_what_is_flagged_apart():
    kept = [("a/x.csv", rows("left", 6, (0, 5))), ("a/x.csv", rows("right", 4)),
            ("b.csv", rows("left", 3))]  # fmt: skip
    figure = drawn(kept)
    assert len(figure.axes) == 4
    first, _, second, _ = figure.axes
    assert first.get_title(loc="left") == "x.csv; bars: two errors; 2 flagged rows are not drawn"
    assert second.get_title(loc="left").startswith("b.csv")
    good, other = (drawn.lines[0] for drawn in first.containers)
    np.testing.assert_array_equal(good.get_ydata(), [11.0, 12.0, 13.0, 14.0])
    np.testing.assert_array_equal(other.get_ydata(), [10.0, 11.0, 12.0, 13.0])
    assert good.get_color() != other.get_color()


def test_many_passages_are_thinned_and_many_logs_counted():
    kept = [(f"{i}.csv", rows("left", 30_000 if i == 0 else 2)) for i in range(10)]
    figure = drawn(kept)
    assert len(figure.axes) == 16
    assert figure.axes[0].containers[0].lines[0].get_ydata().size == 15_000
    assert figure.get_suptitle() == "2 more logs are not drawn"


def test_a_log_without_a_passage_is_an_empty_row():
    figure = drawn([("a.csv", rows("left", 0))])
    assert len(figure.axes) == 2


def test_bars_are_two_standard_errors_to_each_side():
    axes = Figure().subplots()
    rows = {"x": np.arange(3.0), "y": np.ones(3), "se": np.array([0.1, np.nan, 0.3])}
    marks = speed.ways([("a", rows, 0, "circle")], "x", {"y": "words"}, error="se")
    draw_panel(axes, Panel(marks=marks))
    (bars,) = axes.containers[0].lines[2]
    heights = [np.ptp(segment[:, 1]) for segment in bars.get_segments()]
    np.testing.assert_allclose(heights, [0.4, 0.0, 1.2])
