"""Property: planted effects are named, from the scenario to the verdict; a small part of the
self-test.
"""

import json
import tomllib
from pathlib import Path

import pytest

from benchmarks.cases import Case, case
from benchmarks.nuisance_worlds import PER_K
from tests.diagnosis.planted import simulated
from tests.diagnosis.toy import done
from tirelog.diagnosis.diagnose import diagnose
from tirelog.physics.model.model import Model
from tirelog.simulation import scenario_of

SAMPLES = Path(__file__).parents[2] / "sample_data"


def stacks(effects, seed, **how):
    return simulated(case(effects, seed=seed, how=Case(**{"plan": "short", "logs": 2, **how})))


@pytest.fixture(scope="module")
def model():
    return Model.new("beam", radius_m=0.305)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "drift", "warming", "verdict", "selected"),
    [
        (3, 5e-6, {}, "missing", ("thermal_drift",)),
        (5, 0.0, {}, "nothing_missing", ()),
        (13, 5e-6, PER_K, "missing", ("thermal_drift",)),
        (14, 0.0, PER_K, "nothing_missing", ()),
    ],
)
def test_a_baseline_that_follows_a_measured_temperature_is_named(
    model, seed, drift, warming, verdict, selected
):
    """One number along the temperature comes before a drift, which has many along the log."""
    tables = tomllib.loads((SAMPLES / "scenarios" / "thermal_drift.toml").read_text())
    tables["effects"][0]["drift"] = drift
    tables["nuisances"] = {"warming": warming} if warming else {}
    result = diagnose(simulated([scenario_of({**tables, "seed": seed})]), model)
    assert (result.verdict, result.selected) == (verdict, selected)
    if drift:
        found = result.effects[0].strengths["drift"]
        assert found["value"] == pytest.approx(drift, abs=4.0 * found["se"])


@pytest.mark.slow
def test_load_transfer_is_what_these_logs_lack(tmp_path):
    model, answer = tmp_path / "ring.toml", tmp_path / "answer.json"
    kind = ("--carcass", "ring", "--observable", "radial_acceleration")
    done("model", "new", *kind, "--setup", SAMPLES / "encoder.toml", "-o", model)
    logs = [SAMPLES / name for name in ("encoder.h5", "encoder_low.h5")]
    done("diagnose", *logs, "--model", model, "--format", "json", "-o", answer)
    said = json.loads(answer.read_text())
    truth = json.loads((SAMPLES / "encoder.h5.truth.json").read_text())
    (planted,) = (e["parameters"] for e in truth["effects"] if e["name"] == "load_transfer")
    assert (said["verdict"], said["selected"]) == ("missing", ["load_transfer"])
    found = said["effects"][0]["strengths"]["coefficient"]
    # each log brakes once: the rough road under that brake is in the value and not in its error
    true = planted["coefficient"]
    assert max(abs(found["value"] - true), 2.0 * found["se"]) < 0.1 * true
