"""Property: every effect of the catalogue passes one shared test."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.errors import ModelError
from tirelog.physics import BY_ID, CATALOGUE, Model, ModelEffect
from tirelog.physics.effects import base, conditions_read, readers
from tirelog.physics.effects.base import Drive, Site
from tirelog.physics.model.user_effects import EXPRESSION_ACTS_ON, effect_by_expression
from tirelog.physics.spectral import Parameter
from tirelog.vocabulary.conditions import CONDITIONS
from tirelog.vocabulary.observables import OBSERVABLES, WAVEFORMS

PHI = np.linspace(-np.pi, np.pi, 97)[:-1] + 0.01
N = 7
VARIED = {
    "speed_m_s": np.linspace(6.0, 24.0, N), "acceleration_m_s2": np.linspace(-4.0, 3.0, N),
    "time_s": np.linspace(0.0, 60.0, N), "temperature_K": np.linspace(0.0, 12.0, N),
    "inflation_pressure_Pa": 2.2e5, "distance_km": np.linspace(1e3, 3e4, N),
    "water_depth_mm": 1.5, "load_N": np.linspace(3000.0, 4000.0, N),
    "longitudinal_force_N": np.linspace(-1800.0, 1500.0, N),
}  # fmt: skip
#: a condition that is new is driven at its example, so that an effect of it is tested by itself
DRIVE = Conditions.of(
    N, **{name: c.example for name, c in CONDITIONS.items() if c.example is not None} | VARIED
)
WAVES = [e for e in CATALOGUE if "strain" in e.observables]


def base_for(effect, carcass="beam"):
    observable = "strain" if "strain" in effect.observables else effect.observables[0]
    contact = "prescribed" if carcass == "ring" else None
    model = Model.new(carcass, observable, contact)
    for beside in readers(effect, observable):  # without it the effect acts on nothing
        model = probed(model.with_effect(beside), beside)
    return model


def probed(model, effect):
    return model.with_values({f"{effect.id}.{p.name}": p.probe for p in effect.parameters})


def by_id(effects):
    return pytest.mark.parametrize("effect", effects, ids=lambda e: e.id)


@pytest.mark.parametrize("carcass", ["beam", "ring"])
@by_id(CATALOGUE)
def test_off_is_the_base_model_to_the_last_bit(effect, carcass):
    base = base_for(effect, carcass)
    if carcass == "ring" and effect.beam_only:
        with pytest.raises(ModelError, match="is for carcass"):
            base.with_effect(effect)
        return
    on = probed(base.with_effect(effect), effect)
    # a ring feels the shear without a lever
    without = (*effect.strength, *(["slip_per_g"] if effect.id == "traction" else []))
    off = on.with_values({f"{effect.id}.{name}": 0.0 for name in without})
    assert np.array_equal(off.predict(DRIVE, PHI), base.predict(DRIVE, PHI))
    assert not np.array_equal(on.predict(DRIVE, PHI), base.predict(DRIVE, PHI))
    if effect in WAVES:
        acceleration = on.predict(DRIVE, PHI, observable="radial_acceleration")
        assert np.isfinite(acceleration).all()


@by_id(CATALOGUE)
def test_slopes_agree_with_differences_of_the_prediction(effect):
    """Richardson's extrapolation of the whole prediction, at the probe."""
    names = [f"{effect.id}.{p.name}" for p in effect.parameters if p.free]
    on = probed(base_for(effect).with_effect(effect), effect)
    names += [n for n in on.free if "." not in n]
    slopes = on.linearised(DRIVE, PHI, names)[1]
    for name, slope in zip(names, slopes, strict=True):
        p = on.parameters[name]
        step = 1e-3 * max(abs(p.value), 1e-3 * abs(p.probe))

        def central(h, name=name, value=p.value):
            up, down = (on.predict(DRIVE, PHI, values={name: value + sign * h}) for sign in (1, -1))
            return (up - down) / (2 * h)

        wanted = (4 * central(step / 2) - central(step)) / 3
        assert (
            np.abs(slope - wanted).max()
            <= 1e-5 * np.abs(wanted).max() + 1e-12 * np.abs(slope).max()
        ), name


