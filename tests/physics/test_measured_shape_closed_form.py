"""Closed form: a user's waveform in the mean over a bin, and a measured shape by its lines."""

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.physics import Model
from tirelog.physics.model.file import as_toml, load_model, parse_model, save_model
from tirelog.physics.model.model import ModelEffect
from tirelog.physics.model.user_effects import FRAMES, effect_by_expression, effect_by_shape
from tirelog.physics.spectral import Angles, Parameter

AT = Conditions.of(
    3, speed_m_s=np.array([8.0, 14.0, 22.0]), acceleration_m_s2=0.0, time_s=0.0, load_N=3434.0
)
PHI = np.linspace(-3.0, 3.0, 61)
BEAM = Model.new("beam", radius_m=0.3)


def added(model, at=PHI):
    """What the effects of a model add to the strain of the bare beam."""
    return model.predict(AT, at) - BEAM.predict(AT, at)


def test_a_user_s_waveform_is_its_mean_over_a_bin():
    """The mean of a cosine over a bin of width w is it times sin(k w / 2) / (k w / 2)."""
    k, width = 24.0, 0.03
    amplitude = Parameter("A", "1", "", 1e-4, -1.0, 1.0, 1e-4)
    effect = effect_by_expression("wave", "strain", f"A * cos({k} * phi)", (amplitude,))
    found = added(BEAM.with_effect(effect), Angles(PHI, width**2 / 12.0))
    damped = np.sin(0.5 * k * width) / (0.5 * k * width)
    assert 0.5 * k * width > 0.3  # it is damped by 2 %
    np.testing.assert_allclose(
        found, np.broadcast_to(1e-4 * np.cos(k * PHI) * damped, found.shape), atol=2e-4 * 1e-4
    )


def coordinate(frame):
    """Each frame's coordinate by plain arithmetic, (3, m)."""
    radius, half = 0.3, BEAM.half_length_m(AT)[:, None]
    xi, turn = PHI * radius, 2.0 * np.pi * 0.3
    since, before = np.mod(xi - half, turn), np.mod(-half - xi, turn)
    speed = AT.speed_m_s[:, None]
    return {
        "wheel_angle": np.broadcast_to(PHI, since.shape),
        "patch": xi / half,
        "time_since_exit": since / speed,
        "distance_since_exit": since,
        "time_before_entry": before / speed,
        "distance_before_entry": before,
    }[frame]


@pytest.mark.parametrize("frame", [f for f in FRAMES if f != "speed"])
def test_a_shape_is_straight_lines_along_its_coordinate_times_its_law(frame):
    at = coordinate(frame)
    nodes = np.linspace(at.min() + 0.1 * np.ptp(at), at.max() - 0.1 * np.ptp(at), 7)
    values = 1e-5 * np.array([2.0, 3.0, -2.0, 5.0, 1.0, -4.0, -1.0])
    effect = effect_by_shape("mine", "strain", frame, "(speed / 20) ** 2", nodes, values)
    found = added(BEAM.with_effect(effect, amplitude=0.5))
    ends = {"period": 2.0 * np.pi} if frame == "wheel_angle" else {"left": 0.0, "right": 0.0}
    wanted = 0.5 * (AT.speed_m_s[:, None] / 20.0) ** 2 * np.interp(at, nodes, values, **ends)
    np.testing.assert_allclose(found, wanted, atol=1e-14)


def test_a_shape_of_the_pressure_is_in_mean_pressures():
    nodes, values = [-0.9, -0.3, 0.3, 0.9], [0.0, 0.2, -0.2, 0.0]
    shape = effect_by_shape("mine", "contact_pressure", "patch", "1", nodes, values)
    amplitude = Parameter("A", "1", "", 0.2, -1.0, 1.0, 0.1)
    inside = "where(abs(xi / L) < 0.3, -xi / L / 0.3, sign(-xi) * (0.9 - abs(xi / L)) / 0.6)"
    text = f"A * load / (2 * L) * (abs(xi / L) < 0.9) * {inside}"
    same = effect_by_expression("same", "contact_pressure", text, (amplitude,))
    np.testing.assert_allclose(
        BEAM.with_effect(shape).predict(AT, PHI),
        BEAM.with_effect(same).predict(AT, PHI),
        atol=1e-12,
    )


def test_a_shape_is_written_read_and_still_itself(tmp_path):
    nodes, values = [0.0, 0.004, 0.01], [0.0, 2e-5, 0.0]
    effect = effect_by_shape("mine", "strain", "time_since_exit", "speed / 20", nodes, values)
    source = {"shape": "empirical", "acts_on": "strain", "frame": "time_since_exit"}
    source |= {"law": "speed / 20", "nodes": nodes, "values": values}
    model = BEAM.with_entry(ModelEffect(effect, effect.parameters, {}, source))
    save_model(model.with_values({"mine.amplitude": 0.7}), tmp_path / "m.toml")
    read = load_model(tmp_path / "m.toml")
    assert read.values["mine.amplitude"] == 0.7
    np.testing.assert_array_equal(
        read.predict(AT, PHI), model.with_values({"mine.amplitude": 0.7}).predict(AT, PHI)
    )
    assert as_toml(read) == (tmp_path / "m.toml").read_text()
    assert parse_model(as_toml(read.without_effect("mine"))).values == BEAM.values
