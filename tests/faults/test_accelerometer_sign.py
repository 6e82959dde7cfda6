"""Faults: an accelerometer glued in inward, and one without its mean level."""

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


def stack_of(recording):
    """(stack of the accelerometer, notes)."""
    found = measured([recording], "radial_acceleration")
    (stack,) = found.stacks
    assert len(stack) > 30
    return stack.values, found.notes


def test_an_inward_positive_accelerometer_is_turned_and_said(recording):
    read, values = recording
    outward, none = stack_of(with_values(read, values))
    inward, (note,) = stack_of(with_values(read, -values))
    assert none == ()
    assert "acceleration was recorded inward positive" in note
    np.testing.assert_array_equal(outward, inward)


def test_a_stored_accelerometer_is_turned_to_the_bit(recording):
    read, _ = recording
    stored, samples = read.channels["acceleration"], read.channels["acceleration"].samples
    turned = replace(samples, scale=-samples.scale, offset=-samples.offset)
    made = replace(read, channels={"acceleration": replace(stored, samples=turned)})
    as_stored = replace(read, channels={"acceleration": stored})
    np.testing.assert_array_equal(stack_of(as_stored)[0], stack_of(made)[0])


AC = {
    "ac": lambda values: sosfilt(butter(1, 0.5, "high", fs=RATE_HZ, output="sos"), values),
    "median": lambda values: values - np.median(values),
    "inward, ac": lambda values: -sosfilt(butter(1, 0.5, "high", fs=RATE_HZ, output="sos"), values),
    "g for m/s^2": lambda values: values / 9.80665,
}


@pytest.mark.parametrize("how", AC)
def test_an_accelerometer_without_its_level_is_refused(recording, how):
    read, values = recording
    said = r"outside the patch \(median\) and a turning sensor reads -v\^2/R = -.*; allowed is 30 %"
    with pytest.raises(
        UsageError, match=rf"{said}|the step into the patch is 0\.127 times the centripetal"
    ):
        measured([with_values(read, AC[how](values))], "radial_acceleration")


@pytest.mark.parametrize(("gain", "zero"), [(1.1, 0.0), (1.0, 15.0)])
def test_a_sensor_s_own_gain_and_zero_are_let_through(recording, gain, zero):
    read, values = recording
    assert stack_of(with_values(read, gain * values + zero))[1] == ()


def test_a_model_of_an_ac_coupled_sensor_needs_no_level(recording):
    read, values = recording
    coupled = with_values(read, AC["ac"](values))
    model = Model.new("ring", "radial_acceleration")
    with pytest.raises(UsageError, match="give the model coupling_Hz"):
        measure([coupled], model)
    (stack,) = measure([coupled], model.with_values({"coupling_Hz": 0.5})).stacks
    assert len(stack) > 30
