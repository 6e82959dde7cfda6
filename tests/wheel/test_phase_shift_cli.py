"""Property: `tirelog phase-shift` on a file: rows, calibration there and back, statuses and the
pictures that it draws.
"""

import csv
import io
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.wheel.phase_truth import DYNAMIC, RAMP, Drive, Encoder, Tread, write_hdf5
from tirelog.cli import run

pytestmark = pytest.mark.xdist_group("phase shifts")  # one worker makes what these tests share

#: passages of the dynamic drive: its way over the circumference, from a patch at 1 rad
TURNS = int((80 + 80 + 176 + 40 + 65) / (2 * np.pi * 0.305) - 1 / (2 * np.pi)) + 1

SETUP = """[tire]
rolling_radius_m = 0.305
[conditions]
driven = {driven}
[channels.encoder]
kind = "wheel_encoder"
source = "/wheel/encoder"
unit = "V"
steps = 48
"""
ACCELEROMETER = """[channels.{name}]
kind = "radial_acceleration"
source = "/wheel/{name}"
unit = "g"
"""


def write(folder, name, corners, *treads, driven="true"):
    """A log of an encoder and an accelerometer per tread, with its setup."""
    drive = Drive(*corners)
    signals = {f"a{k}": tread.signal(drive) / 9.80665 for k, tread in enumerate(treads)}
    encoder = Encoder(seed=treads[0].seed).signal(drive)
    channels = {f"wheel/{key}": (values, "g", 10_000.0) for key, values in signals.items()}
    write_hdf5(folder / f"{name}.h5", {"wheel/encoder": (encoder, "V", 10_000.0), **channels})
    setup = SETUP.format(driven=driven) + "".join(ACCELEROMETER.format(name=key) for key in signals)
    (folder / f"{name}.toml").write_text(setup)
    return folder / f"{name}.h5"


def command(capfd, *arguments):
    """(status, standard output, standard error) of `tirelog phase-shift`."""
    capfd.readouterr()
    try:
        status = run(["phase-shift", *map(str, arguments)])
    except SystemExit as end:
        status = end.code
    out, err = capfd.readouterr()
    return int(status or 0), out, err


def rows(text):
    return list(csv.DictReader(io.StringIO(text)))


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("phase")
    trend = {
        "shift": lambda v, a: 0.1 * a + 0.02 * (v - 10),
        "width": lambda v, a: 25 + 0.1 * a - 0.04 * (v - 10),
    }
    undriven = {
        "shift": lambda v, a: 0.02 * (v - 10) + 0.03 * a,
        "width": lambda v, a: 25 - 0.2 * a - 0.04 * (v - 10),
    }
    return (
        write(folder, "ramp", RAMP, Tread(seed=40_000, **trend)),
        write(folder, "dynamic", DYNAMIC, Tread(seed=41_000, **trend)),
        write(folder, "front", DYNAMIC, Tread(seed=42_000, **undriven), driven="false"),
    )


def test_a_log_gives_its_table(logs, capfd):
    status, out, err = command(capfd, logs[1])
    table = rows(out)
    assert status == 0
    assert len(table) == TURNS
    assert list(table[0])[:5] == ["log", "channel", "revolution", "time_s", "speed_m_s"]
    assert list(table[0])[-1] == "quality"
    assert np.mean([row["quality"] == "ok" for row in table]) > 0.98
    assert {row["phase_shift_corrected_deg"] for row in table} == {""}
    assert "no calibration" in err
    assert "no calibration" not in command(capfd, logs[1], "--quiet")[2]


def test_a_calibration_is_written_and_applied(logs, tmp_path, capfd):
    status, out, err = command(capfd, logs[0], logs[2], "--calibrate", tmp_path / "c.toml")
    assert status == 0
    assert "cross-talk" in err
    status, again, _ = command(capfd, logs[0], logs[2], "--calibration", tmp_path / "c.toml")
    assert status == 0
    assert rows(out) == rows(again)
    table = rows(command(capfd, logs[1], "--calibration", tmp_path / "c.toml")[1])
    high = [
        float(row["phase_shift_corrected_deg"]) for row in table if 14 < float(row["time_s"]) < 20
    ]
    assert abs(np.mean(high)) < 0.02


def test_a_picture_is_written(logs, tmp_path, capfd):
    assert command(capfd, logs[1], "--plot", tmp_path / "p.png", "-o", tmp_path / "t.csv")[0] == 0
    assert (tmp_path / "p.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--calibration", "a", "--calibrate", "b"), "give one of them"),
        (("--fit-forces",), "--calibrate"),
        (("--zero", "slow"), "--zero"),
        (("--calibration", "none.toml"), "cannot be read"),
    ],
)
def test_what_cannot_be_carried_out_is_status_2(logs, options, told, capfd):
    status, _, err = command(capfd, logs[1], *options)
    assert status == 2
    assert told in err
    assert "Traceback" not in err


def test_a_log_without_teeth_is_lost_and_the_rest_goes_on(logs, tmp_path, capfd):
    dead = write(tmp_path, "dead", ((0, 20), (10, 10)), Tread())
    with h5py.File(dead, "r+") as file:
        file["wheel/encoder"][:] = 0.3
    status, out, err = command(capfd, dead, logs[1])
    assert status == 3
    assert len(rows(out)) == TURNS
    assert "no teeth" in err


