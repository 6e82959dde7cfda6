"""Property: contact carries the load, never pulls, follows its law and leans by losses."""

from dataclasses import replace

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.physics import Model
from tirelog.physics.carcass.contact import LOSSES, solve_contact
from tirelog.physics.carcass.structures import RingCarcass, modal_impedance

R, STEP, SPIN = 0.3, 2 * np.pi / 3072, 60.0
CARCASS = RingCarcass(
    EI=2.0, k_w=6.3e5, k_v=6.3e5, c_w=0.0, c_v=0.0, pb=1.2e5 * 0.14, R=R, k_t=8.75e7
)
#: of the foundation, radially and along [N s/m^2]; with a loss of 0.15, a belt that lags by 20 us
DAMPERS = (540.0, 200.0)
DAMPED = (540.0 * SPIN, 200.0 * SPIN, 0.15 * 6.3e5, 2e-5 * SPIN * 2.0)


def test_without_losses_the_pressure_is_even_and_none_of_them_is_no_loss():
    even, none = (solve_contact(CARCASS, 3500.0, losses) for losses in ((), (0.0,) * len(LOSSES)))
    assert np.allclose(even.pressure_N_m, even.pressure_N_m[::-1], rtol=1e-6)
    assert even.phi_rad.mean() == pytest.approx(0.0, abs=1e-9)
    assert np.allclose(none.pressure_N_m, even.pressure_N_m, rtol=0.0, atol=1e-7 * 3e4)
    assert none.half_length_m == pytest.approx(even.half_length_m, rel=1e-9)


@pytest.mark.parametrize(
    ("load", "damping"),
    [
        (20.0, ()),
        (1000.0, ()),
        (9000.0, ()),
        (250.0, DAMPERS),
        (3500.0, DAMPERS),
        (6000.0, DAMPERS),
    ],
)
def test_springs_press_just_as_deep_as_the_ring_under_them_lies(load, damping):
    """By the ring's modes, without the solver's matrix: p = k_t max(0, depth) at every angle."""
    c_w, c_v = damping or (0.0, 0.0)
    contact = solve_contact(CARCASS, load, (c_w * SPIN, c_v * SPIN, 0.0, 0.0) if damping else ())
    assert contact.pressure_N_m.sum() * R * STEP == pytest.approx(load, rel=1e-9)
    assert contact.pressure_N_m.min() >= 0.0
    phi, p = np.arange(3072) * STEP, np.zeros(3072)
    p[contact.on] = contact.pressure_N_m
    n = np.arange(1537.0)
    q_v, q_w = np.fft.rfft(p * np.sin(phi)), np.fft.rfft(-p * np.cos(phi))
    modes = (q_v + 1j * n * q_w) / modal_impedance(n, replace(CARCASS, c_w=c_w, c_v=c_v), SPIN)
    v, w = np.fft.irfft(modes), np.fft.irfft(-1j * n * modes)
    depth = contact.drop_m - R + (R + w) * np.cos(phi) - v * np.sin(phi)
    if damping:  # the mean of the wind-up, which the contact has no part of, is not in its drop
        depth += p[contact.on[0]] / CARCASS.k_t - depth[contact.on[0]]
    below = np.abs(np.arctan2(np.sin(phi), np.cos(phi))) < 0.8
    pressed = CARCASS.k_t * np.maximum(depth, 0.0)[below]
    assert np.allclose(pressed, p[below], atol=1e-7 * p.max())


STRETCHED = Model.new("ring", "radial_acceleration", radius_m=R, load_N=3500.0)


@pytest.mark.parametrize(
    ("model", "drive", "limit"),
    [
        (Model.new("ring", radius_m=R), {"load_N": np.linspace(2500.0, 4000.0, 40)}, 1e-3),
        (
            STRETCHED.with_effect("belt_tension", tension_mass_kg_m=3.0),
            {"speed_m_s": np.linspace(8.0, 26.0, 40)},
            2e-4,
        ),
    ],
)
def test_loads_and_tensions_in_between_are_interpolated(model, drive, limit):
    conditions = Conditions.of(40, **({"speed_m_s": 10.0} | drive))
    phi = np.linspace(-0.5, 0.5, 101)
    table = model.predict(conditions, phi)
    for i in (3, 17, 38):
        alone = model.predict(conditions.take(slice(i, i + 1)), phi)[0]
        assert np.abs(table[i] - alone).max() < limit * np.ptp(alone)
    if "load_N" in drive:
        assert np.all(np.diff(model.half_length_m(conditions)) > 0)


def test_a_search_that_reaches_too_far_on_its_way_is_no_refusal():
    soft = replace(CARCASS, k_w=6e4, pb=2000.0)
    contact = solve_contact(soft, 6000.0)
    assert 0.4 < contact.phi_rad[-1] < 0.6
    assert contact.pressure_N_m.sum() * R * STEP == pytest.approx(6000.0, rel=1e-9)


