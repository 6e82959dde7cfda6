"""Property: `tirelog phase-shift`: rows, calibration there and back, statuses, pictures."""

import io
import shutil
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest

import tirelog
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


@pytest.fixture
def command(capfd):
    """(status, table, standard error) of `tirelog phase-shift`, or of another command."""

    def call(*arguments, name="phase-shift"):
        capfd.readouterr()
        status = run([name, *map(str, arguments)])
        out, err = capfd.readouterr()
        return status, pd.read_csv(io.StringIO(out)) if out else pd.DataFrame(), err

    return call


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """A slow ramp and a dynamic drive of a driven wheel, and a dynamic drive of one that is not."""
    folder = tmp_path_factory.mktemp("phase")
    driven = {
        "shift": lambda v, a: 0.1 * a + 0.02 * (v - 10),
        "width": lambda v, a: 25 + 0.1 * a - 0.04 * (v - 10),
    }
    front = {
        "shift": lambda v, a: 0.02 * (v - 10) + 0.03 * a,
        "width": lambda v, a: 25 - 0.2 * a - 0.04 * (v - 10),
    }
    return (
        write(folder, "ramp", RAMP, Tread(seed=40_000, **driven)),
        write(folder, "dynamic", DYNAMIC, Tread(seed=41_000, **driven)),
        write(folder, "front", DYNAMIC, Tread(seed=42_000, **front), driven="false"),
    )


def test_a_log_gives_its_table_and_a_picture(logs, tmp_path, command):
    status, table, err = command(logs[1], "--plot", tmp_path / "p.png")
    assert status == 0
    assert len(table) == TURNS
    assert list(table)[:5] == ["log", "channel", "revolution", "time_s", "speed_m_s"]
    assert list(table)[-1] == "quality"
    assert (table["quality"] == "ok").mean() > 0.98
    assert table["phase_shift_corrected_deg"].isna().all()
    assert (tmp_path / "p.png").read_bytes()[:4] == b"\x89PNG"
    assert "no calibration" in err
    assert "no calibration" not in command(logs[1], "--quiet")[2]


def test_a_calibration_is_written_and_applied(logs, tmp_path, command):
    """To the logs that it is of, to others, and as the zero of one that is driven fast only."""
    file = tmp_path / "c.toml"
    status, table, err = command(logs[0], logs[2], "--calibrate", file)
    assert status == 0
    assert "cross-talk" in err
    assert command(logs[0], logs[2], "--calibration", file)[1].equals(table)
    table = command(logs[1], "--calibration", file)[1]
    high = table["phase_shift_corrected_deg"][table["time_s"].between(14, 20)]
    assert abs(high.mean()) < 0.02
    lag = Tread(seed=8600, shift=lambda v, a: 0.02 * (v - 10))
    fast = write(tmp_path, "fast", ((0, 20), (20, 20)), lag)
    status, table, err = command(fast)
    assert (status, set(table["quality"][1:-1])) == (0, {"no_zero"})
    assert table["phase_shift_deg"].isna().all()
    assert (table["patch_width_deg"] > 0).all()
    assert "--calibration" in err
    status, table, err = command(fast, "--calibration", file)
    assert (status, set(table["quality"][1:-1])) == (0, {"delay_removed"})
    assert "zero of the phase shift: the calibration's" in err
    assert abs(table["phase_shift_deg"].mean() - 0.2) < 0.02


def test_a_log_without_teeth_is_lost_and_the_rest_goes_on(logs, tmp_path, command):
    dead = write(tmp_path, "dead", ((0, 20), (10, 10)), Tread())
    with h5py.File(dead, "r+") as file:
        file["wheel/encoder"][:] = 0.3
    status, table, err = command(dead, logs[1])
    assert (status, len(table)) == (3, TURNS)
    assert "no teeth" in err


def test_swapped_channels_are_named_with_the_file(logs, tmp_path, command):
    accelerometer = ACCELEROMETER.format(name="a0").replace("wheel/a0", "wheel/encoder")
    setup = SETUP.replace("wheel/encoder", "wheel/a0") + accelerometer
    (tmp_path / "swapped.toml").write_text(setup.format(driven="true"))
    status, table, err = command(logs[1], "--setup", tmp_path / "swapped.toml")
    assert (status, len(table)) == (2, 0)
    assert "swapped" in err
    assert f"tirelog: error: {logs[1]}" in err


