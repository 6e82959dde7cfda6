"""Property: what Python gives is what the commands write, whatever way the logs are given."""

import json
import pickle
import re
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tirelog
from tests.cli.conftest import SETUP
from tests.processes import python
from tirelog.physics.model.file import as_toml
from tirelog.tables.frame import read_table
from tirelog.vocabulary.columns import COLUMNS

SAMPLES = Path(__file__).parents[2] / "sample_data"
BEAM = tirelog.Model.new("beam", load_N=3400.0)
DRIVE = {"speed_m_s": [10.0, 20.0], "water_depth_mm": 1.0, "acceleration_m_s2": -2.0}
PHI = np.linspace(-0.8, 0.8, 41)


def test_import_is_light():
    code = (
        "import sys, tirelog; tirelog.__version__; dir(tirelog); "
        "print(sorted({'numpy', 'pandas', 'numba', 'scipy', 'typer'} & set(sys.modules)))"
    )
    assert python(code).stdout.strip() == "[]"


def test_an_unknown_name_is_no_attribute():
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


def test_logs_by_path_open_and_several(folder):
    one = tirelog.speed("log.csv")
    with tirelog.open_log(folder / "log.csv", setup="log.toml") as log:
        several = tirelog.speed([log, Path("log.csv")])
    assert len(several) == 2 * len(one)
    assert several.time_s[: len(one)].equals(one.time_s)


def test_lost_input_is_warned_of(folder):
    with tirelog.open_log("log.csv") as log:
        log.losses.append("is cut off; copy it again")
        with pytest.warns(UserWarning, match="log.csv: is cut off"):
            tirelog.speed(log)


def test_the_regressions_of_dissipation(folder, command):
    assert command("dissipation", "log.csv", "--fit", "-o", "fit.parquet").status == 0
    written, table = read_table("fit.parquet"), tirelog.dissipation("log.csv", fit=True)
    assert list(table.columns) == list(written.columns)
    assert len(table) == len(written)
    assert any("no regression" in remark for remark in table.attrs["remarks"]) == (not len(table))


def test_a_log_that_is_closed_refuses_to_be_read(folder):
    log = tirelog.open_log("log.csv")
    channel = next(iter(log.channels.values()))
    assert channel.read(0, 3).size == 3
    log.close()
    log.close()  # once more does no harm
    with pytest.raises(tirelog.TirelogError):
        channel.read(0, 3)


def test_a_setup_is_a_path_an_object_or_a_dict(folder):
    (folder / "setup.toml").write_text((folder / "log.toml").read_text())
    (folder / "log.toml").unlink()
    read = tirelog.load_setup("setup.toml")
    tables = tomllib.loads((folder / "setup.toml").read_text())
    first, *others = (tirelog.speed("log.csv", setup=s) for s in ("setup.toml", read, tables))
    assert len(first) > 10
    assert all(first.equals(other) for other in others)
    models = [tirelog.new_model("beam", s)[0] for s in ("setup.toml", read, tables)]
    assert len({tuple(model.values.items()) for model in models}) == 1
    assert tirelog.write_report("log.csv", "r.html", setup=tables)


def test_a_model_is_a_path_an_object_or_a_dict(folder):
    tirelog.save_model(tirelog.Model.new("beam", "patch_length"), "m.toml")
    forms = ("m.toml", folder / "m.toml", tirelog.load_model("m.toml"))
    forms = (*forms, tomllib.loads((folder / "m.toml").read_text()))
    measured = [tirelog.measure("log.csv", form) for form in forms]
    asked = (tirelog.compare, tirelog.fit, tirelog.diagnose, tirelog.ladder)
    for ask in asked:
        answers = [ask(measured[0], form).to_json() for form in forms]
        for answer in answers:
            answer.pop("next_command", "")
        assert all(answer == answers[0] for answer in answers), ask.__name__
    assert len({repr(one) for one in measured}) == 1
    beam = tomllib.loads(as_toml(BEAM))
    wave = tirelog.predict(beam, speed_m_s=20.0)
    np.testing.assert_array_equal(wave, tirelog.predict(BEAM, {"speed_m_s": 20.0}))
    assert tirelog.contributions(beam, {"speed_m_s": 20.0})["base"].shape == wave.shape
    said = tirelog.write_report("log.csv", "r.html", model=tirelog.load_model("m.toml"))
    assert said[0].startswith("r.html")
    assert "--model m.toml" in (folder / "r.html").read_text()
    (folder / "own.py").write_text(
        "from tirelog.physics.effects import BY_ID\nfrom dataclasses import replace\n"
        'mine = replace(BY_ID["sensor_lag"], id="mine")\n'
    )
    tirelog.write_report("log.csv", "r.html", model=tirelog.load_model("m.toml", effects="own.py"))
    commands = (folder / "r.html").read_text().split("Commands that repeat it")[1]
    assert re.search("tirelog report log.csv .*--effects own.py", commands)


def test_dir_has_the_public_names_alone():
    names = set(dir(tirelog)) - {"__doc__", "__version__"}
    assert names >= set(tirelog.__all__)
    values = {name: getattr(tirelog, name) for name in names}
    assert all(callable(value) for value in values.values())
    assert pickle.loads(pickle.dumps(values)) == values  # as processes of a pool take them


