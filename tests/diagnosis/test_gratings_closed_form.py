"""Closed form: several gratings of one tire in one fit."""

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.diagnosis.toy import stack_of
from tirelog.data.recording import Channel, Conditions, Recording, TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.diagnosis.compare import comparison_of, measured_pieces, start_from
from tirelog.diagnosis.fitted import FitOfLogs, fit_of_logs
from tirelog.diagnosis.gratings import (
    MOST_SEARCHED,
    ROAD,
    WHEEL,
    Frame,
    frames_of,
    gathered,
    members_of,
    spread_out,
)
from tirelog.errors import UsageError
from tirelog.inference.cells.cells import ratio_name, without_ratios
from tirelog.inference.measured import measured_gratings, several_channels
from tirelog.inference.stacks.cut import Stacks, places_of
from tirelog.physics import Model
from tirelog.simulation import scenario_of, simulate, to_recording

R, F, M, NOISE = 0.3126, 3600.0, 96, 2e-6
PHI = (np.arange(M) + 0.5) * 2 * np.pi / M - np.pi
SPEEDS = np.array([9.0, 13.0, 17.0, 21.0, 24.0, 11.0, 19.0, 15.0, 10.0, 22.0])
PLACES = np.radians([10.0, 107.0, 232.0])
RATIOS = (1.0, 1.3, 0.8)
TRUTH = Model.new("beam", radius_m=R, load_N=F).with_values(
    {"patch_half_length_m": 0.061, "lever_arm_m": 4.2e-4}
)
MODEL = TRUTH.with_parameters(
    {
        name: TRUTH.parameters[name].fixed()
        for name in ("flexural_stiffness_N_m2", "foundation_stiffness_N_m2")
    }
).with_values({"lever_arm_m": 4.0e-4})


def grating(number, truth=TRUTH, added=None, place=0.0, grows=None):
    """Ten manoeuvres at a speed each; `added` strain of the road's and of the wheel's angle."""
    rng = np.random.default_rng([5, number])
    which = np.repeat(np.arange(SPEEDS.size), 5)
    n = which.size
    conditions = Conditions.of(
        n, speed_m_s=SPEEDS[which], acceleration_m_s2=0.0, time_s=np.arange(n) * 0.1, load_N=F
    )
    lever = truth.values["lever_arm_m"] * RATIOS[number % 3]
    values = truth.with_values({"lever_arm_m": lever}).predict(conditions, PHI)
    if added is not None:
        shape = added(PHI, place, RATIOS[number % 3])
        values = values + (grows(SPEEDS[which])[:, None] if grows else 1.0) * shape
    return stack_of(
        channel=f"g{number + 1}",
        radius_m=R,
        values=values + NOISE * rng.standard_normal((n, M)),
        noise=NOISE,
        conditions=conditions,
        manoeuvre=which,
        logs=("a.csv",),
        place_rad=place,
    )


def three(*added, truths=(TRUTH,) * 3, grows=None):
    """Three gratings; what is added to each, or one thing to all, and how it grows with speed."""
    each = added * 3 if len(added) == 1 else added or (None,) * 3
    return [
        [grating(i, truth, more, place, grows)]
        for i, (truth, more, place) in enumerate(zip(truths, each, PLACES, strict=True))
    ]


def fitted(stacks, model=MODEL):
    base = start_from(measured_pieces(stacks), model, several=False)
    assert base.channels
    return base


def bump(at, size=8e-06, width=0.15):
    """A bending of the belt at an angle of the road, far from the patch."""

    def shape(phi, place, ratio):
        off = np.angle(np.exp(1j * (phi - at)))
        return np.asarray(ratio * size * np.exp(-0.5 * (off / width) ** 2))

    return shape


def splice(phi, place, ratio):
    """The same fixed to the wheel, and narrower than the nodes of free shapes are apart."""
    return bump(2.0, 4e-5, 0.1)(phi + place, 0.0, ratio)


def run_out(phi, place, ratio):
    return 2e-5 * np.cos(phi + place - 0.7)