@by_id(CATALOGUE)
def test_slope_at_zero_strength_is_the_one_from_above(effect):
    on = probed(base_for(effect).with_effect(effect), effect)
    name = f"{effect.id}.{effect.strength[0]}"
    step = 1e-4 * abs(on.parameters[name].probe)
    zero = on.with_values({f"{effect.id}.{s}": 0.0 for s in effect.strength})
    slope = zero.linearised(DRIVE, PHI, [name])[1][0]
    wanted = (zero.predict(DRIVE, PHI, values={name: step}) - zero.predict(DRIVE, PHI)) / step
    # what is even in its strength has no slope at zero
    size = np.ptp(zero.predict(DRIVE, PHI)) / abs(on.parameters[name].probe)
    assert np.abs(slope - wanted).max() <= 2e-3 * np.abs(wanted).max() + 2e-4 * size


@by_id(CATALOGUE)
def test_its_data_are_complete(effect):
    assert effect.checked() is effect
    assert effect.strength
    texts = (effect.mechanism, effect.follows_said, effect.source, effect.valid, effect.signature)
    assert all(texts)
    for p in effect.parameters:
        assert p.unit
        assert p.description
        assert p.probe != 0.0
        assert p.min <= min(p.probe, p.value) <= max(p.probe, p.value) <= p.max


@by_id(CATALOGUE)
def test_it_follows_the_conditions_that_it_says(effect):
    """Beside speed and load, which every model reads."""
    on = probed(base_for(effect).with_effect(effect), effect).resolved(DRIVE)
    before = on.predict(DRIVE, PHI)
    others = [name for name in CONDITIONS if name not in ("speed_m_s", "load_N")]
    known = {name: np.nan_to_num(getattr(DRIVE, name)) for name in others}
    moved = {name: replace(DRIVE, **{name: 1.1 * values + 0.01}) for name, values in known.items()}
    read = {name for name in others if not np.array_equal(on.predict(moved[name], PHI), before)}
    said = {name for name, _ in effect.followed}
    either = {*effect.instead, *effect.instead.values()}  # one of the two is read
    assert read <= said | either
    assert said - read <= either | {"speed_m_s", "load_N"}


@pytest.mark.parametrize("names", ["", "ab"])
def test_a_function_that_does_not_read_the_effect_s_numbers_is_refused(names):
    numbers = {name: base.number(0.0, -1.0, 1.0, "1", name, probe=0.1) for name in names}

    def mine(drive, *, a):
        return a * drive.speed_m_s

    with pytest.raises(
        ModelError, match="effect mine: its functions read a, its numbers and options"
    ):
        base.effect("baseline", **numbers)(mine)


def following(follows, **more):
    return replace(CATALOGUE[0], id="mine", follows=follows, **more)


def test_what_is_followed_is_put_in_words():
    assert following(()).checked().follows_said == "nothing"
    assert following((("water_depth_mm", 1), ("speed_m_s", 1.5))).follows_said == (
        "water depth, speed^1.5"
    )


@by_id([e for e in CATALOGUE if e.needs])
def test_conditions_that_it_lacks_are_named(effect):
    model = probed(base_for(effect).with_effect(effect), effect)
    for field in effect.needs:
        lacking = replace(DRIVE, **{field: np.full(N, np.nan)})
        if field in effect.instead:
            assert (
                model.missing_conditions(lacking).get(effect.id) is None
                or np.isnan(getattr(lacking, effect.instead[field])).all()
            )
            lacking = replace(lacking, **{effect.instead[field]: np.full(N, np.nan)})
        assert model.missing_conditions(lacking)[effect.id] == [field]
        with pytest.raises(ModelError, match=field):
            model.predict(lacking, PHI)


