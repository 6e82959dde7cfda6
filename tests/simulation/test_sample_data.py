"""Golden: sample_data is what its README says and what its scenarios make."""

from __future__ import annotations

import hashlib
import re
import runpy
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from tirelog.runs.ingest import open_recording
from tirelog.simulation import load_scenario, simulate, to_recording
from tirelog.simulation.scenario.schema import Manoeuvre, Nuisances

FOLDER = Path(__file__).parents[2] / "sample_data"
LOGS = runpy.run_path(str(FOLDER / "make.py"))["LOGS"]
README = (FOLDER / "README.md").read_text(encoding="utf-8")
TABLE = re.findall(r"^\| (\S+) \| (\d+) \| `([0-9a-f]{64})` \|$", README, re.MULTILINE)


def test_table_of_the_readme():
    named = {name for name, _, _ in TABLE}
    assert named >= set(LOGS)
    assert len(TABLE) == 3 * len(LOGS)
    for name, size, digest in TABLE:
        data = (FOLDER / name).read_bytes()
        assert (len(data), hashlib.sha256(data).hexdigest()) == (int(size), digest)


def test_example_of_nuisances_has_all_of_them_and_can_be_driven():
    scenario = load_scenario(FOLDER / "scenarios" / "nuisances.toml")
    for name in (f.name for f in fields(Nuisances)):
        assert getattr(scenario.nuisances, name) != getattr(Nuisances(), name), name
    made = simulate(
        replace(scenario, manoeuvres=(Manoeuvre(1.0, 12.0),), grid_points=512, knot_s=0.05)
    )
    assert 0.0 < np.isnan(made.channels["strain_1"]).mean() < 0.1


def test_size_and_nothing_unnamed():
    files = [p for p in FOLDER.rglob("*") if p.is_file()]
    assert sum(p.stat().st_size for p in files) < 10e6
    known = {name for name, _, _ in TABLE} | {f"{scenario}.toml" for scenario in LOGS.values()}
    known |= {"README.md", "make.py", "demo.py"}
    for file in files:
        if file.parent in (FOLDER, FOLDER / "scenarios") and file.name not in known:
            assert re.search(rf"[`/]{file.stem}(\.toml)?[` ]", README), file


@pytest.mark.parametrize(
    "log", ["drive.csv.gz", "drive_messages.mcap", "inflation.csv.gz", "encoder.h5"]
)
def test_log_is_still_what_the_simulator_makes(log):
    expected = to_recording(simulate(load_scenario(FOLDER / "scenarios" / f"{LOGS[log]}.toml")))
    with open_recording(str(FOLDER / log)) as read:
        assert not read.losses
        for channel in expected.channels.values():
            got, want = read.channels[channel.name].read(), channel.read()
            # a lost peak of the temperature twin may take the strain's sample with it
            twin = (
                read.channels["temp_1"].read()
                if channel.kind == "fbg_strain" and "temp_1" in read.channels
                else want
            )
            assert np.array_equal(np.isnan(got), np.isnan(want) | (np.isnan(got) & np.isnan(twin)))
            # a last digit may fall to the other side on another machine
            step = {"fbg_strain": 1e-7, "fbg_temperature": 0.011}.get(
                channel.kind, 1e-3 * np.nanmax(np.abs(want))
            )
            assert np.nanmax(np.abs(got - want)) < 1.1 * step


def test_hidden_effect_is_in_the_truth_alone():
    for log in ("hidden_1", "hidden_2", "unknown_1", "unknown_2"):
        name = "water_film" if log.startswith("hidden") else "ring_down"
        assert f'"name": "{name}"' in (FOLDER / f"{log}.csv.gz.truth.json").read_text("utf-8")
        assert name not in (FOLDER / f"{log}.toml").read_text("utf-8")
