"""Literature: what P3's Figs. 3 to 7 show, with Table 2."""

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.physics import Model

R = 0.3
PHI = np.linspace(-np.pi, np.pi, 4097)[:-1]
# Table 2
TABLE_2 = {
    "flexural_stiffness_N_m2": 2.0, "radial_stiffness_N_m2": 6.3e5,
    "tangential_stiffness_N_m2": 6.3e5, "inflation_pressure_Pa": 1.2e5, "width_m": 0.14,
    "radius_m": R, "line_mass_kg_m": 3.15, "lever_arm_m": 6e-3,
}  # fmt: skip


def prescribed(load, half_angle_deg):
    half = R * np.radians(half_angle_deg)
    return Model.new(
        "ring",
        contact="prescribed",
        patch_half_length_m=half,
        load_N=load,
        reference_load_N=load,
        **TABLE_2,
    )


def drive(**more):
    return Conditions.of(1, **{"speed_m_s": 10.0, **more})


def truncated(values, modes):
    """The waveform of the first `modes` modes."""
    spectrum = np.fft.rfft(values)
    spectrum[modes + 1 :] = 0.0
    return np.fft.irfft(spectrum, values.size)


def ripple(values):
    """Largest wave far from the patch."""
    return np.ptp(values[np.abs(PHI) > 1.5])


def test_ten_modes_ring_visibly_and_a_hundred_do_not():
    """Fig. 3, F_z = 1000 N: the modes are summed as they stand, so a mode-limited strain is the
    truncated waveform.
    """
    strain = prescribed(1000.0, 4.6).predict(drive(), PHI, surface="inner")[0]
    assert np.argmax(strain) == pytest.approx(PHI.size / 2, abs=1)
    span = np.ptp(strain)
    ten, hundred = truncated(strain, 10), truncated(strain, 100)
    assert ripple(ten) > 0.03 * span
    assert ripple(hundred) < 1.5 * ripple(strain) + 1e-4 * span
    assert np.abs(ten - strain).max() > 0.2 * span
    assert np.abs(hundred - strain).max() < 0.01 * span


def test_slip_makes_the_lower_peaks_unequal():
    """Fig. 4, 250 N, slip of -0.2, 0, 0.2 (driving is P3's positive): the side lobes change places
    with the sign.
    """
    model = prescribed(250.0, 2.3).with_effect("traction", lever_m=0.005)
    lobes = {}
    for slip in (-0.2, 0.0, 0.2):
        strain = model.predict(drive(slip=slip), PHI, surface="inner")[0]
        lobes[slip] = strain[(PHI < 0)].min() - strain[(PHI > 0)].min()
    assert abs(lobes[0.0]) < 1e-9
    assert lobes[0.2] == pytest.approx(-lobes[-0.2], rel=0.05)
    assert abs(lobes[0.2]) > 0.01 * np.ptp(model.predict(drive(slip=0.2), PHI))


def test_wear_sets_the_trailing_edge_apart():
    """Figs. 5 and 6: the difference between trailing and leading edge grows with wear, the strain
    shrinks with the lever arm.
    """
    model = prescribed(1000.0, 4.6).with_effect("wear", amplitude=0.5, lever_loss=0.2)
    gaps, spans = [], []
    for distance in (0.0, 20000.0, 40000.0):
        strain = model.predict(drive(distance_km=distance), PHI, surface="inner")[0]
        leading, trailing = np.interp(np.radians([-4.6, 4.6]), PHI, strain)
        gaps.append((trailing - leading) / np.ptp(strain))
        spans.append(np.ptp(strain))
    assert abs(gaps[0]) < 1e-9
    assert gaps[2] > gaps[1] > 0.01
    assert spans[2] < spans[0]


def test_a_higher_load_presses_deeper_and_longer_with_less_strain_per_newton():
    """Fig. 7, three loads on a flat road: a longer patch shares the load."""
    model = Model.new("ring", **TABLE_2)
    loads = [500.0, 1000.0, 3500.0]
    depth, per_newton = [], []
    for load in loads:
        conditions = drive(load_N=load)
        depth.append(model.predict(conditions, PHI, observable="displacement").max())
        per_newton.append(np.ptp(model.predict(conditions, PHI)) / load)
    assert depth[0] < depth[1] < depth[2]
    assert per_newton[0] > per_newton[1] > per_newton[2]
    lengths = [model.half_length_m(drive(load_N=load))[0] for load in loads]
    assert lengths[0] < lengths[1] < lengths[2]
