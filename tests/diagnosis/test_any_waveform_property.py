"""Property: whatever repeats with the wheel gets an answer from every command of a model."""

import secrets

import pytest

import tirelog
from tests.diagnosis.periodic import COMMANDS, failures, write_log


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