def test_a_number_is_a_cut_off_in_hertz(folder):
    table = tirelog.footprint("log.csv", cutoff=400)
    assert table.equals(tirelog.footprint("log.csv", cutoff="400Hz"))
    assert not table.equals(tirelog.footprint("log.csv", cutoff=200.0))


def test_contributions_sum_to_the_whole():
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
        (lambda: tirelog.fit([], BEAM), "holds no measured revolutions"),
        (lambda: tirelog.speed("none.csv"), "none.csv: cannot be read"),
        (lambda: tirelog.footprint("log.csv", cutoff="fast"), "400Hz"),
        (lambda: tirelog.dissipation("log.csv", steady_step_m_s=0), "^steady_step_m_s 0; allowed"),
        (lambda: tirelog.load_model("none.toml"), "none.toml"),
        (lambda: tirelog.predict(7, speed_m_s=9.0), "int is no model"),
        (lambda: tirelog.speed("log.csv", setup=7), "int is no setup"),
        (
            lambda: tirelog.speed("log.csv", setup={"tire": {"name": object()}}),
            "this dict is no setup",
        ),
        (lambda: tirelog.write_report("log.csv"), "add output PAGE.html"),
        (lambda: tirelog.plot_table("speed", "log.csv", "p.gif"), "^picture p.gif: suffix"),
        (lambda: tirelog.speed("log.csv", start="noon"), "start noon; allowed are seconds"),
    ],
)
def test_what_cannot_be_is_a_tirelog_error(folder, ask, says):
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


# ---- what a command does in one call ------------------------------------------------------------


ENCODER = Path(__file__).parents[2] / "sample_data" / "encoder_ramp.h5"


def test_a_log_is_ingested_drafted_and_checked(folder: Path) -> None:
    assert tirelog.ingest("log.csv", "run.h5").losses == []
    by_run, by_log = (tirelog.speed(log).drop(columns="log") for log in ("run.h5", "log.csv"))
    assert by_run.equals(by_log)
    assert not tirelog.check_setup("log.csv").implausible
    (folder / "wrong.toml").write_text(SETUP.replace('"nm"', '"um"'))
    assert tirelog.check_setup("log.csv", "wrong.toml").implausible
    draft = tirelog.draft_setup("log.csv", "draft.toml")
    assert (folder / "draft.toml").read_text() == draft.text


def test_a_calibration_is_learnt_and_applied(folder: Path) -> None:
    learnt = tirelog.calibrate(ENCODER)
    tirelog.save_calibration(learnt, "own.toml")
    tables = [tirelog.phase_shift(ENCODER, calibration=one) for one in (learnt, "own.toml")]
    pd.testing.assert_frame_equal(*tables)
    assert tables[0].phase_shift_detrended_deg.notna().any()


def test_pictures_of_tables(folder: Path) -> None:
    tirelog.plot_table("footprint", "log.csv", "p.png")
    assert (folder / "p.png").read_bytes().startswith(b"\x89PNG")
    for name in ("speed", "footprint", "dissipation"):
        shown = tirelog.plot_table(name, "log.csv")
        assert shown._repr_png_().startswith(b"\x89PNG")  # in a notebook
    for given, says in (
        (("slip", {}), "has no picture"),
        (("footprint", {"cut_off": "auto"}), "nearest: cutoff"),
        (("footprnt", {}), "nearest: footprint"),
    ):
        with pytest.raises(tirelog.TirelogError, match=says):
            tirelog.plot_table(given[0], "log.csv", "x.png", **given[1])
    assert not (folder / "x.png").exists()


def test_a_campaign_is_run_and_asked(folder: Path) -> None:
    (folder / "c.toml").write_text(
        '[campaign]\nname = "c"\noutput = "made"\n[[logs]]\nglob = "log.csv"\n[tables.speed]\n'
    )
    assert tirelog.campaign_status("c.toml").count("open") == 1
    said: list[str] = []
    done = tirelog.run_campaign("c.toml", progress=said.append)
    assert (done.logs, done.worked, done.failed, done.lost) == (1, 1, (), ())
    assert any(done.summary in sentence for sentence in said)
    assert tirelog.campaign_status("c.toml").count("done") == 1


def test_a_report_is_written_or_refused(folder: Path) -> None:
    said = tirelog.write_report("log.csv", "r.html")
    assert said[0].startswith("r.html: ")
    page = (folder / "r.html").read_text()
    assert "tirelog report log.csv -o report.html" in page
    for given, says in (
        ({}, "nothing to report on"),
        ({"logs": "log.csv"}, "nothing to write"),
        ({"logs": "log.csv", "output": "r.pdf"}, "the page is HTML"),
    ):
        with pytest.raises(tirelog.TirelogError, match=says):
            tirelog.write_report(**given)


def test_tables_that_differ_are_told(folder: Path) -> None:
    table = tirelog.speed("log.csv")
    table.to_csv("old.csv", index=False)
    table.assign(speed_m_s=table.speed_m_s * 1.01).to_csv("new.csv", index=False)
    found = tirelog.check("new.csv", "old.csv")
    assert {one.column for one in found.differences} == {"speed_m_s"}
    assert tirelog.check("old.csv", "old.csv").differences == ()
