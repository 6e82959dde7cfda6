"""Closed form: a list of the times of a wheel's edges is an encoder."""

import numpy as np
import pytest

from tirelog.data.setup import parse_setup
from tirelog.runs.ingest import open_recording
from tirelog.wheel.angle import wheel_angle

STEPS = 48
#: turns of a wheel that starts at 3 turns per second and gains 0.5 per second
TURNS = np.arange(STEPS * 30) / STEPS
TIMES = (np.sqrt(9.0 + TURNS) - 3.0) / 0.5
SETUP = f'[channels.e]\nkind = "wheel_encoder"\nsource = "edges"\nsteps = {STEPS}\n'


def opened(tmp_path, text):
    (tmp_path / "edges.txt").write_text(text)
    return open_recording(str(tmp_path / "edges.txt"), parse_setup(SETUP))


@pytest.mark.parametrize(
    "text",
    [
        "edge_us\n" + "".join(f"{t * 1e6:.0f}\n" for t in TIMES),
        "".join(f"{t:.7f}\n" for t in TIMES),
    ],
    ids=["us", "s"],
)
def test_the_angle_is_that_of_the_edges(text, tmp_path):
    with opened(tmp_path, text) as recording:
        channel = recording.channels["e"]
        np.testing.assert_array_equal(channel.read(), np.arange(TIMES.size))
        np.testing.assert_allclose(channel.axis.time(), TIMES, atol=2e-6)
        at = np.linspace(0.5, TIMES[-1] - 0.5, 50)
        speed = wheel_angle(channel, "1", None).speed_rad_s(at)
    np.testing.assert_allclose(speed, 2.0 * np.pi * (3.0 + 0.5 * at), rtol=1e-3)


def test_even_edges_are_not_a_clock_that_loses_samples(tmp_path):
    """A wheel at nearly constant speed: stamps on a line are still the times themselves."""
    times = np.arange(500) * 0.01 + 3e-4 * np.sin(np.arange(500) * 0.1)
    with opened(tmp_path, "".join(f"{t:.6f}\n" for t in times)) as recording:
        np.testing.assert_allclose(recording.channels["e"].axis.time(), times, atol=1e-6)
        assert recording.remarks == ()
