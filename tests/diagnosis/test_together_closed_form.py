"""Closed form: several observables in one fit are what each alone says, put together."""

from dataclasses import replace
from itertools import chain

import numpy as np
import pytest

from tests.diagnosis.toy import stack_of
from tirelog.cli.pages import print_answer
from tirelog.data.recording import Channel, Conditions, Recording, TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.diagnosis.candidates.assessment import at_noise_floor
from tirelog.diagnosis.compare import compare, comparison_of, measured_pieces, start_from
from tirelog.diagnosis.results import agreement_sentence, contributions
from tirelog.diagnosis.rules import QUIET_CHI2
from tirelog.errors import UsageError
from tirelog.inference.base import bases_by_observable, refit
from tirelog.inference.cells.cells import one_drive
from tirelog.inference.cells.pieces import pieces_of
from tirelog.inference.measured import measured_together
from tirelog.physics import Model
from tirelog.physics.model.file import as_toml, parse_model

R, F, M = 0.3126, 3600.0, 96
PHI = (np.arange(M) + 0.5) * 2 * np.pi / M - np.pi
SPEEDS = np.array([9.0, 13.0, 17.0, 21.0, 24.0, 11.0, 19.0, 15.0])
NOISE = {"strain": 5e-6, "radial_acceleration": 2.0, "phase_shift": 1e-3}
ALL = tuple(NOISE)
TRUTH = Model.new("beam", ALL, radius_m=R, load_N=F).with_values(
    {
        "flexural_stiffness_N_m2": 5.2,
        "foundation_stiffness_N_m2": 2.5e6,
        "patch_half_length_m": 0.061,
        "lever_arm_m": 4.2e-4,
        "offset_rad": 0.01,
        "per_acceleration_rad_s2_m": 0.005,
    }
)


def measured(observable, seed, truth=TRUTH, repeats=5):
    """Eight manoeuvres at a speed each, of the observable with noise."""
    rng = np.random.default_rng([seed, ALL.index(observable)])
    which = np.repeat(np.arange(SPEEDS.size), repeats)
    n = which.size
    m = 1 if observable == "phase_shift" else M
    conditions = Conditions.of(
        n,
        speed_m_s=SPEEDS[which],
        # a waveform of a wheel that speeds up is none at one speed
        acceleration_m_s2=0.0 if m > 1 else np.where(which % 2, 1.0, -1.0),
        time_s=np.arange(n) * 0.1,
        load_N=F,
    )
    angles = PHI if m > 1 else None
    values = truth.predict(conditions, angles, observable=observable)
    return stack_of(
        observable=observable,
        channel=observable[0],
        radius_m=R,
        values=values + NOISE[observable] * rng.standard_normal((n, m)),
        noise=NOISE[observable],
        conditions=conditions,
        manoeuvre=which,
        logs=("a.csv",),
    )


def several(seed, *names, **truths):
    return [[measured(o, seed, truths.get(o, TRUTH))] for o in names or ALL]


def compared(stacks, model):
    """The comparison, from the model's own values: no other start is tried."""
    base = start_from(measured_pieces(stacks), model, several=False)
    return comparison_of(base, stacks)


def only(model, *free):
    """The model with these parameters free and no other."""
    held = {n: p if n in free else p.fixed() for n, p in model.parameters.items()}
    return model.with_parameters(held)


def test_a_manoeuvre_is_one_however_many_sensors_saw_it():
    strain, other = pieces_of(measured("strain", 2)), pieces_of(measured("phase_shift", 2))
    # the second finds its manoeuvres a little later, and two of them as one
    late = replace(other.conditions, time_s=other.conditions.time_s + 0.15)
    merged = np.where(other.manoeuvre == 3, 2, other.manoeuvre)
    lead, follows = one_drive([strain, replace(other, conditions=late, manoeuvre=merged)])
    np.testing.assert_array_equal(lead.manoeuvre, strain.manoeuvre)
    alike = follows.manoeuvre == other.manoeuvre
    assert alike[merged == other.manoeuvre].all()
    assert set(follows.manoeuvre[~alike]) <= {2, 3}
    alone = replace(other, logs=("b.csv",))
    # a log that the first does not have: its own, but the same in those that have it
    _, second, third = one_drive([strain, alone, alone])
    assert not set(second.manoeuvre) & set(strain.manoeuvre)
    np.testing.assert_array_equal(second.manoeuvre, third.manoeuvre)


