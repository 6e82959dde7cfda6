"""Property: each log has its own zero; whatever repeats with the wheel gets an answer."""

import secrets
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import pytest

import tirelog
from tests.diagnosis.periodic import COMMANDS, failures, write_log
from tests.diagnosis.toy import phase_shifts
from tirelog.data.recording import Conditions
from tirelog.diagnosis.candidates.assessment import refuse_stand_in
from tirelog.diagnosis.diagnose import diagnose
from tirelog.diagnosis.ladder import ladder
from tirelog.errors import ModelError
from tirelog.inference.stacks.cut import Stacks
from tirelog.physics import Model
from tirelog.physics.effects import BY_ID

MODEL = Model.new("ring", "phase_shift", radius_m=0.305)


def two_logs(seed: int, apart_rad: float, late_s: float = 0.0, pressures=(2.0e5, 1.6e5)):
    """Logs at these pressures whose zeros are `apart_rad`."""
    stacks = Stacks()
    for number, (log, pressure) in enumerate(zip("ab", pressures, strict=False)):

        def shifts(driven, zero_rad=number * apart_rad):
            return zero_rad + late_s * driven.speed_m_s / 0.305

        drive = {"inflation_pressure_Pa": pressure, "longitudinal_force_N": (-400.0, 600.0)}
        made = phase_shifts(seed + number, 10, 20, shifts, 2.5e-4, log, load_N=3400.0, **drive)
        stacks.add(log, [made])
    return stacks


def asked(*given, **more):
    """The diagnosis of such logs."""
    return diagnose(two_logs(*given, **more), MODEL)


@pytest.mark.parametrize(("seed", "apart_rad"), [(1, 3e-4), (11, 3e-4), (21, 3e-4), (31, 2e-3)])
def test_zeros_that_differ_are_no_effect(seed, apart_rad):
    found = asked(seed, apart_rad)
    assert found.verdict == "nothing_missing"
    assert found.reduced_chi2_before < 1.5
    assert "a zero of its own" in found.not_tested["inflation"]


def test_one_log_does_not_differ_from_itself():
    found = asked(7, 0.0, pressures=(1.6e5,))
    assert found.verdict == "nothing_missing"
    assert (
        found.not_tested["inflation"]
        == "cannot be separated from the model's own parameters in these logs"
    )


def test_what_moves_along_a_log_is_told_beside_them():
    found = asked(5, 3e-4, late_s=2e-5)
    assert (found.verdict, found.selected) == ("missing", ("telemetry_delay",))
    strength = found.effects[0].strengths["delay_s"]
    assert abs(strength["value"] - 2e-5) < 3.0 * strength["se"] < 1e-5
    assert found.not_tested["speed_trend"] == "replaces longitudinal_force_N, which is measured"


@pytest.mark.parametrize(
    ("observables", "refused"), [(("phase_shift",), True), (("phase_shift", "patch_width"), False)]
)
def test_a_stand_in_is_tried_where_it_stands_for_nothing(observables, refused):
    """A trend with the speed also widens the patch, which no measured force tells."""
    drive = Conditions.of(1, speed_m_s=20.0, longitudinal_force_N=100.0)
    blocks = [SimpleNamespace(observable=name, conditions=drive) for name in observables]
    model = Model.new("ring", observables[0], radius_m=0.305)
    model = replace(model, beside=observables[1:])
    said = pytest.raises(ModelError, match="replaces") if refused else nullcontext()
    with said:
        refuse_stand_in(BY_ID["speed_trend"], model, blocks)


def test_a_ladder_climbs_beside_them():
    """They are in every fit, and are no nuisance that a model could name."""
    climbed = ladder(two_logs(5, 3e-4, late_s=2e-5), MODEL)
    added = [step.effect for step in climbed.steps if step.outcome == "added"]
    assert added == ["telemetry_delay"]


def answered(folder, seed, commands, **how):
    log = folder / "log.csv"
    shape = write_log(log, seed, **how)
    # a sum of waves may have several pulses a turn, as no patch has: every command refuses it
    while tirelog.speed(log)["quality"].str.contains("not_a_passage").all():
        seed += 4
        shape = write_log(log, seed, **how)
    carcass = "ring" if seed % 4 == 3 else "beam"
    found = failures(folder, carcass, commands=commands)
    assert found == [], f"write_log(path, {seed}), which is a {shape}, with a {carcass}"


@pytest.mark.slow
def test_a_model_that_nothing_holds_without_its_effect_has_a_verdict(tmp_path):
    """A soft carcass under belt_tension is beyond its critical speed without it."""
    write_log(tmp_path / "log.csv", 0, "box", manoeuvres=4, seconds=2.0)
    assert failures(tmp_path, "beam", commands=("diagnose",)) == []


def test_any_waveform_has_a_comparison_and_a_verdict(tmp_path):
    answered(tmp_path, secrets.randbelow(2**31), ("compare", "diagnose"), manoeuvres=3, seconds=1.5)


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 3])  # a beam, and a ring
def test_any_waveform_is_answered_by_every_command(tmp_path, number):
    answered(tmp_path, 4 * secrets.randbelow(2**29) + number, tuple(COMMANDS))
