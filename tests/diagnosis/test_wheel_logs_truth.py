"""Property: of the shipped logs of encoder and in-tire accelerometer, what their truth holds is
named, and gravity is not taken for an effect.
"""

import json
from pathlib import Path

import pytest

from tirelog.cli import run

SAMPLES = Path(__file__).parents[2] / "sample_data"


@pytest.mark.slow
def test_load_transfer_is_what_these_logs_lack(tmp_path):
    model, answer = tmp_path / "ring.toml", tmp_path / "answer.json"
    setup = SAMPLES / "encoder.toml"
    made = [
        "model",
        "new",
        "--carcass",
        "ring",
        "--observable",
        "radial_acceleration",
        "--setup",
        str(setup),
        "-o",
        str(model),
        "--quiet",
    ]
    assert run(made) == 0
    logs = [str(SAMPLES / name) for name in ("encoder.h5", "encoder_low.h5")]
    assert (
        run(
            [
                "diagnose",
                *logs,
                "--model",
                str(model),
                "--format",
                "json",
                "-o",
                str(answer),
                "--quiet",
            ]
        )
        == 0
    )
    said = json.loads(answer.read_text())
    truth = json.loads((SAMPLES / "encoder.h5.truth.json").read_text())
    planted = {effect["name"]: effect["parameters"] for effect in truth["effects"]}[
        "load_transfer"
    ]["coefficient"]
    assert (said["verdict"], said["selected"]) == ("missing", ["load_transfer"])
    found = said["effects"][0]["strengths"]["coefficient"]
    # each log brakes once: the rough road under that brake is in the value and not in its error
    assert max(abs(found["value"] - planted), 2.0 * found["se"]) < 0.1 * planted
