"""Property: every command gives the same number by one door, and says what was set apart."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.diagnosis.toy import stack
from tirelog.campaign import models, runner
from tirelog.campaign.ledger import pieces_bytes
from tirelog.campaign.runner import make_tables, pieces_name
from tirelog.cli import run
from tirelog.diagnosis.compare import compare
from tirelog.diagnosis.fitted import fit_of_logs
from tirelog.diagnosis.ladder import ladder
from tirelog.inference.cells import pieces
from tirelog.inference.cells.pieces import pieces_of_all, pieces_of_logs
from tirelog.inference.measured import measured
from tirelog.inference.stacks.cut import Stacks
from tirelog.physics.model.file import save_model
from tirelog.physics.model.model import Model
from tirelog.report.build import model_story
from tirelog.report.page import ReportRequest
from tirelog.runs.ingest import open_recording

pytestmark = pytest.mark.xdist_group("measured")  # one worker makes what these tests share

SAMPLES = Path(__file__).parents[2] / "sample_data"
HIT = (
    "2 hits on an obstacle; 10 of 17 revolutions are disturbed by them and kept apart from the "
    "steady ones"
)
MANIFEST = """[campaign]
output = "results"
[[logs]]
glob = "logs/*.csv.gz"
[tables.speed]
[[models]]
file = "beam.toml"
commands = ["compare"]
"""


@pytest.fixture(scope="module")
def cleat():
    with open_recording(str(SAMPLES / "cleat.csv.gz"), None) as recording:
        yield recording


@pytest.fixture(scope="module")
def beam(cleat):
    held = Model.new("beam", radius_m=cleat.setup.tire.radius_m, load_N=3434.0)
    few = ("patch_half_length_m", "lever_arm_m")
    return held.with_parameters(
        {name: p if name in few else p.fixed() for name, p in held.parameters.items()}
    )


@pytest.fixture(scope="module")
def compared(cleat, beam):
    return compare(measured([cleat]).stacks, beam)


def test_every_command_gives_one_number_on_a_log_with_an_obstacle(
    cleat, beam, compared, tmp_path, monkeypatch
):
    monkeypatch.setattr(
        runner, "_on_processes", lambda tasks, workers: (make_tables(task) for task in tasks)
    )
    stacks = measured([cleat]).stacks
    assert compared.revolutions == 7
    assert HIT in compared.remarks[0]
    climbed = ladder(stacks, beam)
    first = climbed.steps[0]
    assert (first.rmse_fit, first.noise_floor) == (compared.rmse, compared.noise_floor)
    assert climbed.revolutions == 7
    asked = ReportRequest((cleat.log,))
    (_, *sections), missing = model_story([cleat], beam, None, asked, lambda text: None)
    told = {s.id: " ".join(s.text) for s in sections}
    assert list(told) == ["diagnosis", "model"]
    assert any("2 hits on an obstacle" in what for what, _ in missing)
    assert "7 revolutions" in told["diagnosis"]
    page = told["model"]
    assert f"On the data of the fit: {compared.rmse * 1e6:.3g}." in page
    assert "7 revolutions" in page
    assert HIT in page
    save_model(beam, tmp_path / "beam.toml")
    (tmp_path / "logs").mkdir()
    for name in ("cleat.csv.gz", "cleat.toml"):
        shutil.copy(SAMPLES / name, tmp_path / "logs")
    (tmp_path / "campaign.toml").write_text(MANIFEST)
    assert run(["campaign", "run", str(tmp_path / "campaign.toml"), "--quiet"]) == 0
    kept = json.loads((tmp_path / "results/models/beam/compare.json").read_text())
    for name in ("rmse", "noise_floor", "revolutions", "reduced_chi2"):
        assert kept[name] == pytest.approx(getattr(compared, name), rel=1e-9), name
    assert HIT in kept["remarks"][0]


def test_obstacles_are_set_apart_from_numbers_per_revolution_too(cleat):
    found = measured([cleat], "dissipation_factor")
    assert found.obstacles == ()
    assert "2 hits on an obstacle" in found.notes[0]
    hits = measured([cleat]).obstacles[0].hits_s
    (steady,) = found.stacks
    assert all(np.abs(steady.conditions.time_s - hit).min() > 0.1 for hit in hits)


def test_fit_and_compare_are_one_fit(cleat, beam, compared):
    result, remarks = fit_of_logs(measured([cleat]).stacks, beam)
    for name, value, error in zip(result.names, result.values, result.se, strict=True):
        assert value == pytest.approx(compared.parameters[name]["value"], rel=1e-12)
        assert error == pytest.approx(compared.parameters[name]["se"], rel=1e-12)
    assert result.reduced_chi2 == compared.reduced_chi2
    assert remarks == compared.remarks


def test_one_manoeuvre_has_no_error_held_out_and_one_floor_within(cleat, beam, compared):
    assert compared.manoeuvres == 1
    assert compared.rmse_heldout is compared.excess_heldout is None
    assert json.loads(json.dumps(compared.to_json()))["rmse_heldout"] is None
    assert any("none can be held out" in remark for remark in compared.remarks)


def several(sizes):
    """Toy logs of so many manoeuvres each, every manoeuvre one piece."""
    stacks = Stacks()
    for seed, manoeuvres in enumerate(sizes):
        made, log = stack(seed, manoeuvres=manoeuvres, revolutions=6, m=32), f"log_{seed}"
        driven = replace(made.conditions, speed_m_s=9.0 + made.manoeuvre % 3 + 0.1 * seed)
        stacks.add(log, [replace(made, conditions=driven, logs=(log,))])
    return stacks


@pytest.mark.parametrize("most", [200, 12, 3])
def test_a_campaign_s_pieces_are_those_of_its_logs_together(most, monkeypatch):
    monkeypatch.setattr(pieces, "room", lambda angles, most_of_all=0: most)
    stacks = several((3, 20, 9))
    whole = pieces_of_logs(stacks)
    files = {}
    for number, log in enumerate(stacks.logs):
        own, parts = Stacks(), [stack for stack in stacks if stack.log[0] == number]
        own.add(log, [replace(p, manoeuvre=p.manoeuvre - p.manoeuvre.min()) for p in parts])
        files[pieces_name("strain", log)] = pieces_bytes(pieces_of_all(own, most))
    tasks = [SimpleNamespace(name=log) for log in stacks.logs]
    ledger = SimpleNamespace(folder=SimpleNamespace(read=files.get, root="results"))
    joined, about = models._pieces(tasks, "strain", ledger)
    assert len(joined) == len(whole) <= max(most, 3 * 2)
    for name in ("values", "phi", "count", "number", "coefficients", "regime"):
        np.testing.assert_array_equal(getattr(joined, name), getattr(whole, name), name)
    names = np.array(stacks.logs)
    np.testing.assert_array_equal(np.array(joined.logs)[joined.log], names[whole.log])
    assert (np.diff(joined.manoeuvre) == 0).tolist() == (np.diff(whole.manoeuvre) == 0).tolist()
    assert about["cells_used"] == len(whole)
    if most < 32:  # what was left out is said
        assert any("are used" in note for note in whole.notes)
    assert set(whole.notes) == set(joined.notes)


def test_a_log_that_gives_no_piece_has_revolutions_without_one():
    pieces = pieces_of_logs(several((4, 4, 4)), 2)
    assert set(pieces.log) < {0, 1, 2}
    assert (pieces.cell == -1).any()


def test_a_channel_of_another_kind_is_refused(cleat):
    said = "strain_1 is of another kind than radial_acceleration .*; the log has strain_1"
    with pytest.raises(Exception, match=said):
        measured([cleat], "radial_acceleration", "strain_1")
