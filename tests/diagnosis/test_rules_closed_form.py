"""Closed form: the table of verdicts, each rule by hand, and sentences that go with them."""

from types import SimpleNamespace

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.diagnosis.answer import FIRST_CHECK, not_varied, sentence_of
from tirelog.diagnosis.candidates import naming
from tirelog.diagnosis.candidates.assessment import Variant, at_noise_floor
from tirelog.diagnosis.candidates.naming import Refitted, removed_by, worth_it
from tirelog.diagnosis.candidates.nuisances import alike_sentences
from tirelog.diagnosis.rules import verdict_of
from tirelog.physics.effects import BY_ID

NAMED = {"named": 1, "share": 1.0} | dict.fromkeys(("few", "rest", "alike", "repeats", "quiet"), 0)


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({}, "missing"),
        ({"alike": True}, "ambiguous"),
        ({"rest": True, "alike": True}, "partial"),
        ({"share": 0.89}, "partial"),
        ({"share": 0.69}, "unknown"),
        ({"named": 0, "share": 0.0, "repeats": True, "quiet": True}, "unknown"),
        ({"named": 0, "share": 0.0, "quiet": True}, "nothing_missing"),
        ({"named": 0, "share": 0.0}, "scatter"),
        ({"few": True, "quiet": True}, "too_few"),
    ],
)
def test_verdict(changes, verdict):
    assert verdict_of(NAMED | changes) == verdict


@pytest.mark.parametrize(("chi2", "freedom", "said"), [
    (1.36, 64.0, True), (1.36, 17000.0, False), (1.19, 17000.0, True), (1.6, 64.0, False),
])  # fmt: skip
def test_a_chi_square_of_few_values_is_quiet_as_far_as_chance_goes(chi2, freedom, said):
    """1.2 and two of its standard deviations, sqrt(2 / freedom): 1.55 of 64 values."""
    base = SimpleNamespace(
        channels=(),
        reduced_chi2=chi2,
        fit=SimpleNamespace(freedom=freedom),
        square_held=1.0,
        of_errors=(0.0, 0.0),
    )
    assert at_noise_floor(base, 1.0) is said


#: as much of a diagnosis as its sentence needs
FACTS = {
    "selected": (), "share": 0.0, "beside": (), "suspects": (), "before": 1.0, "after": 1.0,
    "floor": 1.0, "total": 0.0, "explained": 0.9, "enough": 0.7, "manoeuvres": 20, "chi2": 1.4,
    "observable": "strain", "unit": "strain", "groups": (), "or_nuisance": (), "shares": {},
    "scatter": None, "unexplained": {"significant": False}, "unestablished": (),
    "taken": (0.0, []),
}  # fmt: skip


SCATTER = {"size": 1e-7, "like_load": False, "follows": "", "grows": True, "together": ()}
DRIFT = "a drift (baseline along each log 84 ± 0.1 microstrain)"
RADIUS = "another rolling radius (radius level 1 ± 0.1 %)"
TOO_SMALL = {"scatter": SCATTER, "unexplained": {"significant": True}, "before": 1.02}


@pytest.mark.parametrize(
    ("verdict", "facts", "said", "not_said"),
    [
        ("nothing_missing", {}, "leaves is the noise floor.", "held out"),
        ("nothing_missing", {"before": 1.2544}, "1.12 floors", "repeat"),
        ("nothing_missing", {"taken": (0.9912, [DRIFT])},
         f"A{DRIFT[1:]} explains 99.1 % of the excess; nothing else is missing that these data "
         "could show.", "repeat"),
        ("scatter", {"taken": (0.9, [DRIFT, RADIUS]), "scatter": SCATTER},
         f"{DRIFT[2:]} and {RADIUS} explain 90.0 % of the excess. What is left does not repeat",
         "load"),
        ("scatter", {"before": 1.02, "scatter": {**SCATTER, "like_load": True}},
         "does not repeat", "but is too small"),
        ("scatter", TOO_SMALL, "repeats, but is too small to matter", "does not repeat"),
    ],
)  # fmt: skip
def test_the_sentence_of_a_verdict_that_names_nothing(verdict, facts, said, not_said):
    sentence = sentence_of({**FACTS, "verdict": verdict, **facts})
    assert said in sentence
    assert not_said not in sentence.replace(FIRST_CHECK, "")


@pytest.mark.parametrize(
    ("name", "share", "said"),
    [
        ("wear", 0.99, "wear would explain 99.0 % of the excess, but its strength does not"),
        ("aero_load", 0.99, "aero_load would explain 99.0 % of the excess, but that is not beyond"),
        ("wear", 0.3, "No effect of the catalogue explains it; the nearest, wear, explains 30.0"),
    ],
)
def test_the_nearest_effect_is_said_and_why_it_is_not_named(name, share, said):
    left = {"nearest_effect": name, "nearest_share": share}
    facts = {**FACTS, "verdict": "unknown", "before": 5.0, "unexplained": left}
    assert said in sentence_of({**facts, "unestablished": ("wear",)})


