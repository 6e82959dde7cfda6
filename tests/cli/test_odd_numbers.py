"""Faults: numbers that no instrument writes end in a message, whatever they are multiplied by."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.cli.conftest import Command

ENCODER = """[tire]
name = "t"
rolling_radius_m = 0.305
[channels.encoder]
kind = "wheel_encoder"
source = "/encoder"
unit = "V"
steps = 48
"""


def test_hundreds_of_decimals_are_no_counts(folder: Path, tirelog: Command) -> None:
    rows = (folder / "log.csv").read_text().splitlines()
    rows[20] = rows[20].replace("1542.0000", "1542." + "0" * 400)
    (folder / "log.csv").write_text("\n".join(rows) + "\n")
    outcome = tirelog("speed", "log.csv")
    assert outcome.status == 0, outcome.err
    assert len(outcome.out.splitlines()) > 10


def test_an_encoder_of_numbers_too_large_to_square_shows_no_teeth(folder, tirelog):
    teeth = np.sin(2 * np.pi * 300 * np.arange(20_000) / 5000.0)
    with h5py.File(folder / "encoder.h5", "w") as file:
        file.create_dataset("encoder", data=1.7e308 * teeth).attrs["sampling_rate_Hz"] = 5000.0
    (folder / "encoder.toml").write_text(ENCODER)
    outcome = tirelog("speed", "encoder.h5")
    assert outcome.status in (3, 4), outcome.err
    assert "encoder" in outcome.err


def test_a_log_that_spans_centuries_is_no_inflation_test(folder: Path, tirelog: Command) -> None:
    seconds = np.concatenate([np.arange(2000) / 100.0, 9e9 + np.arange(2000) / 100.0])
    rows = [f"{at:.2f},{1550 + 1e-5 * number:.5f},1542.0000" for number, at in enumerate(seconds)]
    (folder / "log.csv").write_text("time_s,CH1,CH2\n" + "\n".join(rows) + "\n")
    outcome = tirelog("inflation", "log.csv")
    assert outcome.status == 2, outcome.err
    assert "days; an inflation test of up to 7 days is allowed" in outcome.err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("model predict beam.toml --speed 20kmh", "20 km/h is 5.556 m/s"),
        ("model predict beam.toml --speed 20m/s", "leave the unit out: 20"),
        ("model predict beam.toml --speed 22,5", "the decimal sign is a point: 22.5"),
        ("model forces beam.toml --speed 5 --slip 0,05", "the decimal sign is a point: 0.05"),
        ("model predict beam.toml --speed 80", "--speed 80 is 288 km/h; 80 km/h is 22.22"),
        ("model forces beam.toml --speed 80", "--speed 80 is 288 km/h; 80 km/h is 22.22"),
        ("model modes beam.toml --load 350kgf", "350 kgf is 3432 N"),
        ("model new -o new.toml --set radius_m=0,305", "the decimal sign is a point: 0.305"),
        ("check log.csv --against log.csv --tolerance time_s=5ms", "5 ms is 0.005 s"),
        ("footprint log.csv --friction-ratio 0,75", "the decimal sign is a point: 0.75"),
    ],
)
def test_a_number_with_a_unit_is_read_back_in_si(model, tirelog, words, says):
    done = tirelog(words)
    assert done.status == 2
    assert says in done.err


def test_two_numbers_that_may_be_one_are_named(model, tirelog):
    done = tirelog("model forces beam.toml --speed 2,5")
    assert done.status == 0
    assert "2,5 is two values; the decimal sign is a point: 2.5" in done.err
    assert len(done.out.splitlines()) == 3


def test_a_check_of_a_setup_tells_the_share_of_a_pulse(folder, tirelog):
    pulses = 5.0 * (20.0 * np.arange(60_000) / 1e4 % 1.0 < 0.06)
    with h5py.File(folder / "encoder.h5", "w") as file:
        file.create_dataset("encoder", data=pulses).attrs["sampling_rate_Hz"] = 1e4
    (folder / "encoder.toml").write_text(ENCODER.replace("48", "1"))
    done = tirelog("setup check encoder.h5")
    assert "noted: channel encoder: pulses of 6% of a step" in done.out