def test_what_each_observable_alone_says_is_weighed_by_what_it_knows():
    """One number, known by two: the mean by inverse variances, and their difference in errors."""
    name = "foundation_stiffness_N_m2"
    told = {}
    for observable in ALL[:2]:
        model = only(Model.new("beam", observable).with_values(TRUTH_OF(observable)), name)
        found = compared([measured(observable, 5)], model)
        told[observable] = (found.parameters[name]["value"], found.parameters[name]["se"])
    pair = only(Model.new("beam", ALL[:2]).with_values(TRUTH_OF(*ALL[:2])), name)
    both = compared(several(5, *ALL[:2]), pair)
    (a, sa), (b, sb) = told.values()
    mean = (a / sa**2 + b / sb**2) / (1 / sa**2 + 1 / sb**2)
    assert both.parameters[name]["value"] == pytest.approx(mean, abs=0.1 * min(sa, sb))
    assert both.parameters[name]["se"] == pytest.approx((sa**-2 + sb**-2) ** -0.5, rel=0.08)
    of_strain, of_other = both.contributions
    assert of_strain.error_without[name] == pytest.approx(sb, rel=0.08)
    assert of_other.error_without[name] == pytest.approx(sa, rel=0.08)
    assert of_strain.chi2 == pytest.approx((a - b) ** 2 / (sa**2 + sb**2), rel=0.2, abs=0.1)
    assert of_strain.freedom == of_other.freedom == 1


def TRUTH_OF(*observables):
    known = Model.new("beam", observables).parameters
    return {name: value for name, value in TRUTH.values.items() if name in known}


def test_observables_that_agree_are_said_to_and_their_chi_square_is_as_chance_has_it():
    chi2, freedom = 0.0, 0
    for seed in range(100, 103):
        pieces = measured_pieces(several(seed, *ALL[:2]))
        base = start_from(pieces, replace(TRUTH, beside=ALL[1:2]), several=False)
        found = contributions(base)
        assert not any(one.contradicts for one in found)
        assert agreement_sentence(found, {}).startswith("The observables agree")
        assert abs(base.reduced_chi2 - 1.0) < 0.15
        chi2, freedom = chi2 + found[0].chi2, freedom + found[0].freedom
    # of chi-square: its mean, and its standard deviation
    assert freedom >= 4
    assert abs(chi2 - freedom) < 3.0 * np.sqrt(2.0 * freedom)


def test_observables_of_two_tires_contradict_each_other_and_it_is_said_how():
    other = TRUTH.with_values({"foundation_stiffness_N_m2": 2.0e6})
    found = compared(several(7, radial_acceleration=other), TRUTH)
    by_name = {one.observable: one for one in found.contributions}
    assert by_name["strain"].contradicts
    assert by_name["radial_acceleration"].contradicts
    assert not by_name["phase_shift"].contradicts
    assert by_name["phase_shift"].freedom == 0
    assert "radial_acceleration contradicts the others" in found.agreement
    pulls = {pull["parameter"]: pull for pull in by_name["strain"].pulls}
    stiffness = pulls["foundation_stiffness_N_m2"]
    assert stiffness["sigmas"] > 3.0
    assert stiffness["alone"] > stiffness["others"]


