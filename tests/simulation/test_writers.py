"""Property: a simulated log that is written and read back is the one in memory."""

import json
import tomllib

import numpy as np
import pytest

from tests.simulation.worlds import scenario
from tirelog.runs.ingest import open_recording
from tirelog.simulation import setup_text, simulate, to_recording, write_log

GRATINGS = {
    "outer": {
        "kind": "fbg_strain",
        "source": "CH1_FBG1",
        "noise": 0.0008,
        "quantisation": 1e-4,
        "lost_fraction": 0.004,
        "thermal_expansion_1_K": 2e-5,
        "temperature_channel": "twin",
        "baseline": 3e-4,
    },
    "inner": {
        "kind": "fbg_strain",
        "surface": "inner",
        "angle_deg": 200.0,
        "reference_wavelength_nm": 1555.0,
    },
    "twin": {"kind": "fbg_temperature", "reference_wavelength_nm": 1542.0, "noise": 0.0002},
}


def gratings():
    warm = {"warm_up_K": 15.0, "warm_up_time_s": 3.0}
    return simulate(scenario(channels=GRATINGS, conditions=warm, seed=7))


def wheel():
    channels = {
        "acceleration": {
            "kind": "radial_acceleration",
            "sampling_rate_Hz": 10000.0,
            "noise": 1.2,
            "range": 500.0,
            "bits": 16,
        },
        "encoder": {
            "kind": "wheel_encoder",
            "source": "/hub/encoder",
            "sampling_rate_Hz": 10000.0,
            "noise": 0.02,
        },
        "vehicle": {"kind": "vehicle_speed", "sampling_rate_Hz": 100.0},
        "load": {"kind": "vertical_load", "sampling_rate_Hz": 100.0},
    }
    return simulate(scenario(channels=channels, road={"roughness": 0.01}))


@pytest.mark.parametrize(
    ("drive", "name"),
    [
        *((gratings, f"log.{suffix}") for suffix in ("csv", "txt", "csv.gz", "mcap", "h5")),
        *((wheel, f"log.{suffix}") for suffix in ("mcap", "h5")),  # of several rates
    ],
)
def test_a_log_comes_back(tmp_path, drive, name):
    made = drive()
    assert [p.exists() for p in write_log(made, tmp_path / name)] == [True] * 3
    expected = to_recording(made)
    with open_recording(str(tmp_path / name)) as read:
        assert set(read.channels) == set(expected.channels)
        for channel in expected.channels.values():
            back = read.channels[channel.name]
            got, want = back.read(), channel.read()
            assert np.array_equal(np.isnan(got), np.isnan(want))
            # the file holds 0.01 pm, 1e-5 nm; a degree is 0.01 nm
            limits = {"fbg_temperature": 2e-3, "fbg_strain": 5e-8}
            limit = limits.get(channel.kind, 1e-4 * np.abs(want).max())
            assert np.nanmax(np.abs(got - want)) < limit
            assert (back.unit, back.surface) == (channel.unit, channel.surface)
            assert back.axis.rate_Hz == pytest.approx(channel.axis.rate_Hz, rel=1e-6)


def test_strain_comes_back_through_wavelength_and_twin():
    """P1 (1): the tire's strain, the twin's temperature taken out, to noise."""
    made = gratings()
    recording = to_recording(made)
    outer, inner = (recording.channels[n].read() for n in ("outer", "inner"))
    assert np.nanmin(outer) < -1e-3
    assert np.nanmax(inner) > 1e-3
    far = np.nanmedian(outer[-800:])
    assert far == pytest.approx(3e-4, abs=3e-5)
    twin = recording.channels["twin"].read()
    assert twin[-1] == pytest.approx(15.0 * (1 - np.exp(-4 / 3.0)), abs=0.1)


def test_truth_is_json_with_one_value_a_passage(tmp_path):
    made = gratings()
    _, path, _ = write_log(made, tmp_path / "log.csv")
    truth = json.loads(path.read_text(encoding="utf-8"))
    assert truth == made.truth
    for channel in ("outer", "inner"):
        passages = truth["channels"][channel]["passages"]
        assert {len(v) for v in passages.values()} == {len(passages["time_s"])}
        assert all(
            length == pytest.approx(0.116, rel=1e-6) for length in passages["contact_length_m"]
        )
        assert np.allclose(np.diff(passages["wheel_angle_rad"]), 2 * np.pi)
    assert truth["channels"]["outer"]["passages"]["slip_onset_m"][0] is None
    assert truth["effects"] == []


def test_setup_knows_what_an_engineer_knows_and_no_more():
    made = scenario(effects=[{"name": "wear"}])
    text = setup_text(made, {"s": "COLUMN"})
    setup = tomllib.loads(text)
    assert setup["channels"]["s"]["source"] == "COLUMN"
    assert setup["conditions"]["load_N"] == 3434.0
    for secret in ("stiffness", "wear", "seed", "lever", "patch"):
        assert secret not in text


def test_files_are_equal_to_the_byte(tmp_path):
    for name in ("a.csv.gz", "a.mcap"):
        first, second = tmp_path / name, tmp_path / f"b{name}"
        write_log(gratings(), first)
        write_log(gratings(), second)
        assert first.read_bytes() == second.read_bytes()


def test_inflation_ramp(tmp_path):
    """P2 Fig. 15: the strain grows with the pressure; each stop loses a little air."""
    ramp = {
        "start_Pa": 1.7e5,
        "end_Pa": 2.3e5,
        "begin_s": 1.0,
        "end_s": 9.0,
        "stops_s": [4.0, 6.0],
        "leak_Pa": 2000.0,
    }
    channels = {
        "s": {"kind": "fbg_strain", "angle_deg": 120.0},
        "p": {"kind": "inflation_pressure"},
    }
    still = [{"duration_s": 10.0, "speed_m_s": 0.0, "regime": "standstill"}]
    recording = to_recording(simulate(scenario(ramp=ramp, channels=channels, manoeuvres=still)))
    strain, pressure = recording.channels["s"].read(), recording.channels["p"].read()
    assert pressure[0] == pytest.approx(1.7e5)
    assert pressure[-1] == pytest.approx(2.3e5, rel=1e-6)
    assert pressure[10000] - pressure[12500] == pytest.approx(2000.0, rel=0.02)
    slope = np.polyfit(pressure, strain, 1)
    assert slope[0] == pytest.approx(1e-8, rel=1e-6)
    assert np.abs(strain - np.polyval(slope, pressure)).max() < 1e-9


@pytest.mark.parametrize(("rate", "digits"), [(2500.0, 4), (25000.0, 5), (10.0, 1), (3000.0, 9)])
def test_stamps_hold_the_clock(tmp_path, rate, digits):
    channels = {"s": {"kind": "fbg_strain", "sampling_rate_Hz": rate}}
    short = [{"duration_s": 0.5, "speed_m_s": 10.0}]
    path, *_ = write_log(
        simulate(scenario(channels=channels, manoeuvres=short)), tmp_path / "log.csv"
    )
    second = path.read_text(encoding="utf-8").splitlines()[4].split(",")[0]
    assert float(second) == pytest.approx(1.0 / rate, rel=1e-5)
    assert len(second.split(".")[1]) == digits
