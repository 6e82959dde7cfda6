"""Faults: passages near a hole in the encoder's signal, and an accelerometer of coarse steps."""

import numpy as np
import pytest

from tests.wheel.phase_truth import (
    DYNAMIC,
    RADIUS_M,
    STEADY,
    Drive,
    Encoder,
    Tread,
    front_errors,
    recording,
)
from tirelog.wheel.phase_shift import measure_phase_shift


def measured(drive, encoder, acceleration):
    return next(measure_phase_shift(recording(drive, encoder, acceleration), "auto"))


@pytest.mark.parametrize(
    ("how", "course", "most_deg"), [("lost", STEADY, 0.2), ("interpolated", DYNAMIC, 0.06)]
)
def test_a_passage_near_a_hole_of_the_encoder_is_right_or_marked(how, course, most_deg):
    drive, tread = Drive(*course), Tread(sharp_deg=3.0, noise_g=0.3)
    encoder = Encoder(pitch_deg=0.0, noise=0.005).signal(drive)
    size = 400 if how == "lost" else 300
    for start in np.random.default_rng(8).integers(5_000, encoder.size - 5_000, 60):
        line = np.linspace(encoder[start], encoder[start + size], size, endpoint=False)
        encoder[start : start + size] = np.nan if how == "lost" else line
    passages = measured(drive, encoder, tread.signal(drive))
    shift, _, _ = front_errors(passages, drive, tread)
    fine = passages.good[np.isfinite(passages.width_deg)]
    assert 0.8 < fine.mean() < 0.95
    assert np.abs(shift[fine]).max() < most_deg


def test_coarse_steps_of_an_accelerometer_have_errors():
    drive, tread = Drive((0, 10, 30), (10, 10, 22)), Tread()
    step = 0.05 * 22.0**2 / RADIUS_M
    values = np.rint(tread.signal(drive) / step) * step
    passages = measured(drive, Encoder().signal(drive), values)
    fine = passages.good
    assert fine.mean() > 0.9
    _, width, _ = front_errors(passages, drive, tread)
    scatter = np.std(width[fine[np.isfinite(passages.width_deg)]])
    # samples in steps are not independent: errors may be too small by a factor of two
    np.testing.assert_array_less(0.4 * scatter, passages.width_se_deg[fine])