@by_id([e for e in WAVES if "contact_pressure" in e.acts_on])
def test_pressure_still_carries_the_load(effect):
    model = probed(base_for(effect).with_effect(effect), effect)
    fine = (np.arange(4096) + 0.5) * (2 * np.pi / 4096) - np.pi
    R = model.parameters["radius_m"].value
    carried = model.predict(DRIVE, fine, observable="contact_pressure").mean(axis=1) * 2 * np.pi * R
    assert np.allclose(carried, DRIVE.load_N, rtol=1e-6)


def test_effects_compose_in_any_order_to_the_last_bit():
    ids = [e.id for e in WAVES if not readers(e, "strain")]
    rng = np.random.default_rng(5)
    predictions = []
    for order in (ids, ids[::-1], list(rng.permutation(ids))):
        model = Model.new("beam")
        for name in order:
            model = model.with_effect(name)
            model = model.with_values(
                {f"{name}.{p.name}": p.probe for p in model.effects[-1].parameters}
            )
        predictions.append(model.predict(DRIVE, PHI))
    assert np.array_equal(predictions[0], predictions[1])
    assert np.array_equal(predictions[0], predictions[2])


# ---- what some do; others are held by the truth (tests/simulation/test_against_models.py) --------


@pytest.mark.parametrize(("law", "size"), [("hardens", 3e3), ("softens", 4.5e2)])
def test_stiffening_balances_the_hardened_foundation(law, size):
    """p - EJ w'''' - mu c^2 w'' - k (1 +- k3 w^2) w = 0 by differences."""
    k, EJ, mu = 2e6, 4.0, 4.5
    k3 = size if law == "hardens" else -size
    one = Conditions.of(1, speed_m_s=15.0)
    entry = replace(ModelEffect.of(BY_ID["stiffening"]), options={"law": law})
    model = Model.new("beam").with_effect(entry, cubic_1_m2=size)
    step = 0.02
    phi = np.array([-0.6, -0.08, 0.0, 0.1, 0.5])
    w = np.stack(
        [model.predict(one, phi + j * step, observable="displacement")[0] for j in range(-3, 4)]
    )
    h = step * 0.3126
    fourth = np.tensordot([-1, 12, -39, 56, -39, 12, -1], w, 1) / (6 * h**4)
    second = np.tensordot([2, -27, 270, -490, 270, -27, 2], w, 1) / (180 * h**2)
    xi, L = phi * 0.3126, 0.055
    p = np.where(np.abs(xi) < L, 0.75 * 3600 / L**3 * (L**2 - xi**2), 0.0)
    rest = EJ * fourth + mu * 15.0**2 * second + k * (1 + k3 * w[3] ** 2) * w[3] - p
    assert np.abs(rest).max() < 2e-3 * p.max()
    assert abs(k3) * w[3].max() ** 2 > (0.2 if law == "hardens" else 0.09)


def test_thermal_drift_follows_temperature_where_it_varies_and_time_where_not():
    base = Model.new("beam")
    model = base.with_effect("thermal_drift", drift=2e-6)
    steady = replace(DRIVE, temperature_K=np.full(N, 3.0))
    by_temperature = (model.predict(DRIVE, PHI) - base.predict(DRIVE, PHI)).mean(axis=1)
    by_time = (model.predict(steady, PHI) - base.predict(steady, PHI)).mean(axis=1)
    assert np.allclose(by_temperature, 2e-6 * DRIVE.temperature_K, atol=1e-15)
    assert np.allclose(by_time, 2e-6 * (1 - np.exp(-DRIVE.time_s / 30.0)), atol=1e-15)


def test_dissipation_factor_is_the_integral_of_the_squared_gradient():
    model = Model.new("beam", "dissipation_factor")
    R = 0.3126
    phi = np.linspace(-np.pi, np.pi, 20001)
    strain = model.predict(DRIVE, phi, observable="strain")
    slope = np.gradient(strain, R * phi, axis=1)
    wanted = np.trapezoid(slope**2, R * phi, axis=1)
    assert np.allclose(model.predict(DRIVE)[:, 0], wanted, rtol=1e-4)