def test_each_grating_has_its_own_lever_arm():
    stacks = three()
    base = fitted(stacks)
    assert base.reduced_chi2 < 1.15
    values, se = base.model.values, {n: p.se for n, p in base.model.parameters.items()}
    for number, ratio in enumerate(RATIOS[1:], start=2):
        name = ratio_name(f"g{number}")
        assert abs(values[name] - ratio) < 4.0 * se[name] < 0.01
    assert abs(values["lever_arm_m"] - 4.2e-4) < 4.0 * se["lever_arm_m"]
    shown = comparison_of(base, stacks)
    assert [part.label for part in shown.parts] == ["g1", "g2", "g3"]
    levers = [part.model.values["lever_arm_m"] for part in shown.parts]
    np.testing.assert_allclose(levers, 4.2e-4 * np.array(RATIOS), rtol=2e-3)
    assert set(shown.model.parameters) == set(MODEL.parameters)  # a file knows of no ratio
    assert "grating" in shown.agreement
    assert list(shown.to_json()["gratings"]) == ["g1", "g2", "g3"]
    assert "." not in ratio_name("belt.1")
    # and so does `model fit`
    found, said = fit_of_logs(stacks, MODEL)
    assert said[0].startswith("3 channels are fitted together")
    assert "true errors are up to 1.7 times larger" in said[0]
    assert found.reduced_chi2 < 1.15
    answer = FitOfLogs(without_ratios(found.model), found).to_json()["parameters"]
    for number, ratio in enumerate(RATIOS[1:], start=2):
        assert answer[ratio_name(f"g{number}")]["value"] == pytest.approx(ratio, rel=0.01)


def test_run_out_is_one_wave_that_each_grating_sees_from_its_place():
    on = MODEL.with_nuisance("wheel", "on")
    base = fitted(three(run_out), on)
    shared = base.cells.shared
    assert shared is not None
    assert len(shared) == 12  # and not as many for each grating
    found = dict(zip(shared.names, base.fit.amplitudes, strict=True))
    wave = found["run-out cos 1"] - 1j * found["run-out sin 1"]
    assert wave == pytest.approx(2e-5 * np.exp(-0.7j), rel=0.05)
    assert base.reduced_chi2 < 1.2
    turned = [  # gratings that stand elsewhere see no one wave
        replace(part, place_rad=place)
        for part, place in zip(measured_pieces(three(run_out)), PLACES[::-1], strict=True)
    ]
    other = start_from(turned, on, several=False)
    assert other.reduced_chi2 > 3.0 * base.reduced_chi2


def as_square_of_speed(speed):
    """Nothing on average."""
    return np.asarray(speed**2 / np.mean(SPEEDS**2) - 1.0)


@pytest.mark.parametrize(
    ("added", "grows", "frame"),
    [
        ((None,), None, None),
        ((bump(2.0),), None, ROAD),
        ((splice,), None, WHEEL),
        ((None, bump(2.0), None), None, "g2"),
        ((bump(2.0),), as_square_of_speed, ROAD),
        ((None, bump(2.0), None), as_square_of_speed, "g2"),
    ],
)
def test_a_shape_belongs_to_road_wheel_or_one_grating(added, grows, frame):
    found = frames_of(members_of(fitted(three(*added, grows=grows))))
    assert [one.frame for one in found if one.matters] == ([frame] if frame else [])
    if frame == "g2" and grows is None:  # its mean square about its mean over that of the noise
        shape = bump(2.0)(PHI, 0.0, RATIOS[1])
        assert found[0].size == pytest.approx(float(np.var(shape)) / NOISE**2, rel=0.15)


def test_a_grating_that_no_other_agrees_with_is_left_out():
    pieces = measured_pieces(three(None, bump(-1.5), None))
    asked = gathered(pieces, MODEL)
    assert asked.found.set_apart == ("g2",)
    assert asked.found.asked == ("g1", "g3") == tuple(part.member for part in asked.pieces)
    assert asked.base.reduced_chi2 < 1.2
    said = " ".join(asked.found.sentences())
    assert "g2 alone shows" in said
    assert "not the tire" in said
    told = asked.found.to_json()["gratings"]
    assert [told[name]["contradicts"] for name in ("g1", "g2", "g3")] == [False, True, False]
    # of two gratings none is left out
    asked = gathered(pieces[:2], MODEL)
    assert asked.found.set_apart == ()
    assert "nothing tells which is right" in " ".join(asked.found.sentences())


def test_of_many_gratings_those_at_the_most_distant_angles_are_searched():
    angles = np.radians(np.arange(8) * 45.0)
    some = spread_out(measured_pieces([[grating(i, place=at)] for i, at in enumerate(angles)]))
    assert [part.member for part in some] == ["g1", "g3", "g5", "g7"]
    assert len(some) == MOST_SEARCHED
    seen = [set(part.manoeuvre.tolist()) for part in some]
    assert set().union(*seen) == set(range(SPEEDS.size))
    few = measured_pieces(three())
    assert spread_out(few) is few