@pytest.mark.parametrize("observable", ["strain", "radial_acceleration", "contact_pressure"])
def test_tension_is_tension_wherever_it_comes_from(observable):
    """A wider belt under the same pressure is pulled by p0 b R more, also where it stands."""
    pressure, wider, tension = 2.2e5, 0.15, 2.2e5 * 0.02 * R
    ring = {"radius_m": R, "inflation_pressure_Pa": pressure}
    plain = Model.new("ring", "radial_acceleration", width_m=wider, **ring)
    pulled = Model.new("ring", "radial_acceleration", width_m=wider - 0.02, **ring)
    pulled = pulled.with_effect("belt_tension", tension_N=tension)
    conditions = Conditions.of(2, speed_m_s=[8.0, 20.0], load_N=[2000.0, 4000.0])
    phi = np.linspace(-np.pi, np.pi, 501)
    one, other = (m.predict(conditions, phi, observable=observable) for m in (plain, pulled))
    assert np.allclose(one, other, rtol=0.0, atol=1e-9 * np.ptp(one))


def test_sidewalls_that_pressure_stiffens_are_stiffer_ones():
    """Contact and belt at 1.6 bar are those of a tire whose sidewalls are 0.8^m as stiff."""
    soft = {"radial_stiffness_N_m2": 6.3e5, "tangential_stiffness_N_m2": 5.0e5}
    plain = Model.new("ring", "radial_acceleration", width_m=0.13, **soft)
    inflated = plain.with_effect("inflated_sidewalls", exponent=0.7)
    less = plain.with_values({name: 0.8**0.7 * value for name, value in soft.items()})
    phi = np.linspace(-0.5, 0.5, 101)
    for pressure, same in ((2.0e5, plain), (1.6e5, less)):
        at = Conditions.of(2, speed_m_s=np.array([9.0, 15.0]), inflation_pressure_Pa=pressure)
        assert np.allclose(inflated.predict(at, phi), same.predict(at, phi), rtol=1e-9, atol=1e-9)
        assert np.allclose(inflated.half_length_m(at), same.half_length_m(at), rtol=1e-12)
    assert np.ptp([m.half_length_m(at)[0] for m in (plain, less)]) > 1e-3


@pytest.mark.parametrize("observable", ["strain", "patch_length"])
def test_derivatives_with_losses_and_stiffened_sidewalls_are_differences(observable):
    """A derivative moves solved contacts a small step; a difference solves them anew."""
    model = Model.new("ring", width_m=0.13)
    model = model.with_effect("viscous_damping", damping_rate_1_s=90.0)
    model = model.with_effect("inflated_sidewalls", exponent=0.7)
    at = Conditions.of(3, speed_m_s=18.0, inflation_pressure_Pa=np.array([1.7e5, 2.0e5, 2.2e5]))
    phi = np.linspace(-0.5, 0.5, 101)
    slopes = model.linearised(at, phi, model.free, observable=observable)[1]
    for name, slope in zip(model.free, slopes, strict=True):
        step = 1e-5 * model.values[name]
        up, down = (
            model.with_values({name: model.values[name] + x}).predict(
                at, phi, observable=observable
            )
            for x in (step, -step)
        )
        wanted = (up - down) / (2.0 * step)
        assert np.allclose(slope, wanted, rtol=0.0, atol=1e-5 * np.abs(wanted).max()), name


@pytest.mark.parametrize("which", range(len(LOSSES)))
def test_every_loss_makes_the_pressure_lean_to_the_entry_edge(which):
    """What takes power needs a moment that brakes: more pressure where the tread arrives."""
    losses = tuple(x if i == which else 0.0 for i, x in enumerate(DAMPED))
    contact = solve_contact(CARCASS, 3500.0, losses)
    assert contact.pressure_N_m @ contact.on < 0.0


def test_rows_of_other_speeds_are_a_step_away_to_its_square():
    """Contacts are solved at one row's losses."""
    phi = np.linspace(-0.5, 0.5, 401)
    plain = Model.new("ring", radius_m=R, load_N=3500.0)
    model = plain.with_effect("viscous_damping", damping_rate_1_s=90.0)

    def missed(speeds):
        conditions = Conditions.of(3, speed_m_s=speeds)
        many, without = model.predict(conditions, phi), plain.predict(conditions, phi)
        alone = [model.predict(conditions.take(slice(i, i + 1)), phi)[0] for i in (0, 2)]
        off, whole = many[[0, 2]] - alone, alone - without[[0, 2]]
        return np.linalg.norm(off, axis=1) / np.linalg.norm(whole, axis=1)

    far, near = missed([12.0, 18.0, 24.0]), missed([15.0, 18.0, 21.0])
    assert far.max() < 0.03
    assert np.all(near < 0.5 * far)
