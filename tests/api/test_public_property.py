"""Property: what Python gives is what the commands write, whatever way the logs are given; parts
of a prediction sum to the whole.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tirelog
from tests.cli.conftest import Command
from tirelog.tables.frame import read_table
from tirelog.vocabulary.columns import COLUMNS

SAMPLES = Path(__file__).parents[2] / "sample_data"
BEAM = tirelog.Model.new("beam", load_N=3400.0)
DRIVE = {"speed_m_s": [10.0, 20.0], "water_depth_mm": 1.0, "acceleration_m_s2": -2.0}
PHI = np.linspace(-0.8, 0.8, 41)


def test_import_is_light() -> None:
    code = (
        "import sys, tirelog; tirelog.__version__; dir(tirelog); "
        "print(sorted({'numpy', 'pandas', 'numba', 'scipy', 'typer'} & set(sys.modules)))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


def test_an_unknown_name_is_no_attribute() -> None:
    with pytest.raises(AttributeError, match="tirelog"):
        tirelog.sped  # noqa: B018


@pytest.mark.parametrize("name", ["speed", "footprint", "dissipation"])
def test_a_table_is_the_command_s(folder, command, name):
    assert command(name, "log.csv", "-o", "t.parquet").status == 0
    written = read_table("t.parquet")
    table = getattr(tirelog, name)("log.csv")
    pd.testing.assert_frame_equal(table, written, check_dtype=False, check_exact=True)
    assert table.attrs["units"] == {c: COLUMNS[c].unit for c in written.columns}
    assert table.attrs["descriptions"]["speed_m_s"] == COLUMNS["speed_m_s"].meaning


def test_logs_by_path_open_and_several(folder: Path) -> None:
    one = tirelog.speed("log.csv")
    with tirelog.open_log(folder / "log.csv", setup="log.toml") as log:
        several = tirelog.speed([log, Path("log.csv")])
    assert len(several) == 2 * len(one)
    assert several.time_s[: len(one)].equals(one.time_s)


def test_lost_input_is_warned_of(folder: Path) -> None:
    with tirelog.open_log("log.csv") as log:
        log.losses.append("is cut off; copy it again")
        with pytest.warns(UserWarning, match="log.csv: is cut off"):
            tirelog.speed(log)


def test_the_regressions_of_dissipation(folder: Path, command: Command) -> None:
    assert command("dissipation", "log.csv", "--fit", "-o", "fit.parquet").status == 0
    written, table = read_table("fit.parquet"), tirelog.dissipation("log.csv", fit=True)
    assert list(table.columns) == list(written.columns)
    assert len(table) == len(written)
    assert any("no regression" in remark for remark in table.attrs["remarks"]) == (not len(table))


def test_a_log_that_is_closed_refuses_to_be_read(folder: Path) -> None:
    log = tirelog.open_log("log.csv")
    channel = next(iter(log.channels.values()))
    assert channel.read(0, 3).size == 3
    log.close()
    log.close()  # once more does no harm
    with pytest.raises(tirelog.TirelogError):
        channel.read(0, 3)


def test_contributions_sum_to_the_whole() -> None:
    model = BEAM.with_effect("water_film", amplitude=0.08).with_effect("stiffening")
    stiff = next(n for n in model.parameters if n.startswith("stiffening."))
    model = model.with_values({stiff: model.parameters[stiff].probe})
    parts = tirelog.contributions(model, DRIVE, PHI)
    assert list(parts) == ["base", "water_film", "stiffening", "interaction"]
    whole = tirelog.predict(model, DRIVE, PHI)
    assert whole.shape == (2, PHI.size)
    np.testing.assert_allclose(sum(parts.values()), whole, atol=1e-15)
    np.testing.assert_array_equal(parts["base"], tirelog.predict(BEAM, DRIVE, PHI))
    alone = tirelog.predict(BEAM.with_effect("water_film", amplitude=0.08), DRIVE, PHI)
    bare = tirelog.predict(model.without_effect("water_film"), DRIVE, PHI)
    np.testing.assert_allclose(parts["water_film"], whole - bare, atol=1e-15)
    # the effects are not additive, and the remainder says by how much
    apart = (alone - parts["base"]) - parts["water_film"]
    np.testing.assert_allclose(parts["interaction"], apart, atol=1e-15)
    assert np.abs(parts["interaction"]).max() > 1e-4 * np.abs(whole).max()


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        (lambda: tirelog.predict(BEAM, {"sped": 20.0}), r"nearest: speed_m_s"),
        (lambda: tirelog.predict(BEAM, {"speed_m_s": 300.0}), "0 to 200 m/s"),
        (lambda: tirelog.predict(BEAM, {"load_N": 3000.0}), "speed_m_s nan"),
        (lambda: tirelog.predict(BEAM, {"speed_m_s": [1, 2], "slip": [0, 0, 0]}), "one length"),
        (
            lambda: tirelog.predict(BEAM, {"speed_m_s": 9, "inflation_pressure_Pa": 2.2}),
            "2.2 bar is 2.2e5",
        ),
        (lambda: tirelog.measure("log.csv", "strian"), "nearest: strain"),
        (lambda: tirelog.measure(7, "strain"), "int is no log"),  # type: ignore[arg-type]
        (lambda: tirelog.compare("log.csv", BEAM), "measure first"),  # type: ignore[arg-type]
        (lambda: tirelog.fit([], BEAM), "nothing measured"),
        (lambda: tirelog.speed("none.csv"), "none.csv: cannot be read"),
        (lambda: tirelog.footprint("log.csv", cutoff="fast"), "400Hz"),
        (lambda: tirelog.dissipation("log.csv", averaged=0), "at least 1 revolution"),
        (lambda: tirelog.inflation("log.csv", from_Pa=1e5), "two pressures in Pa"),
        (lambda: tirelog.load_model("none.toml"), "none.toml"),
    ],
)
def test_what_cannot_be_is_a_tirelog_error(folder: Path, ask, says: str) -> None:
    with pytest.raises(tirelog.TirelogError, match=says):
        ask()


def test_answers_are_drawn_shown_and_written(folder, command):
    from matplotlib.figure import Figure

    model = tirelog.Model.new("beam", "patch_length")
    tirelog.save_model(model, "m.toml")
    measured = tirelog.measure("log.csv", model)
    compared = tirelog.compare(measured, model)
    assert command("compare", "log.csv", "--model", "m.toml", "-o", "c.json").status == 0
    assert compared.to_json() == json.loads(Path("c.json").read_text())
    found = tirelog.diagnose(measured, model)
    assert command("diagnose", "log.csv", "--model", "m.toml", "-o", "d.json").status == 0
    assert found.to_json() == json.loads(Path("d.json").read_text()) | {
        "next_command": found.next_command
    }
    climbed, fitted = tirelog.ladder(measured, model), tirelog.fit(measured, model)
    for answer in (compared, found, climbed, fitted):
        assert "<table>" in answer._repr_html_()
        json.dumps(answer.to_json(), allow_nan=False)
        axes = Figure().add_subplot()
        assert answer.plot(axes) is axes.figure
        # of too few manoeuvres the ranking is empty
        assert axes.has_data() or axes.images or axes.get_title("left")
        with pytest.raises(AttributeError):
            answer.model = model
    assert isinstance(compared.plot("c.png"), Figure)
    assert Path("c.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(tirelog.TirelogError, match=r"allowed are \.png"):
        fitted.plot("c.docx")
    for name, value in fitted.model.values.items():
        assert value == pytest.approx(compared.model.values[name], rel=1e-6)


def test_a_fit_of_numbers_per_revolution_says_which_nuisances_it_leaves_out() -> None:
    log = str(SAMPLES / "encoder_ramp.h5")
    measured = tirelog.measure(log, "phase_shift")
    with tirelog.open_log(log) as opened:
        model, _ = tirelog.new_model("ring", opened.setup, observable="phase_shift")
    plain = tirelog.fit(measured, model)
    other = tirelog.fit(measured, model, nuisances=("offset",))
    assert not any("nuisances" in said for said in plain.remarks)
    assert any("nuisances (offset) not used" in said for said in other.remarks)
    assert other.model.parameters == plain.model.parameters
