"""Closed form: what pictures of tables show of rows made by hand, and how long a bar is."""

import numpy as np
from matplotlib.figure import Figure

from tirelog.plots import tables
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
        "contact_pressure_N_m": np.arange(n, dtype=float),
        "quality": quality,
    }


def drawn(kept):
    return tables.table_picture([{"log": np.full(len(c["time_s"]), log), **c} for log, c in kept])


def test_a_panel_per_quantity_a_colour_per_channel_and_what_is_flagged_counted():
    kept = [("a/x.csv", rows("left", 6, (0, 5))), ("a/x.csv", rows("right", 4)),
            ("b.csv", rows("left", 3))]  # fmt: skip
    figure = drawn(kept)
    speed, pressure = figure.axes  # the acceleration is the same in all rows
    assert (speed.get_ylabel(), pressure.get_ylabel()) == ("speed [m/s]", "contact_pressure_N_m")
    assert figure.get_suptitle() == "not drawn: flagged rows 2"
    first, second, third = speed.containers
    assert [one.get_label() for one in (first, second, third)] == [
        "x.csv: left", "x.csv: right", "b.csv: left",
    ]  # fmt: skip
    np.testing.assert_array_equal(first.lines[0].get_ydata(), [11.0, 12.0, 13.0, 14.0])
    np.testing.assert_array_equal(second.lines[0].get_ydata(), [10.0, 11.0, 12.0, 13.0])
    assert first.lines[0].get_color() != second.lines[0].get_color()
    assert not pressure.containers


def test_many_passages_are_thinned_and_many_channels_counted():
    kept = [(f"{i}.csv", rows("left", 30_000 if i == 0 else 2)) for i in range(10)]
    figure = drawn(kept)
    assert figure.axes[0].containers[0].lines[0].get_ydata().size == 6_000
    assert figure.get_suptitle() == (
        "not drawn: channels with more than 6000 rows 1; further channels 2"
    )


def test_lengths_share_a_panel_and_strain_is_in_microstrain():
    n = np.arange(5.0)
    lengths = dict.fromkeys(("length_m", "length_d2_m", "length_d1_m"), 0.1 + 0.001 * n)
    figure = drawn([("a.csv", {**rows("left", 5), **lengths, "strain": 1e-6 * n})])
    shown = ["contact length [mm]"] * 2 + ["strain [microstrain]"]
    assert [axes.get_ylabel() for axes in figure.axes][2:] == shown
    assert [axes.get_xlabel() for axes in figure.axes][2:4] == ["time [s]", "speed [m/s]"]
    assert len(figure.axes[2].lines) == 3
    np.testing.assert_allclose(figure.axes[4].lines[0].get_ydata(), n)


def test_a_table_without_time_is_over_its_first_column():
    quality = np.full(3, "ok")
    part = {"speed_m_s": np.arange(3.0), "load_N": np.ones(3), "hub_N": np.arange(3.0)}
    names = {"log": np.full(3, "f.csv"), "channel": np.full(3, ""), "quality": quality}
    (axes,) = tables.table_picture([{**part, **names}]).axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("speed [m/s]", "hub_N")


def test_a_table_without_numbers_has_no_picture():
    words = {"time_s": np.zeros(2), "channel": ["a", "a"], "quality": ["ok", "ok"]}
    assert drawn([("a.csv", words)]) is None


def test_bars_are_two_standard_errors_to_each_side():
    axes = Figure().subplots()
    rows = {"x": np.arange(3.0), "y_m": np.ones(3), "y_se_m": np.array([1e-4, np.nan, 3e-4])}
    marks = tables.ways([("a", rows, 0, "circle")], "x", {"y_m": "words"}, 1e3)
    draw_panel(axes, Panel(marks=marks))
    (bars,) = axes.containers[0].lines[2]
    heights = [np.ptp(segment[:, 1]) for segment in bars.get_segments()]
    np.testing.assert_allclose(heights, [0.4, 0.0, 1.2])