def test_two_accelerometers_give_two_values_per_turn(tmp_path, command):
    """One of a true shift of 0.1 degree per m/s^2, at opposite places of the tire."""
    treads = [
        Tread(seed=43_000 + i, place_rad=1.0 + i * np.pi, shift=lambda v, a: 0.1 * a)
        for i in range(2)
    ]
    two = write(tmp_path, "two", ((0, 8, 13, 18), (10, 10, 22, 22)), *treads)
    status, table, _ = command(two)
    assert status == 0
    table = table.sort_values("time_s", ignore_index=True)
    assert (table["channel"] != table["channel"].shift()).mean() > 0.98
    assert abs(np.nanmedian(np.mod(np.diff(table["entry_angle_deg"]), 360)) - 180) < 1
    pulled = table[table["time_s"].between(9, 12)].groupby("channel")["phase_shift_deg"].mean()
    assert pulled.to_dict() == pytest.approx({"a0": 0.24, "a1": 0.24}, abs=0.03)


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


def test_a_wheel_that_turns_round_has_rows_in_one_direction_alone(tmp_path, command):
    """An encoder does not tell the direction: the patch has a second place, whose rows are lost."""

    def there_and_back(values):
        there = values[: 9 * values.size // 20]
        return np.concatenate([there, there[::-1]])

    status, table, err = command(sample(tmp_path, there_and_back))
    assert status == 0, err
    turned = len(table) // 2
    assert set(table["quality"][: turned - 2]) == {"ok"}
    assert set(table["quality"][turned + 2 :]) == {"lost_peak"}


def test_a_log_of_less_than_two_turns_has_a_footprint_without_lengths(tmp_path, command):
    short = sample(tmp_path, lambda x: x[: x.size // 65])
    status, table, _ = command(short, name="footprint")
    assert status == 0
    assert table["length_m"].isna().all()


@pytest.mark.parametrize(
    ("corners", "told"),
    [
        (((0, 12, 12.5, 25), (10, 10, 22, 22)), "0 of them in the middle third"),
        (((0, 30), (10, 11)), "slow drive-up or coast-down"),
    ],
)
def test_speeds_that_give_no_map_are_refused(corners, told, tmp_path, command):
    tread = Tread(seed=43_000, shift=lambda v, a: 0.02 * v, width=lambda v, a: 25 - 0.04 * v)
    log = write(tmp_path, "two", corners, tread)
    status, _, err = command(log, "--calibrate", tmp_path / "maps.toml")
    assert status == 2
    assert told in err
    assert not (tmp_path / "maps.toml").exists()


@pytest.fixture(scope="module")
def encoder_rows():
    return tirelog.phase_shift(SAMPLE.with_name("encoder.h5"))


@pytest.mark.parametrize("degrees", [25.0, 65.0, 100.0, 140.0])
def test_the_last_passage_of_a_log_that_ends_beside_it(encoder_rows, tmp_path, degrees):
    """Its level is from both sides of the patch: with one of them short, widths came out 1 degree
    off.
    """
    known, turn_s = encoder_rows.iloc[-2], np.diff(encoder_rows.time_s)[-1]
    end_s = known.time_s + degrees / 360.0 * turn_s
    whole = SAMPLE.with_name("encoder.h5")
    with h5py.File(whole) as log, h5py.File(tmp_path / "log.h5", "w") as cut:

        def copy(name, item):
            if isinstance(item, h5py.Dataset):
                rate_Hz = item.attrs.get("sampling_rate_Hz")
                data = item[: int(end_s * rate_Hz)] if rate_Hz is not None else item[()]
                cut.create_dataset(name, data=data).attrs.update(item.attrs)

        log.visititems(copy)
    shutil.copy(SAMPLE.with_name("encoder.toml"), tmp_path / "log.toml")
    last = tirelog.phase_shift(tmp_path / "log.h5").iloc[-1]
    assert last.time_s == pytest.approx(known.time_s, abs=1e-3)
    assert last.quality == ("ok" if degrees == 140.0 else "edge_of_log")
    if last.quality == "ok":
        assert last.patch_width_deg == pytest.approx(
            known.patch_width_deg, abs=known.patch_width_se_deg
        )
