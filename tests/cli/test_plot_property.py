"""Property: `tirelog plot` draws what a file holds, and says what it cannot."""

import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tirelog as package
from tests.cli.conftest import RATE_HZ, Command

FORM = {
    "pressure": {name: [1.0, 2.0] for name in ("at", "value", "se", "formula")},
    "stiffness": {name: [1.0, 2.0] for name in ("at", "value", "se", "formula")},
    "load_N": 3000.0,
    "speed_m_s": 20.0,
}
EFFECT = {"effect": "water_film", "excess_removed": 0.9, "p_adjusted": 0.002, "selected": True}
DIAGNOSIS = {
    "verdict": "missing",
    "sentence": "water_film is missing.",
    "effects": [{**EFFECT, "group": []}],
    "rmse_heldout_before": 4.0,
    "rmse_heldout_after": 1.0,
    "noise_floor": 2.0,
}
STEP = {
    "step": 0, "effect": "start", "rmse_fit": 1e-6, "rmse_heldout": 2e-6, "noise_floor": 1e-6,
    "excess_heldout": 1e-6, "p_adjusted": None, "decision": "start", "outcome": "start",
    "sentence": "", "parameters": {},
}  # fmt: skip
LADDER = {"observable": "strain", "unit": "1", "steps": [STEP], "manoeuvres": 8}


def labels(figure):
    return [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes]


def test_a_log_is_its_signals_with_a_point_below_each_passage(folder: Path) -> None:
    rows = package.speed("log.csv", start=1.0, stop=3.0)
    strain, temperature = package.plot("log.csv", start=1.0, stop=3.0).axes
    signal, clean, flagged = strain.lines
    assert strain.get_ylabel() == "strain_1\n[microstrain]"
    assert temperature.get_ylabel() == "temp_1\n[K]"
    times, values = signal.get_xdata(), signal.get_ydata()
    assert (times.min(), times.max()) == pytest.approx((1.0, 3.0), abs=1.01 / RATE_HZ)
    assert -1050 < values.min() < -950
    np.testing.assert_allclose(clean.get_xdata(), rows.time_s[rows.quality == "ok"])
    assert len(rows) == len(clean.get_xdata()) + len(flagged.get_xdata()) > 10
    assert (clean.get_ydata() < values.min()).all()
    assert not temperature.lines[1:]


@pytest.mark.parametrize("channels", [["temp_1"], ["temp_1", "strain_1"]])
def test_only_the_channels_asked_for_are_drawn(folder: Path, channels: list[str]) -> None:
    figure = package.plot("log.csv", channel=channels)
    assert [axes.get_ylabel().split("\n")[0] for axes in figure.axes] == channels


def test_a_log_without_a_setup_is_drawn_by_a_draft(folder: Path, tirelog: Command) -> None:
    (folder / "log.toml").unlink()
    done = tirelog("plot log.csv -o raw.png")
    assert done.status == 0
    assert (folder / "raw.png").stat().st_size > 5000
    assert "passages are not marked: the setup has no radius" in done.err


@pytest.mark.parametrize("suffix", ["csv", "parquet", "ndjson", "json"])
def test_a_table_of_any_format_is_drawn_over_time(
    folder: Path, tirelog: Command, suffix: str
) -> None:
    assert tirelog(f"speed log.csv -o table.{suffix}").status == 0
    figure = package.plot(f"table.{suffix}")
    assert labels(figure)[0] == ("time [s]", "speed [m/s]")
    drawn = figure.axes[0].containers[0].lines[0]
    rows = package.speed("log.csv")
    np.testing.assert_allclose(drawn.get_ydata(), rows.speed_m_s[rows.quality == "ok"], rtol=1e-6)


def test_a_table_with_a_column_of_one_s_own_is_drawn(folder: Path) -> None:
    table = package.speed("log.csv")
    table.assign(mine=np.arange(len(table))).to_csv("mine.csv", index=False)
    assert ("time [s]", "mine") in labels(package.plot("mine.csv"))


def test_a_log_of_columns_with_names_of_tables_is_a_log(folder: Path) -> None:
    pd.DataFrame({"time_s": np.arange(2e3) / 1e3, "strain": 1e-6, "speed_m_s": 9.0}).to_csv(
        "l.csv", index=False
    )
    (folder / "l.toml").write_text(
        '[tire]\nrolling_radius_m = 0.3\n[channels.s]\nkind = "strain"\nsource = "strain"\n'
    )
    assert [label for _, label in labels(package.plot("l.csv"))] == ["s\n[microstrain]"]


def test_a_log_whose_preamble_has_a_model_is_a_log(folder: Path) -> None:
    log = (folder / "log.csv").read_text()
    (folder / "other.csv").write_text(f"[model]\nname = X-1\n{log}")
    figure = package.plot("other.csv", setup="log.toml", channel=["strain_1"])
    assert figure.axes[0].get_ylabel() == "strain_1\n[microstrain]"


def test_a_model_is_its_waveform_its_pressure_and_its_effects(model: Path) -> None:
    package.save_model(
        package.load_model(model).with_effect("water_film", amplitude=0.05), "wet.toml"
    )
    figure = package.plot("wet.toml")
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        "strain of the beam", "contact pressure", "water_film",
    ]  # fmt: skip
    waves = {line.get_label(): line.get_ydata() for line in figure.axes[0].lines}
    phi = np.linspace(-0.8, 0.8, 801)
    given = {"speed_m_s": 20.0, "water_depth_mm": 1.0, "inflation_pressure_Pa": 2.2e5}
    expected = 1e6 * package.predict("wet.toml", given, phi)[0]
    np.testing.assert_allclose(waves["20 m/s"], expected, rtol=1e-9)


SCREEN = """
from matplotlib.backends.backend_agg import FigureCanvasAgg as FigureCanvas
from matplotlib.backend_bases import FigureManagerBase as FigureManager
from matplotlib._pylab_helpers import Gcf
def show(*args, **kwargs):
    for manager in Gcf.get_all_fig_managers():
        manager.canvas.figure.savefig("shown.png")
"""


@pytest.mark.parametrize(
    ("answer", "shown"),
    [
        (FORM, "contact pressure (N/mm)"),
        (DIAGNOSIS, "error over the noise floor"),
        (LADDER, "strain error [microstrain]"),
    ],
)
@pytest.mark.parametrize("indent", [None, 1])
def test_an_answer_is_drawn_from_its_json(
    folder: Path, answer: dict[str, object], shown: str, indent: int | None
) -> None:
    Path("answer").write_text(json.dumps(answer, indent=indent))
    assert shown in [label for _, label in labels(package.plot("answer"))]


def test_errors_of_an_answer_are_in_noise_floors(folder: Path) -> None:
    Path("d.json").write_text(json.dumps(DIAGNOSIS))
    errors = package.plot("d.json").axes[1]
    assert [bar.get_height() for bar in errors.patches] == [2.0, 0.5]


def test_on_a_screen_a_window_shows_it(folder: Path, tirelog: Command, monkeypatch) -> None:
    (folder / "a_screen.py").write_text(SCREEN)
    monkeypatch.syspath_prepend(folder)
    from matplotlib import pyplot

    before = pyplot.get_backend()
    try:
        pyplot.switch_backend("module://a_screen")
        assert tirelog("plot log.csv").status == 0
    finally:
        pyplot.close("all")
        pyplot.switch_backend(before)
        sys.modules.pop("a_screen")
    assert (folder / "shown.png").stat().st_size > 5000
