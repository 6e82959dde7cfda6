"""Faults: an encoder that is lost within a log. Its rows end, and every command says why."""

from pathlib import Path

import h5py
import numpy as np
import pytest

import tirelog
from tirelog.cli import run

RATE_HZ, LASTS_S = 5000.0, 30.0
TIME = np.arange(int(RATE_HZ * LASTS_S)) / RATE_HZ
TURNS = np.cumsum(np.interp(TIME, [0.0, 10.0, 20.0, 30.0], [8.0, 12.0, 9.0, 11.0])) / RATE_HZ
NOISE = 0.01 * np.random.default_rng(4).standard_normal(TIME.size)
#: form -> (steps, unit, signal)
FORMS = {
    "sine": (48, "V", np.sin(2.0 * np.pi * 48.0 * TURNS) + NOISE),
    "pulses": (1, "V", 5.0 * (TURNS % 1.0 < 0.06) + NOISE),
    "counter": (512, "1", np.floor(512.0 * TURNS) % 65536.0),
    "angle": (48, "rad", 2.0 * np.pi * TURNS % (2.0 * np.pi)),
}
ENDS = ("held", "zero", "lost", "noise", "short", "whole")


def signal(form: str, end: str, from_s: float) -> np.ndarray:
    """The encoder's samples, spoilt from a time on."""
    samples, at = FORMS[form][2].copy(), int(from_s * RATE_HZ)
    behind = {"held": samples[at], "zero": 0.0, "lost": np.nan, "noise": samples[at] + NOISE[at:]}
    if end == "short":
        return samples[:at]
    samples[at:] = behind.get(end, samples[at:])
    return samples


def write(folder: Path, form: str, end: str, from_s: float) -> Path:
    steps, unit, _ = FORMS[form]
    with h5py.File(folder / "log.h5", "w") as file:
        file["encoder"] = signal(form, end, from_s)
        file["encoder"].attrs["fs"] = RATE_HZ
        file["speed"] = np.full(TIME.size // 50, 20.0)
        file["speed"].attrs["fs"] = RATE_HZ / 50.0
    (folder / "log.toml").write_text(
        f'[tire]\nrolling_radius_m = 0.3\n[channels.e]\nkind = "wheel_encoder"\n'
        f'source = "/encoder"\nunit = "{unit}"\nsteps = {steps}\n'
        '[channels.v]\nkind = "vehicle_speed"\nsource = "/speed"\nunit = "m/s"\n'
    )
    return folder / "log.h5"


@pytest.mark.parametrize("from_s", [7.5, 15.2, 24.0])
@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("form", FORMS)
def test_an_encoder_that_is_lost_is_named(tmp_path, form, end, from_s):
    log = write(tmp_path, form, end, from_s)
    with tirelog.open_log(log, tmp_path / "log.toml") as recording:
        said = [remark for remark in recording.remarks if "no teeth from" in remark]
    assert len(said) == (end != "whole")
    for remark in said:
        assert float(remark.split("about ")[1].split()[0]) == pytest.approx(from_s, abs=1.0)
        assert "the log lasts 30 s" in remark


@pytest.mark.parametrize("command", ["ingest", "speed", "wheel-angle", "setup check"])
def test_every_command_says_where_the_teeth_end(tmp_path, monkeypatch, capsys, command):
    write(tmp_path, "sine", "noise", 15.2)
    monkeypatch.chdir(tmp_path)
    more = ["-o", "run.h5"] if command == "ingest" else []
    run([*command.split(), "log.h5", *more])
    said = "".join(capsys.readouterr())
    assert "e: no teeth from about 15 s on, and the log lasts 30 s" in said


def test_samples_behind_the_last_tooth_have_no_angle(tmp_path):
    log = write(tmp_path, "sine", "zero", 15.2)
    rows = tirelog.wheel_angle(log, setup=tmp_path / "log.toml", start=15.0, stop=15.5)
    behind = rows.time_s > 15.21
    assert set(rows.quality[behind]) == {"edge_of_log"}
    assert rows.turned_deg[behind].isna().all()
    assert set(rows.quality[rows.time_s < 15.19]) == {"ok"}