def test_swapped_channels_are_named_with_the_file(logs, tmp_path, capfd):
    setup = logs[1].with_suffix(".toml").read_text()
    for old, new in (
        ("/wheel/encoder", "/x"),
        ("/wheel/a0", "/wheel/encoder"),
        ("/x", "/wheel/a0"),
    ):
        setup = setup.replace(old, new)
    (tmp_path / "swapped.toml").write_text(setup)
    status, out, err = command(capfd, logs[1], "--setup", tmp_path / "swapped.toml")
    assert (status, len(rows(out))) == (2, 0)
    assert "swapped" in err
    assert f"tirelog: error: {logs[1]}" in err


def test_a_log_driven_fast_only_takes_the_calibrations_zero(logs, tmp_path, capfd):
    assert command(capfd, logs[0], "--calibrate", tmp_path / "c.toml")[0] == 0
    fast = write(
        tmp_path, "fast", ((0, 20), (20, 20)), Tread(seed=8600, shift=lambda v, a: 0.02 * (v - 10))
    )
    status, out, err = command(capfd, fast)
    assert (status, {row["quality"] for row in rows(out)}) == (0, {"no_zero"})
    assert {row["phase_shift_deg"] for row in rows(out)} == {""}
    assert all(float(row["patch_width_deg"]) > 0 for row in rows(out))
    assert "--calibration" in err
    status, out, err = command(capfd, fast, "--calibration", tmp_path / "c.toml")
    assert (status, {row["quality"] for row in rows(out)}) == (0, {"delay_removed"})
    assert "zero of the phase shift: the calibration's" in err
    shifts = [float(row["phase_shift_deg"]) for row in rows(out)]
    assert abs(np.mean(shifts) - 0.2) < 0.02


def test_two_accelerometers_give_two_values_per_turn_in_the_order_of_time(tmp_path, capfd):
    """One of a true shift of 0.1 degree per m/s^2, at opposite places of the tire."""
    treads = [
        Tread(seed=43_000 + i, place_rad=1.0 + i * np.pi, shift=lambda v, a: 0.1 * a)
        for i in range(2)
    ]
    two = write(tmp_path, "two", ((0, 8, 13, 18), (10, 10, 22, 22)), *treads)
    status, out, _ = command(capfd, two, "--by-time")
    assert status == 0
    table, apart = rows(out), rows(command(capfd, two)[1])
    time = np.array([float(row["time_s"]) for row in table])
    assert (np.diff(time) > 0.0).all()
    assert sorted(map(str, table)) == sorted(map(str, apart))
    assert (np.diff([int(row["channel"][1]) for row in table]) != 0).mean() > 0.98
    shift, entry = (
        np.array([float(row[name] or "nan") for row in table])
        for name in ("phase_shift_deg", "entry_angle_deg")
    )
    assert abs(np.nanmedian(np.mod(np.diff(entry), 360)) - 180) < 1
    for name in ("a0", "a1"):
        mine = np.array([row["channel"] == name for row in table])
        pulled = np.nanmean(shift[mine & (time > 9.0) & (time < 12.0)])
        assert abs(pulled - 0.24) < 0.03


SAMPLE = Path(__file__).parents[2] / "sample_data" / "encoder_low"


def sample(folder, samples):
    """The sample log of an encoder with each channel made anew by `samples` of its values."""
    shutil.copy(SAMPLE.with_suffix(".toml"), folder / "log.toml")
    shutil.copy(SAMPLE.with_suffix(".h5"), folder / "log.h5")
    with h5py.File(folder / "log.h5", "r+") as file:
        for name in ("wheel/acceleration", "wheel/encoder", "vehicle/speed"):
            values, attributes = file[name][:], dict(file[name].attrs)
            del file[name]
            file.create_dataset(name, data=samples(values)).attrs.update(attributes)
        del file["vehicle/acceleration"]
    setup = (folder / "log.toml").read_text().split("[channels.vehicle_acceleration]")[0]
    (folder / "log.toml").write_text(setup)
    return folder / "log.h5"


def test_a_wheel_that_turns_round_has_rows_in_one_direction_alone(tmp_path, capfd):
    """An encoder does not tell the direction: the patch has a second place, whose rows are lost."""

    def there_and_back(values):
        there = values[: 9 * values.size // 20]
        return np.concatenate([there, there[::-1]])

    back = sample(tmp_path, there_and_back)
    status, out, err = command(capfd, back)
    assert status == 0, err
    quality = [row["quality"] for row in rows(out)]
    turned = len(quality) // 2
    assert set(quality[: turned - 2]) == {"ok"}
    assert set(quality[turned + 2 :]) == {"lost_peak"}


def test_a_log_of_less_than_two_turns_has_a_footprint_without_lengths(tmp_path, capfd):
    short = sample(tmp_path, lambda x: x[: x.size // 65])
    assert run(["footprint", str(short)]) == 0
    assert {row["length_m"] for row in rows(capfd.readouterr().out)} == {""}


@pytest.mark.parametrize(
    ("corners", "told"),
    [
        (((0, 12, 12.5, 25), (10, 10, 22, 22)), "0 of them in the middle third"),
        (((0, 30), (10, 11)), "slow drive-up or coast-down"),
    ],
)
def test_speeds_that_give_no_map_are_refused(corners, told, tmp_path, capfd):
    tread = Tread(seed=43_000, shift=lambda v, a: 0.02 * v, width=lambda v, a: 25 - 0.04 * v)
    log = write(tmp_path, "two", corners, tread)
    status, _, err = command(capfd, log, "--calibrate", tmp_path / "maps.toml")
    assert status == 2
    assert told in err
    assert not (tmp_path / "maps.toml").exists()