@pytest.mark.parametrize(("measured", "parted"), [(np.nan, "measured temperature"), (300.0, "")])
def test_a_nuisance_and_an_effect_that_do_nearly_the_same_are_told(measured, parted):
    conditions = SimpleNamespace(temperature_K=np.full(3, measured))
    base = SimpleNamespace(cells=SimpleNamespace(conditions=conditions), channels=())
    pair = [("drift", "thermal_drift")]
    (taken,) = alike_sentences(pair, (), ["drift"], base)
    assert taken.startswith("In place of a drift, thermal_drift would do nearly as well")
    assert parted in taken
    assert ("measured temperature" in taken) == bool(parted)
    (named,) = alike_sentences(pair, ("thermal_drift",), [], base)
    assert named.startswith("In place of thermal_drift, a drift would do nearly as well")
    assert alike_sentences(pair, (), [], base) == []


class PlainOfOne(SimpleNamespace):
    """A metric of size in which every cell weighs one."""

    def __call__(self, values):
        return values


def base_of(prediction, held_plain, held_white, chi2=8.0):
    """As much of a base as its size needs: four manoeuvres of one cell each, a floor of one."""
    return SimpleNamespace(
        plain=PlainOfOne(weight=4.0),
        fit=SimpleNamespace(prediction=prediction, beside=np.zeros((4, 2)), freedom=8.0),
        noise_chi2=chi2,
        held_plain=np.array(held_plain),
        held_white=np.array(held_white),
        floor=SimpleNamespace(square=1.0),
        square_held=np.mean(held_plain),
        share=lambda removed: removed / (np.mean(held_plain) - 1.0),
    )


def test_size_is_what_held_out_errors_tell_and_what_changes_where_they_do_not():
    surely = [40.0, 41.0, 39.0, 40.0]
    before = base_of(np.zeros((4, 2)), [9.0, 9.0, 9.0, 9.0], surely, chi2=108.0)
    changed = np.array([[0.5, 0.5]] * 4)
    told = base_of(changed, [8.0, 8.1, 7.9, 8.0], [2.0] * 4)
    assert removed_by(before, told, sure=True) == (1.0, False)
    # manoeuvres scatter by nine times what an effect does: the change itself is its size
    scattered = base_of(changed, [1.0, 17.5, 2.0, 16.5], [2.0] * 4)
    size, by_size = removed_by(before, scattered, sure=True)
    assert by_size
    assert size == pytest.approx(0.5)
    assert removed_by(before, scattered, sure=False) == (pytest.approx(-0.25), False)
    assert worth_it(before, scattered, p=1e-4)
    assert not worth_it(before, scattered, p=0.005)
    # and a change that leaves most of chi-square's excess is that of loads that scatter
    by_load = base_of(changed, [1.0, 17.5, 2.0, 16.5], [2.0] * 4, chi2=69.0)
    assert not worth_it(before, by_load, p=1e-4)
    # a change that the held-out errors rule out is none
    worse = base_of(changed, [18.9, 19.0, 19.1, 19.0], [2.0] * 4)
    assert removed_by(before, worse, sure=True)[0] < -2.0


#: what follows the load, the water depth and the speed
FOLLOWING = [BY_ID["stiffening"], BY_ID["water_film"], BY_ID["viscous_damping"]]
PUMPED = "Constant: inflation pressure 220000 Pa. Effects that follow them (inflation)"


@pytest.mark.parametrize(
    ("known", "effects", "said"),
    [
        ({"load_N": 3434.0, "water_depth_mm": np.nan}, FOLLOWING,
         "Constant: load 3434 N; not known: water depth. Effects that follow them (stiffening, "
         "water_film)"),
        ({"load_N": [3000.0, 3100.0, 3300.0, 3434.0], "water_depth_mm": [0.0, 0.0, 0.0, 1.0]},
         FOLLOWING, ""),
        ({"load_N": [3400.0, 3410.0, 3420.0, 3434.0]}, FOLLOWING[:1], "Constant: load"),
        ({}, [BY_ID["inflation"]], PUMPED),
    ],
)  # fmt: skip
def test_what_is_the_same_or_unknown_and_followed_is_said(known, effects, said):
    usual = {"inflation_pressure_Pa": 2.2e5, "distance_km": 100.0, "water_depth_mm": 0.5}
    drive = {name: np.array(values) for name, values in (usual | known).items()}
    found = not_varied(Conditions.of(4, **drive), effects)
    assert found.startswith(said)
    assert bool(found) == bool(said)


@pytest.mark.parametrize(("own_p", "named"), [(0.005, "wear"), (0.4, None)])
def test_a_name_needs_a_p_of_its_own(monkeypatch, own_p, named):
    """`wear` leaves least, and `traction` alarms: its alarm is no evidence for wear."""

    def variant(name, p):
        numbers = {"statistic": 9.0, "p": p, "gain": 5.0, "gain_error": 1.0, "removed": 3.0}
        return Variant(BY_ID[name], ("amplitude",), {}, np.zeros((0, 0, 0)), False, **numbers)

    gains = np.r_[np.ones(6), -0.2, -0.2]
    before, after = np.full(8, 2.0), np.full(8, 2.0) - gains
    base = base_of(np.zeros((4, 2)), before, before)
    base.excess = 3.0
    with_wear = base_of(np.zeros((4, 2)), after, after)
    known = [variant("wear", own_p), variant("traction", 0.001)], {}
    refitted = [Refitted(**vars(known[0][0]), base=with_wear)]
    monkeypatch.setattr(naming, "contend", lambda *given: refitted)
    monkeypatch.setattr(naming, "group_of", lambda contenders: ())
    step = naming.next_step(base, (), known)
    assert (step.named.id if step.named else None) == named
