"""Faults: an accelerometer glued in inward, and one without its mean level, before a model of the
acceleration is asked.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from tirelog.api.answers import measure
from tirelog.data.recording import Channel, TimeAxis
from tirelog.errors import UsageError
from tirelog.inference.measured import measured
from tirelog.physics import Model
from tirelog.runs.ingest import open_recording

pytestmark = pytest.mark.xdist_group("accelerometer sign")  # one worker makes what is shared

SAMPLES = Path(__file__).parents[2] / "sample_data"
RATE_HZ = 10_000.0


@pytest.fixture(scope="module")
def recording():
    """A log, and the accelerometer in its first twelve seconds."""
    with open_recording(str(SAMPLES / "encoder.h5"), None) as read:
        yield read, read.channels["acceleration"].read(0, 120_000)


def with_values(recording, values):
    made = Channel.of_array(
        "acceleration", "radial_acceleration", values, TimeAxis.uniform(values.size, RATE_HZ)
    )
    return replace(recording, channels={"acceleration": made})


def test_an_inward_positive_accelerometer_is_turned_and_said(recording):
    read, values = recording
    outward, inward = (
        measured([with_values(read, sign * values)], "radial_acceleration") for sign in (1.0, -1.0)
    )
    assert outward.notes == ()
    (note,) = inward.notes
    assert "acceleration was recorded inward positive" in note
    (one,), (other,) = outward.stacks, inward.stacks
    assert len(one) > 30
    np.testing.assert_array_equal(one.values, other.values)


def test_a_stored_accelerometer_is_turned_to_the_bit(recording):
    read, _ = recording
    stored = read.channels["acceleration"]
    turned = replace(
        stored,
        samples=replace(stored.samples, scale=-stored.samples.scale, offset=-stored.samples.offset),
    )
    (one,), (other,) = (
        measured([replace(read, channels={"acceleration": c})], "radial_acceleration").stacks
        for c in (stored, turned)
    )
    np.testing.assert_array_equal(one.values, other.values)


AC = {
    "ac": lambda values: sosfilt(butter(1, 0.5, "high", fs=RATE_HZ, output="sos"), values),
    "median": lambda values: values - np.median(values),
    "inward, ac": lambda values: -sosfilt(butter(1, 0.5, "high", fs=RATE_HZ, output="sos"), values),
    "g for m/s^2": lambda values: values / 9.80665,
}


@pytest.mark.parametrize("how", AC)
def test_an_accelerometer_without_its_level_is_refused(recording, how):
    read, values = recording
    with pytest.raises(
        UsageError,
        match=r"outside the patch \(median\) and a turning sensor reads -v\^2/R = -.*; "
        r"allowed is 30 % off|the step into the patch is 0\.127 times Omega\^2 R",
    ):
        measured([with_values(read, AC[how](values))], "radial_acceleration")


@pytest.mark.parametrize("how", [lambda values: 1.1 * values, lambda values: values + 15.0])
def test_a_sensor_s_own_gain_and_zero_are_let_through(recording, how):
    read, values = recording
    assert measured([with_values(read, how(values))], "radial_acceleration").notes == ()


def test_a_model_of_an_ac_coupled_sensor_needs_no_level(recording):
    read, values = recording
    coupled = with_values(read, AC["ac"](values))
    model = Model.new("ring", "radial_acceleration")
    with pytest.raises(UsageError, match="give the model coupling_Hz"):
        measure([coupled], model)
    (stack,) = measure([coupled], model.with_values({"coupling_Hz": 0.5})).stacks
    assert len(stack) > 30