# ---- a user's own effects ------------------------------------------------------------------------

Q = Parameter("q", "", "the user's own", 0.0, -1e6, 1e6, probe=1.0)
BUMP = "q * exp(-(xi / 0.1)**2)"


def mine(base, acts_on, text, q=0.0):
    """The model with a user's effect of one parameter."""
    own = base.with_effect(effect_by_expression("mine", acts_on, text, (Q,)))
    return own.with_values({"mine.q": q}) if q else own


def test_users_effects_are_off_at_zero_and_do_what_they_say():
    base, xi = Model.new("beam"), 0.3126 * PHI
    plain = base.predict(DRIVE, PHI)
    for place, text, value, change in (
        ("baseline", "q * speed", 1e-6, 1e-6 * DRIVE.speed_m_s[:, None]),
        ("strain", BUMP, 1e-6, 1e-6 * np.exp(-((xi / 0.1) ** 2))),
        ("sensor", "q * acceleration", 0.01, 0.01 * DRIVE.acceleration_m_s2[:, None] * plain),
    ):
        assert np.array_equal(mine(base, place, text).predict(DRIVE, PHI), plain)
        got = mine(base, place, text, value).predict(DRIVE, PHI)
        assert np.allclose(got - plain, np.broadcast_to(change, plain.shape), atol=1e-12)
    assert np.allclose(
        mine(base, "load", "q * time", 10.0).half_length_m(DRIVE),
        0.055 * np.sqrt((DRIVE.load_N + 10 * DRIVE.time_s) / 3600),
    )
    softer = mine(base, "foundation_stiffness", "q", 5e5)
    stiff = base.with_values({"foundation_stiffness_N_m2": 2.5e6})
    assert np.allclose(softer.predict(DRIVE, PHI), stiff.predict(DRIVE, PHI), rtol=1e-12)


LOADED = {"contact_pressure", "foundation_stiffness", "load", "sensor"}
REACHED = {
    "strain": LOADED | {"strain", "baseline"},
    "radial_acceleration": LOADED | {"radial_acceleration"},
    "dissipation_factor": LOADED,
    "patch_length": {"load"},
    "patch_width": {"load"},
}


@pytest.mark.parametrize("observable", list(REACHED))
@pytest.mark.parametrize("acts_on", EXPRESSION_ACTS_ON)
def test_a_users_effect_moves_what_it_acts_on_or_is_refused(observable, acts_on):
    base, text = Model.new("beam", observable), BUMP if acts_on == "contact_pressure" else "q"
    if acts_on not in REACHED[observable]:
        said = f"does nothing to {observable}.*what acts on {observable}: load"
        with pytest.raises(ModelError, match=said):
            mine(base, acts_on, text)
        return
    moved = mine(base, acts_on, text, 1e-3 if acts_on in ("strain", "baseline", "sensor") else 1e2)
    assert not np.allclose(moved.predict(DRIVE, PHI), base.predict(DRIVE, PHI), rtol=1e-6, atol=0.0)


def test_a_users_acceleration_is_added_and_a_sensors_factor_multiplies_all_of_it():
    base = Model.new("ring", "radial_acceleration", "prescribed")
    read = base.predict(DRIVE, PHI)
    more = mine(base, "radial_acceleration", "q * cos(phi)", 2.0).predict(DRIVE, PHI)
    assert np.allclose(more, read + 2.0 * np.cos(PHI), rtol=1e-12)
    assert np.allclose(mine(base, "sensor", "q", 0.1).predict(DRIVE, PHI), 1.1 * read, rtol=1e-12)


def test_a_users_wedge_is_the_catalogues_wedge():
    text = (
        "q * load / (2 * L) * (speed / 20)**2 * water * (-L - xi) / (0.4 * L) * exp(1 - (-L - "
        "xi) / (0.4 * L)) * (xi < -L)"
    )
    base = Model.new("beam")
    own, known = mine(base, "contact_pressure", text, 0.1), base.with_effect("water_film")
    a, b = own.predict(DRIVE, PHI), known.with_values({"water_film.amplitude": 0.1})
    b = b.predict(DRIVE, PHI)
    assert np.abs(a - b).max() < 1e-4 * np.abs(b - base.predict(DRIVE, PHI)).max()