def test_each_has_its_own_errors_in_its_own_unit_and_all_are_in_floors(capsys):
    found = compared(several(3), TRUTH)
    assert found.observable == "strain + radial_acceleration + phase_shift"
    assert found.unit == "noise floors"
    assert found.noise_floor == pytest.approx(1.0)
    assert found.manoeuvres == SPEEDS.size
    assert found.revolutions == 3 * 5 * SPEEDS.size
    for part in found.parts:
        assert part.noise_floor == pytest.approx(NOISE[part.observable], rel=0.25)
        # level and force take two of the forty values of a phase shift
        left = np.sqrt(1.0 - 2.0 / (5 * SPEEDS.size) * (part.observable == "phase_shift"))
        assert part.rmse == pytest.approx(left * part.noise_floor, rel=0.05)
    told = found.to_json()
    assert set(told["observables"]) == set(ALL)
    assert {row["observable"] for row in chain(*found.by("regime"))} == set(ALL)
    print_answer(found.page())
    page = " ".join(capsys.readouterr().out.split())
    assert found.agreement in page
    assert "fitted together, in noise floors" in page
    assert all(f"{name} in " in page for name in ALL)
    rows = list(chain(*found.by("revolution")))
    assert len(rows) == found.revolutions
    assert all(row["rmse"] > 0.0 for row in rows)


def test_one_observable_above_its_floor_is_not_hidden_by_two_at_theirs():
    """A chi-square of 1.2 over all would pass for the floor; one has more than chance adds."""
    base = start_from(measured_pieces(several(12)), TRUTH, several=False)
    assert at_noise_floor(base, base.floor.square)
    first, second, third = base.channels
    # what no parameter of the model can follow, other in each manoeuvre
    wave = 0.35 * base.cells.scales[1] * np.sin(9.0 * second.cells.phi)
    values = second.cells.values + wave * np.where(second.cells.manoeuvre % 2, 1, -1)[:, None]
    second = replace(second, cells=replace(second.cells, values=values))
    worse = refit(replace(base, channels=(first, second, third)), base.model)
    assert worse.reduced_chi2 < QUIET_CHI2
    strain, acceleration, _ = bases_by_observable(worse)
    limit = QUIET_CHI2 + 2.0 * np.sqrt(2.0 / acceleration.fit.freedom)
    assert strain.reduced_chi2 < QUIET_CHI2
    assert acceleration.reduced_chi2 > limit
    assert not at_noise_floor(worse, worse.floor.square)


def test_held_out_means_left_out_of_all_observables():
    base = start_from(measured_pieces(several(9)), TRUTH, several=False)
    by_all = bases_by_observable(base, held_by_all=True)
    assert all(part.held_white.shape == (SPEEDS.size,) for part in by_all)
    whole = np.sum([part.held_white for part in by_all], axis=0)
    np.testing.assert_allclose(whole, base.held_white, rtol=1e-9)


def test_one_observable_in_a_list_is_that_observable():
    assert Model.new("ring", ["strain"]) == Model.new("ring", "strain")
    text = as_toml(TRUTH)
    assert 'observable = ["strain", "radial_acceleration", "phase_shift"]' in text
    again = parse_model(text)
    assert again.observables == ALL
    assert again.values == TRUTH.values
    assert again.free == TRUTH.free


def test_an_observable_that_no_log_measures_is_named_with_what_it_needs():
    axis = TimeAxis.uniform(10, 100.0)
    channel = Channel.of_array("e", "signal", np.zeros(10), axis)
    text = '[tire]\nunloaded_radius_m = 0.3\n[channels.e]\nkind = "signal"\nsource = "e"\n'
    recording = Recording("log", {"e": channel}, parse_setup(text))
    with pytest.raises(UsageError, match="no log measures phase_shift") as refused:
        measured_together([recording], ("phase_shift",))
    assert "radial_acceleration and wheel_encoder" in str(refused.value)


def test_logs_of_other_observables_are_refused():
    with pytest.raises(UsageError, match=r"predicts strain, the log gives strain . radial"):
        compare(several(11, *ALL[:2]), Model.new("beam", "strain"))