# ---- where they stand ---------------------------------------------------------------------------


def recording(**angles):
    """A log with gratings, whose setup tells some of their angles."""
    text = "[tire]\nrolling_radius_m = 0.3\n"
    for name, angle in angles.items():
        text += f'[channels.{name}]\nkind = "strain"\nsource = "{name}"\n'
        text += "" if angle is None else f"angle_deg = {angle}\n"
    axis = TimeAxis.uniform(4, 1000.0, 0.0)
    channels = {
        name: Channel.of_array(name, "strain", np.zeros(4), axis, unit="1", surface="outer")
        for name in angles
    }
    return Recording("a.csv", channels, parse_setup(text, "a.toml"))


def test_gratings_without_a_place_that_a_log_lacks_or_that_are_one_are_refused():
    with pytest.raises(UsageError, match=r"no passage shows the angle of g2.*angle_deg"):
        places_of({"g1": Stacks(), "g2": Stacks()}, {})
    with pytest.raises(UsageError, match=r"no grating g7.*g1, g2"):
        measured_gratings([recording(g1=0.0, g2=90.0)], ("g1", "g7"))
    with pytest.raises(UsageError, match="one grating only"):
        measured_gratings([recording(g1=0.0)], ("all",))


def test_channels_as_they_are_typed():
    assert several_channels("g1, g2,g1") == ("g1", "g2")
    assert several_channels("all") == ("all",)
    assert several_channels("g1") == several_channels(None) == ()


@pytest.fixture(scope="module")
def driven():
    """A simulated log with gratings at 20 and 150.5 degrees."""
    channels = {
        f"g{i + 1}": {
            "kind": "strain", "sampling_rate_Hz": 1000.0, "angle_deg": angle, "noise": 1.0,
        }
        for i, angle in enumerate((20.0, 150.5))
    }  # fmt: skip
    plan = [{"duration_s": 3.0, "speed_m_s": 14.0}, {"duration_s": 2.0, "speed_m_s": 18.0}]
    log = to_recording(simulate(scenario_of({"seed": 3, "manoeuvres": plan, "channels": channels})))
    assert log.setup.channels["g2"].angle_deg == 150.5
    return log


@pytest.mark.parametrize(
    ("given", "stand", "said"),
    [
        ((20.0, 150.5), (20.0, 150.5), None),
        ((None, None), (0.0, 130.5), "g2 is 130."),
        ((None, 150.5), (20.0, 150.5), None),
        ((30.0, None), (30.0, 160.5), "g2 is 130."),
        ((20.0, 190.5), (20.0, 190.5), "g2 is 130.+ by the setup's angle_deg 170.5; the setup"),
    ],
)
def test_the_setup_goes_before_the_passages_and_is_doubted(driven, given, stand, said):
    """Of gratings whose angles [deg] are given or not: where they stand, and what is said of it."""
    channels = {
        name: replace(channel, angle_deg=angle)
        for (name, channel), angle in zip(driven.setup.channels.items(), given, strict=True)
    }
    log = replace(driven, setup=replace(driven.setup, channels=channels))
    found = measured_gratings([log], ("all",))
    angles = [part.outlines()[0].place_rad for part in (found.stacks, *found.beside)]
    np.testing.assert_allclose(np.degrees(angles), stand, atol=0.1)
    notes = [note for note in found.notes if note.startswith("g2 is ")]
    assert len(notes) == (said is not None)
    assert said is None or re.match(said, notes[0])


def test_what_a_grating_showed_alone_is_asked_again_beside_a_named_effect():
    name = "pressure_offset"
    model = MODEL.with_effect(name, offset=0.05)
    truths = (TRUTH.with_effect(name, offset=0.1),) * 3
    for added, alone in (((None,) * 3, ()), ((None, bump(-1.5), None), ("g2",))):
        pieces = measured_pieces(three(*added, truths=truths))
        asked = gathered(pieces[::2], model)
        frame = Frame("g2", float(np.var(bump(-1.5)(PHI, 0.0, RATIOS[1]))) / NOISE**2, 1e-3)
        showed = replace(asked.found, frames=(frame,), names=("g1", "g2", "g3"))
        told = replace(asked, every=pieces, found=showed).beside(asked.base, [name])
        assert told.alone == alone
        assert ("beside what is named" in " ".join(told.sentences())) == (alone == ())