@pytest.mark.parametrize(("acts_on", "q"), [("strain", 1e-6), ("contact_pressure", 100.0)])
def test_bins_without_a_sample_have_no_value_and_spoil_no_other(acts_on, q):
    """An angle bin that no sample fell into has no angle (NaN)."""
    model, phi = mine(Model.new("beam"), acts_on, BUMP, q), np.tile(PHI, (N, 1))
    full = model.predict(DRIVE, phi)
    phi[2, 5] = np.nan
    holed = model.predict(DRIVE, phi)
    assert np.isnan(holed[2, 5])
    holed[2, 5] = full[2, 5]
    np.testing.assert_array_equal(holed, full)


# ---- numbers per revolution ----------------------------------------------------------------------


def test_regressors_add_their_terms():
    model = Model.new("beam", "phase_shift", offset_rad=0.01, per_acceleration_rad_s2_m=0.003)
    model = model.with_effect("speed_trend", linear_rad=0.02, quadratic_rad=-0.005)
    model = model.with_effect("telemetry_delay", delay_s=1e-3)
    v, a = DRIVE.speed_m_s, DRIVE.acceleration_m_s2
    wanted = 0.01 + 0.003 * a + 0.02 * v / 20 - 0.005 * (v / 20) ** 2 + 1e-3 * v / 0.3126
    assert np.allclose(model.predict(DRIVE)[:, 0], wanted, rtol=1e-12)
    length = 0.11 * np.sqrt(DRIVE.load_N / 3600.0)
    for observable, unit in (("patch_length", 1.0), ("patch_width", 0.3126)):
        told = Model.new("beam", observable).predict(DRIVE)[:, 0]
        assert np.allclose(told, length / unit, rtol=1e-12)


def test_a_form_by_load_is_the_form_of_that_load():
    form, place = BY_ID["form"], np.array([[0.05], [0.06]])
    loads, drive = (
        np.array([[3000.0], [4500.0]]),
        Drive.of(Conditions.of(2, speed_m_s=[12.0, 25.0])),
    )
    rng = np.random.default_rng(5)
    values = {p.name: float(rng.normal(0.0, p.prior[1])) for p in form.parameters if p.prior}
    both = form.pressure(values, drive, Site(loads, place, 0.3, 3600.0))
    for row, (load, half) in enumerate(zip(loads, place, strict=True)):
        own = dict(values)
        for name in (name for name in values if name.endswith("_by_load")):
            own[name] = 0.0
            own[name.removesuffix("_by_load")] += (load[0] / 3600.0 - 1.0) * values[name]
        alone = form.pressure(own, drive, Site(load[None], half[None], 0.3, 3600.0))
        np.testing.assert_allclose(both[row], alone[0], rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("carcass", ["beam", "ring"])
@pytest.mark.parametrize("observable", OBSERVABLES)
def test_every_free_parameter_of_a_new_model_changes_the_prediction(carcass, observable):
    model = Model.new(carcass, observable)
    slopes = model.linearised(DRIVE, PHI if observable in WAVEFORMS else None, model.free)[1]
    moved = np.abs(slopes).max(axis=(1, 2))
    assert [name for name, move in zip(model.free, moved, strict=True) if move == 0.0] == []


@by_id(CATALOGUE)
def test_an_effect_of_the_catalogue_is_the_same_in_another_process(effect):
    """By it predictions know which conditions it reads."""
    read = conditions_read([effect])
    assert read is not None
    assert conditions_read([pickle.loads(pickle.dumps(effect))]) == read
    other = replace(effect, mechanism="another")
    assert pickle.loads(pickle.dumps(other)) == other
    assert conditions_read([other]) is None
