"""Literature: radial acceleration at 80 km/h as O. Jousimaa (Aalto 2016) shows it."""

import numpy as np
import pytest

from tirelog.data.recording import Channel, Conditions, Recording, TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.inference.base import prepare
from tirelog.inference.cells.cells import cells_of
from tirelog.inference.cells.pieces import pieces_of_logs
from tirelog.inference.measured import measured
from tirelog.physics import Model
from tirelog.strain.footprint.footprint import accelerometer_footprints
from tirelog.strain.passages.find import find_passages
from tirelog.vocabulary.quality import Quality, having

#: angle from the patch centre [degrees]: mean [g] with the patch shifted to 0, standard deviation
#: between turns [g]
TURN = """
-120 -156.8 2.7  -90 -155.6 2.5  -60 -162.6 5.3  -45 -177.3 5.2  -40 -181.0 10  -35 -186.6 12
-30 -207.6 12  -25 -176.6 13  -22 -175.6 26  -20 -261.5 14  -18 -234.6 24  -16 -247.2 37
-14 -190.6 28  -12 -219.0 65  -11 -137.3 64  -10 -49.2 23  -9 -21.0 16  -8 -3.6 3.3  -6 -1.2 3.8
-4 -1.1 0.9  0 -1.1 1.1  4 -1.8 0.8  6 -0.8 1.2  8 3.6 2.2  9 -4.6 6.7  10 -39.5 29  11 -135.9 36
12 -201.7 22  13 -247.4 13  14 -247.8 13  16 -212.5 14  18 -221.0 9  20 -227.1 6  22 -211.0 12
25 -213.6 5  30 -180.4 5  35 -190.1 8  40 -182.0 5  45 -158.3 4  60 -162.6 4  90 -160.2 2
120 -149.4 1.3  180 -151.4 1.2
"""
RADIUS_M, RATE_HZ, STANDARD_GRAVITY = 0.3216, 25_000.0, 9.80665
SETUP = """[tire]
unloaded_radius_m = 0.33
rolling_radius_m = 0.3216
[channels.z]
kind = "radial_acceleration"
source = "z"
unit = "g"
"""


def log_of(passages, seed):
    """(acceleration [m/s^2] of so many passages at 22.2 m/s, AC-coupled; speed [m/s])."""
    rng = np.random.default_rng(seed)
    degrees, mean, scatter = np.array(TURN.split(), float).reshape(-1, 3).T
    rate = 22.2 / RADIUS_M / (2 * np.pi)
    turned = np.arange(int((passages - 0.5) / rate * RATE_HZ)) / RATE_HZ * rate - 0.25
    angle = ((turned + 0.5) % 1.0 - 0.5) * 360.0
    level = np.interp(angle, degrees, mean, period=360.0)
    spread = np.interp(angle, degrees, scatter, period=360.0)
    # what scatters between turns is ringing: some hundred hertz of another phase in each
    phase = rng.uniform(0, 2 * np.pi, passages + 1)[np.floor(turned + 0.5).astype(int)]
    values = level + spread * np.sqrt(2) * np.sin(
        2 * np.pi * 440.0 * np.arange(angle.size) / RATE_HZ + phase
    )
    values += rng.normal(0.0, 0.1, angle.size)
    return (values - np.median(values)) * STANDARD_GRAVITY, 22.2


def channel_of(values):
    axis = TimeAxis.uniform(values.size, RATE_HZ)
    return Channel.of_array("z", "radial_acceleration", values, axis)


def recording_of(values):
    return Recording("facts", {"z": channel_of(values)}, parse_setup(SETUP))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    "offset_g", [0.0, -157.0, 157.0], ids=["AC-coupled", "DC restored", "shifted the other way"]
)
def test_every_passage_is_found_whichever_way_the_sensor_counts(sign, offset_g):
    values, speed = log_of(10, 1000)
    found = find_passages(channel_of(sign * (values + offset_g * STANDARD_GRAVITY)), RADIUS_M)
    assert len(found) == 10
    np.testing.assert_allclose(found.speed_m_s, speed, rtol=0.01)
    # the ringing of the edges is what the sensor sees in every turn, and no spike
    assert having(found.quality, Quality.SPIKE).sum() <= 1


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_contact_length_between_the_fronts_is_the_published_one(sign):
    """0.0582 of a turn: 117.5 mm, without an encoder, with the sensor AC-coupled."""
    (found,) = accelerometer_footprints(recording_of(sign * log_of(10, 1000)[0]))
    length = found.columns["length_m"]
    assert np.isfinite(length).sum() >= 8
    assert np.nanmedian(length) == pytest.approx(0.1175, rel=0.02)
    assert np.nanmedian(found.columns["edge_asymmetry"]) > 0.0  # the exit edge is the sharper


def test_a_spike_is_told_from_the_ringing():
    values, _ = log_of(20, 1001)
    clean = find_passages(channel_of(values), RADIUS_M)
    hit = values.copy()  # within the flat patch, where turns scatter by 1 g
    hit[int(clean.index[7]) + 40] += 100.0 * STANDARD_GRAVITY
    found = find_passages(channel_of(hit), RADIUS_M)
    assert having(found.quality, Quality.SPIKE)[7]
    assert not having(clean.quality, Quality.SPIKE)[7]


def fitted(carcass, **values):
    """A carcass fitted to ten passages, and what its patch looks like: (error over the noise floor,
    width between half levels [degrees], largest less least within +-5 degrees [g], largest lobe
    below the patch [g])."""
    recording = recording_of(log_of(10, 1000)[0])
    pieces = pieces_of_logs(measured([recording], "radial_acceleration", level=False).stacks)
    model = Model.new(
        carcass, "radial_acceleration", coupling_Hz=0.5, load_N=4000.0, radius_m=RADIUS_M, **values
    )
    base = prepare(cells_of(pieces), model, several=False)
    phi = np.radians(np.arange(-60.0, 60.0, 0.05))
    wave = base.model.predict(Conditions.of(1, speed_m_s=22.2), phi)[0] / STANDARD_GRAVITY
    patch = wave[np.abs(phi) < np.radians(5.0)]
    inside = np.flatnonzero(wave > 0.5 * (np.median(wave) + patch.mean()))
    width = np.degrees(phi[inside[-1]] - phi[inside[0]])
    over = np.sqrt(base.square_fit / base.floor.square)
    return over, width, np.ptp(patch), wave.min() - patch.mean()


def test_a_ring_pulled_by_its_pressure_makes_these_edges_and_a_beam_does_not():
    """Published: 20.9 degrees (117.5 mm) between the fronts, flat to about 1 g in the patch, lobes
    of -266 and -251 g. What the ring leaves is the ringing beside the edges."""
    over, width, flat, lobe = fitted(
        "ring", inflation_pressure_Pa=2.2e5, width_m=0.1, flexural_stiffness_N_m2=0.1
    )
    assert 1.0 < over < 1.3
    assert width == pytest.approx(20.9, rel=0.03)
    assert flat < 3.0
    assert lobe == pytest.approx(-258.0, rel=0.08)
    beam_over, beam_width, beam_flat, _ = fitted("beam", reference_load_N=4000.0)
    assert beam_over > 1.6 * over
    assert beam_width < 18.0
    assert beam_flat > 20.0
