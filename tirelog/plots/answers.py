"""The pictures of answers: `compare`, `diagnose`, `ladder`, `propose`, fits, forms, effects, modes.

A comparison is waveforms, their residuals with the floor's band, and the residual over angle x
speed and angle x time, whitened too.

It is longer than others: each answer has a picture, and they share their panels.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.diagnosis.answer import in_unit, probability
from tirelog.errors import UsageError
from tirelog.physics.effects import Effect
from tirelog.physics.model.model import Model
from tirelog.physics.model.user_effects import FRAMES
from tirelog.plots.record import (
    COLOURS,
    RAW,
    Mark,
    Page,
    Panel,
    band,
    bars,
    by_value,
    dots,
    heat,
    level,
    line,
    picture,
    rows_of,
    span,
    upright,
    words,
    write,
)
from tirelog.vocabulary.conditions import CONDITIONS
from tirelog.vocabulary.observables import OBSERVABLES, WAVEFORMS, shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tirelog.diagnosis.diagnose import Diagnosis
    from tirelog.diagnosis.fitted import FitOfLogs, FormProfile, TireForm
    from tirelog.diagnosis.obstacles import Hit, TransientComparison
    from tirelog.diagnosis.propose.propose import Proposal
    from tirelog.diagnosis.results import Comparison, Ladder, Map


# ---- The picture of a fit: which parameters its data tell apart.


def fit_figure(fitted: FitOfLogs) -> Figure:
    """A matplotlib figure of the correlations."""
    size = 0.6 * len(fitted.found.names)
    return picture(Page([[correlations(fitted)]], (size + 5.5, size + 2.0)))


def correlations(fitted: FitOfLogs) -> Panel:
    """The correlation of each pair of fitted parameters as colour and number, values beside."""
    found = fitted.found
    sd = np.sqrt(np.diag(found.covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        r = found.covariance / np.outer(sd, sd)
    places = np.arange(len(found.names))
    errors = [f"± {se:.2g}" if np.isfinite(se) else "(not determined)" for se in found.se]
    return Panel(
        marks=[
            heat(places, places, r, "correlation", "signed", 1.0, 1.0),
            *(
                words(
                    f"{value:.2f}", j, i, ha="center", va="center", fontsize=7,
                    color="white" if abs(value) > 0.6 else "black",
                )
                for (i, j), value in np.ndenumerate(r)
                if np.isfinite(value)
            ),
        ],
        title="correlation of the fitted parameters",
        limits=(None, (places.size - 0.5, -0.5)),
        x_words=found.names,
        y_words=[
            f"{name} = {value:.4g} {error} {fitted.model.parameters[name].unit}"
            for name, value, error in zip(found.names, found.values, errors, strict=True)
        ],
    )  # fmt: skip


# ---- The picture of `effects`: what each does to the strain.


#: what an effect is shown under: speed [m/s], acceleration [m/s^2], words, style of the line
_DRIVES: tuple[tuple[float, float, str, dict[str, Any]], ...] = (
    (10.0, 0.0, "10 m/s", {"colour": COLOURS[5], "width": 1.2}),
    (20.0, 0.0, "20 m/s", {"colour": COLOURS[0], "width": 1.6}),
    (20.0, -3.0, "20 m/s, braking 3 m/s²", {"colour": COLOURS[1], "width": 1.2, "dash": "dash"}),
)
#: the other conditions that a model or an effect is shown under
_EXAMPLES = {name: c.example for name, c in CONDITIONS.items() if c.example is not None}


def signatures(chosen: Sequence[Effect], path: Path) -> None:
    """Each effect's signature.

    Strain with it (at its probe) less strain without, at two speeds, coasting and braking.
    """
    shown = [effect for effect in chosen if "strain" in effect.reaches]
    if not shown:
        raise UsageError(
            f"{chosen[0].id} acts on {', '.join(chosen[0].reaches)}, not on strain",
            allowed="a strain effect can be drawn",
            do="choose another",
        )
    across = min(len(shown), 4)
    rows = rows_of([_signature(effect, named=effect is shown[0]) for effect in shown], across)
    write(picture(Page(rows, (4.4 * across, 3.2 * len(rows)))), path)


def _signature(effect: Effect, *, named: bool) -> Panel:
    """The change of strain along the tread by one effect; drives in a legend if `named`."""
    base = Model.new("beam")
    full = base.with_effect(effect)
    full = full.with_values({f"{effect.id}.{p.name}": p.probe for p in effect.parameters})
    found = driven(full, "strain", effect.id, base)
    return replace(found, legend={"fontsize": 6} if named else None)


def driven(model: Model, observable: str, title: str, less: Model | None = None) -> Panel:
    """What a model predicts along the tread under a few drives, or what it has more than another.

    The patch is grey where the model prescribes it.
    """
    phi, values = np.linspace(-0.8, 0.8, 801), model.values
    factor, unit = shown(observable, "N/m" if observable == "contact_pressure" else "")
    half = 1e3 * values.get("patch_half_length_m", 0.0)
    marks, words = [span(-half, half, "0.92", zorder=0)], observable.replace("_", " ")
    for speed, acceleration, text, style in _DRIVES:
        conditions = Conditions.of(1, speed_m_s=speed, acceleration_m_s2=acceleration, **_EXAMPLES)
        wave = model.predict(conditions, phi, observable=observable)[0]
        if less is not None:
            wave = wave - less.predict(conditions, phi, observable=observable)[0]
        marks.append(line(1e3 * phi * values["radius_m"], factor * wave, text, **style))
    return Panel(
        "from the patch centre, entry to exit [mm]; grey: the patch",
        f"{'change of ' if less is not None else ''}{words} [{unit}]",
        marks,
        title,
        legend={"fontsize": 6},
    )


def model_picture(model: Model) -> Figure:
    """Waveform and contact pressure of a model, and what each of its effects adds.

    Of a number per revolution: the number over the speed. ModelError as `Model.predict`.
    """
    observable = model.observable
    if observable not in WAVEFORMS:
        speeds = np.linspace(5.0, 30.0, 26)
        values = model.predict(Conditions.of(speeds.size, speed_m_s=speeds, **_EXAMPLES))[:, 0]
        label = f"{observable.replace('_', ' ')} [{OBSERVABLES[observable].unit}]"
        only = Panel("speed [m/s]", label, [line(speeds, values)])
        return picture(Page([[only]], (6.5, 4.0)))
    panels = [driven(model, observable, f"{observable.replace('_', ' ')} of the {model.carcass}")]
    panels.append(driven(model, "contact_pressure", "contact pressure"))
    for effect in model.effects:
        panels.append(driven(model, observable, effect.id, model.without_effect(effect.id)))
    rows = rows_of(panels, 2)
    known = [
        f"{CONDITIONS[name].name} {x:g} {CONDITIONS[name].unit}" for name, x in _EXAMPLES.items()
    ]
    return picture(Page(rows, (12.0, 3.4 * len(rows)), ", ".join(known) if model.effects else ""))


# ---- The picture of `ladder`: the error falling to the floor, step by step.


def ladder_figure(result: Ladder) -> Figure:
    """A matplotlib figure of a ladder."""
    return picture(Page([[steps(result)]], (8.0, 4.5)))


def steps(result: Ladder) -> Panel:
    """Error and floor of each step that was taken."""
    return climbed_panel(result.to_json())


def climbed_panel(
    climbed: Mapping[str, Any],
    colours: Sequence[Any] = (COLOURS[5], "k", COLOURS[1], COLOURS[4]),
) -> Panel:
    """The panel of a ladder's JSON.

    `colours`: of the bars, the marks, the floor, and the reserved manoeuvres.
    """
    factor, unit = shown(climbed["observable"], climbed["unit"])
    taken = [step for step in climbed["steps"] if step["outcome"] != "not_added"]
    place, untouched = np.arange(len(taken)), climbed.get("rmse_untouched")
    held_out, fitted, floor = (
        np.array([step[name] for step in taken], float) * factor
        for name in ("rmse_heldout", "rmse_fit", "noise_floor")
    )
    marks = [
        bars(place, held_out, "held-out error", colours[0]),
        dots(place, fitted, "error of the fit", colours[1], symbol="_", size=22),
        line(place, floor, "noise floor", colours[2], drawstyle="steps-mid"),
    ]
    height = np.fmax(np.fmax(held_out, fitted), floor)
    if untouched is not None:
        height[-1] = max(height[-1], untouched * factor)
        name = "error on reserved manoeuvres"
        there = [untouched * factor]
        marks.append(dots(place[-1:], there, name, colours[3], symbol="D", mec="black"))
    for x, (step, y) in enumerate(zip(taken, height, strict=True)):
        p = step["p_adjusted"]
        chance = "" if p is None else f"\np = {probability(p, climbed['manoeuvres'])}"
        text = step["decision"] + chance.replace("= <=", "<=")
        marks.append(words(text, x, y, va="bottom", ha="center", beside=(0, 7)))
    return Panel(
        "",
        f"{climbed['observable']} error [{unit}]",
        marks,
        limits=(None, (0.0, 1.3 * float(np.nanmax(height)))),
        x_words=[step["effect"] for step in taken],
        legend={"fontsize": 8},
    )


# ---- Shapes of a tire's modes as one page: the belt's outline, and how it is pushed out and in.
#
# Rows of `model modes` --> PNG, SVG or PDF


#: modes that are drawn, the lowest ones, and their amplitude over the radius
_MOST, _DRAWN = 12, 0.15


def modes_picture(columns: Mapping[str, Sequence[Any]], path: Path) -> None:
    """Write the page to `path`: cos(n phi) outward for n lobes, the belt turned for n = 0.

    A mode is drawn as the one wave that has most of its energy; on the road it has others too.
    """
    order = np.argsort(np.asarray(columns["frequency_Hz"], float))[:_MOST]
    rows = rows_of([_mode({name: columns[name][row] for name in columns}) for row in order], 4)
    write(picture(Page(rows, (10.0, 2.7 * max(len(rows), 1)))), path)


def _mode(row: Mapping[str, Any]) -> Panel:
    """The belt of one mode, with its circle at rest."""
    lobes, phi = int(row["lobes"]), np.linspace(0.0, 2.0 * np.pi, 361)
    upright_rad = 0.5 * np.pi * ("vertical" in str(row["shape"]))
    radius = 1.0 + _DRAWN * np.cos(lobes * (phi - upright_rad)) * (lobes > 0)
    # an inextensible belt moves along itself too: v = -sin(n phi) / n
    turned = np.sin(lobes * (phi - upright_rad))
    angle = phi + (-_DRAWN * turned / lobes if lobes else np.full(phi.size, _DRAWN))
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    return Panel(
        marks=[
            line(np.cos(phi), np.sin(phi), colour=RAW, width=0.8),
            line(x, y, width=1.4),
            dots(x[::45], y[::45], colour="k"),
        ],
        title=f"{float(row['frequency_Hz']):.1f} Hz, {row['support']}\n"
        f"{row['shape']}, {row['direction']}\n{float(row['share']):.0%} of its energy as drawn",
        bare=True,
    )


# ---- The picture of `propose`: the measured shape with its band, and what is left before and
# after.


def propose_figure(result: Proposal) -> Figure:
    """A matplotlib figure of a proposal."""
    return picture(Page([[shape(result), rest(result)]], (11.0, 4.5)))


def shape(result: Proposal) -> Panel | None:
    """The best measured shape with two standard errors; None if there is none."""
    if not result.shapes:
        return None
    best = result.shapes[0]
    frame = FRAMES[best.frame]
    factor, unit = shown(result.observable, result.unit)
    values, error = best.values * factor, 2.0 * best.band * factor
    seen = np.abs(best.values) > 3.0 * best.band
    reach: tuple[Any, Any] = (None, None)
    if seen.any() and best.nodes[seen].size > 1:  # beyond it the shape is noise about nothing
        most = 1.3 * float(np.abs(values[seen]).max())
        reach = ((float(best.nodes[seen][0]), float(best.nodes[seen][-1])), (-most, most))
    along = frame.words.removeprefix("in the ").removeprefix("along the ")
    return Panel(
        f"{along} [{frame.unit}]",
        f"{best.acts_on} [{unit}]",
        [
            band(
                best.nodes, values - error, values + error, "two standard errors", COLOURS[5],
                opacity=0.5,
            ),
            line(best.nodes, values, "measured shape", COLOURS[0]),
        ],
        f"measured shape, times {best.law}",
        reach,
    )  # fmt: skip


def rest(result: Proposal) -> Panel:
    """The leading shape of the residual, before and after."""
    factor, unit = shown(result.observable, result.unit)
    angle = np.degrees(result.phi_rad)
    return Panel(
        "angle [deg]",
        f"{result.observable} [{unit}]",
        [
            line(angle, result.leading_before * factor, "before", COLOURS[1], dash="dash"),
            line(angle, result.leading_after * factor, "with the proposal", COLOURS[2]),
        ],
        "residual",
    )


# ---- The picture of a tire's form: pressure over the patch, stiffness over wavelength.


def form_figure(form: TireForm) -> Figure:
    """A matplotlib figure of both, each beside what the model's formulas give."""
    stiffness = Panel(
        "wavelength (mm)",
        "stiffness over the formula's",
        _profile(form.stiffness, 1.0 / form.stiffness.formula),
        scales=("log", "linear"),
        legend=None,
    )
    return picture(Page([[over_patch(form), stiffness]], (9.5, 4.0)))


def over_patch(form: TireForm) -> Panel:
    """The contact pressure per length of the patch, entry edge to the left."""
    return Panel(
        "from the centre of pressure, entry to exit (mm)",
        "contact pressure (N/mm)",
        _profile(form.pressure, 1e-3),
        f"{form.load_N:.0f} N, {form.speed_m_s:.1f} m/s",
    )


def _profile(profile: FormProfile, scale: Any) -> list[Mark]:
    """A profile, its values times `scale`, with a band of two standard errors."""
    at, value, se = 1e3 * profile.at, profile.value * scale, profile.se * scale
    return [
        band(at, value - 2 * se, value + 2 * se, opacity=0.25),
        line(at, value, "this tire, ± 2 standard errors"),
        line(at, profile.formula * scale, "the model's formula", COLOURS[5], dash="dash"),
    ]


# ---- The picture of `compare` on transients.
#
# A row per hit: measured and predicted, added and missed.


#: hits that are drawn, and how long [s] of each
_MOST_HITS = 4
SHOWN_S = 0.25


def draw_transient(result: TransientComparison, path: Path) -> None:
    """Write a figure of the first hits; the suffix decides the format."""
    as_shown = shown(result.observable, result.unit)
    rows = [hit_panels(hit, result.observable, *as_shown) for hit in result.hits[:_MOST_HITS]]
    write(picture(Page(rows, (11.0, 3.2 * len(rows) + 0.6))), path)


def hit_panels(hit: Hit, observable: str, factor: float, unit: str) -> list[Panel]:
    """Panels of a hit: measured and predicted, and the change beside what of it is missed."""
    thin = {"width": 0.9}
    at = hit.since_s <= SHOWN_S
    time, since = 1e3 * hit.since_s[at], "time since the hit [ms]"
    title = (
        f"{Path(hit.log.log).name}, {hit.time_s:.3f} s, {hit.speed_m_s:.1f} m/s: "
        f"{100 * hit.row()['covered']:.0f} % covered"
    )
    return [
        Panel(
            since,
            f"{observable} [{unit}]",
            [
                dots(time, factor * hit.measured[at], "measured", COLOURS[6], size=2),
                line(time, factor * hit.predicted[at], "model", COLOURS[0], **thin),
            ],
            title,
        ),
        Panel(
            since,
            f"change of {observable} [{unit}]",
            [
                line(time, factor * hit.added[at], "added by the obstacle", COLOURS[7], **thin),
                line(time, factor * hit.missed[at], "missed by the model", COLOURS[1], **thin),
            ],
        ),
    ]


# ---- The pictures of `compare`.


#: the map's colours end at this quantile of the residual, and are linear up to so many standard
#: errors, or to the noise floor
_QUANTILE = 99.5
_SIGMAS = 3.0
#: half lengths of the patch that a waveform or map shows at first
_REACH = 6.0


def compare_figure(result: Comparison) -> Figure:
    """A matplotlib figure of a comparison."""
    return picture(_residuals(result))


def _residuals(result: Comparison) -> Page:
    """Waveforms, and below them the residual and the whitened one, over speed and over time."""
    factor, unit = shown(result.observable, result.unit)
    maps = (result.by_speed, result.by_time)
    return Page(
        [
            [replace(waveforms(result), legend=None), differences(result)],
            [residual_map(map_, result) for map_ in maps],
            [residual_map(map_, result, whitened=True) for map_ in maps],
        ],
        (12.0, 9.5),
        f"held-out error {in_unit(result.rmse_heldout, factor)} {unit}, noise floor "
        f"{result.noise_floor * factor:.3g}, excess {in_unit(result.excess_heldout, factor)}; "
        f"reduced chi-square {result.reduced_chi2:.3g}",
        heights=(1.1, 1.0, 1.0),
    )


def draw_compare(result: Comparison, path: Path) -> list[Path]:
    """Write the figure; the suffix decides the format.

    Of several observables the first has this path, each other one a path of its own beside it;
    these come back.
    """
    lead, *others = result.parts or (result,)
    beside = [path.with_stem(f"{path.stem}_{other.observable}") for other in others]
    for one, target in zip((lead, *others), (path, *beside), strict=True):
        write(compare_figure(one), target)
    return beside


#: colour, dash and symbol of each mean
Looks = Sequence[tuple[Any, str, str]]


def waveforms(result: Comparison, looks: Looks | None = None) -> Panel:
    """Means of similar revolutions: measured, predicted, and two noise floors about it."""
    factor, unit = shown(result.observable, result.unit)
    waves, marks = result.waveforms, list[Mark]()
    looks = looks or _by_speed(result)
    for i, (said, (colour, dash, symbol)) in enumerate(zip(waves.labels, looks, strict=True)):
        phi, expected = np.rad2deg(waves.phi_rad[i]), waves.predicted[i] * factor
        floor, measured = 2.0 * factor * waves.floor[i], waves.measured[i] * factor
        low, high = expected - floor, expected + floor
        marks += [
            band(phi, low, high, f"_two floors, {said}", colour, opacity=0.2),
            line(phi, expected, f"model, {said}", colour, dash=dash, width=1.2),
            dots(phi, measured, f"_measured, {said}", colour, symbol=symbol, size=2.5),
        ]
    title = "dots: measured means of similar revolutions; lines: predicted"
    return over_angle(result, f"{result.observable} [{unit}]", marks, title)


def differences(result: Comparison, looks: Looks | None = None) -> Panel:
    """The same means, measured less predicted, with two noise floors."""
    factor, unit = shown(result.observable, result.unit)
    waves, marks = result.waveforms, list[Mark]()
    looks = looks or _by_speed(result)
    for i, (said, (colour, dash, _)) in enumerate(zip(waves.labels, looks, strict=True)):
        phi, floor = np.rad2deg(waves.phi_rad[i]), 2.0 * factor * waves.floor[i]
        left = factor * (waves.measured[i] - waves.predicted[i])
        marks += [
            band(phi, -floor, floor, f"_two floors, {said}", colour, opacity=0.2),
            line(phi, left, said, colour, dash=dash),
        ]
    title = "measured less predicted; bands: two noise floors"
    return over_angle(result, f"residual [{unit}]", marks, title)


def _by_speed(result: Comparison) -> Looks:
    """Each mean coloured by its speed."""
    return [(c, "solid", ".") for c in by_value(result.waveforms.conditions.speed_m_s)]


def over_angle(result: Comparison, y: str, marks: Sequence[Mark], title: str = "") -> Panel:
    """Marks over the angle [deg] near the patch, with its edges."""
    half = result.half_angle_rad
    reach = min(float(np.rad2deg(_REACH * half)), 180.0) if half > 0 else 180.0
    x = "angle from the patch centre [deg], entry to exit"
    return Panel(x, y, [*marks, *edges(half)], title, ((-reach, reach), None))


def residual_map(map_: Map, result: Comparison, *, whitened: bool = False) -> Panel:
    """The residual of a map in colour, or in standard errors; of a single row or column points."""
    factor, unit = (1.0, "standard errors") if whitened else shown(result.observable, result.unit)
    small = _SIGMAS if whitened else result.noise_floor * factor
    values = map_.whitened if whitened else map_.residual * factor
    name = {"speed_m_s": "speed [m/s]", "time_s": "time [s]"}[map_.axis_name]
    label = f"residual [{unit}]"
    if map_.axis.size < 2 or map_.phi_rad.size < 2:
        over_angle = map_.phi_rad.size > 1
        x = np.rad2deg(map_.phi_rad) if over_angle else map_.axis
        return Panel("angle [deg]" if over_angle else name, label, [dots(x, np.ravel(values))])
    largest = max(colour_reach(values), small)
    after = ", logs one after the other" if map_.begins else ""
    colours = coloured(map_, values, f"{label}\nlinear to {small:.2g}", small, largest)
    between = [level(begin) for begin in map_.begins]
    return Panel(
        "angle [deg]", f"{name}{after}", [colours, *edges(result.half_angle_rad), *between]
    )


def colour_reach(values: Any) -> float:
    """Where the colours of a map end: one odd cell does not bleach the rest."""
    known = np.abs(values[np.isfinite(values)])
    return float(np.percentile(known, _QUANTILE)) if known.size else 1.0


def coloured(map_: Map, values: Any, unit: str, small: float, largest: float) -> Mark:
    """A map's `values` (k, m) in colour over angle [deg] and its axis."""
    return heat(np.rad2deg(map_.phi_rad), map_.axis, values, unit, "signed", small, largest)


def edges(edge: float) -> list[Mark]:
    """The patch's edges [rad] as lines over the angle [deg]; 0: none."""
    sides = (-edge, edge) if edge > 0.0 else ()
    return upright(np.rad2deg(sides), dash="dash")


# ---- The picture of `diagnose`: what the model leaves before and after, at one scale, and the
# ranking.
#
# residual before | residual after | its size by angle, before and after, beside the floor
# the candidates by what they remove, with their p and strength


#: candidates that the ranking shows
_MOST_EFFECTS = 10
#: letters in a line of the verdict above the picture
_LETTERS = 130
_BEFORE, _AFTER, _FLOOR = COLOURS[1], COLOURS[0], COLOURS[6]


def diagnose_figure(result: Diagnosis) -> Figure:
    """A matplotlib figure of a diagnosis."""
    both = [one.parts[0] if one.parts else one for one in (result.before, result.after)]
    return picture(
        Page(
            [before_and_after(both), [ranking(result)]],
            (13.0, 8.5),
            "\n".join(textwrap.wrap(result.sentence, _LETTERS)),
            heights=(1.0, 0.9),
            bar=f"residual [{shown(both[0].observable, both[0].unit)[1]}]",
            bar_style={"location": "bottom", "format": "%g", "shrink": 0.6},
        )
    )


def draw_diagnose(result: Diagnosis, path: Path) -> list[Path]:
    """Write the figure; the suffix decides the format.

    Of several observables it shows the first; the comparison of each other one has a path of its
    own beside it, and these come back.
    """
    write(diagnose_figure(result), path)
    others = {
        path.with_stem(f"{path.stem}_{one.observable}"): one for one in result.after.parts[1:]
    }
    for target, other in others.items():
        draw_compare(other, target)
    return list(others)


def before_and_after(both: Sequence[Comparison]) -> list[Panel]:
    """The residual over angle and speed of each model at one scale, and its size by angle.

    Of a number per revolution its residual over the speed.
    """
    factor, unit = shown(both[0].observable, both[0].unit)
    floor = both[0].noise_floor * factor
    residuals = [one.by_speed.residual * factor for one in both]
    panels, sizes, values = list[Panel](), list[Mark](), list[Mark]()
    for word, one, left, colour in zip(
        ("before", "after"), both, residuals, (_BEFORE, _AFTER), strict=False
    ):
        error = "error of the fit" if one.rmse_heldout is None else "held-out error"
        rmse = one.rmse if one.rmse_heldout is None else one.rmse_heldout
        title, map_ = f"{word}: {error} {in_unit(rmse, factor)} {unit}", one.by_speed
        values.append(dots(map_.axis, left[:, 0], title, colour))
        mesh = coloured(map_, left, f"residual [{unit}]", floor, colour_reach(residuals[0]))
        marks = [*[mesh] * (map_.axis.size > 1), *edges(one.half_angle_rad)]
        panels.append(Panel("angle [deg]", "speed [m/s]", marks, title))
        some = np.isfinite(left).any(axis=0)
        phi, size = np.rad2deg(map_.phi_rad), np.sqrt(np.nanmean(left[:, some] ** 2, 0))
        sizes.append(line(phi[some], size, word, colour, width=1.4))
    if both[0].by_speed.phi_rad.size < 2:
        values += [level(y, "", _FLOOR, dash="dash") for y in (-floor, floor)]
        return [Panel("speed [m/s]", f"residual [{unit}]", values)]
    sizes.append(level(floor, "noise floor of a revolution", _FLOOR, dash="dash"))
    return [
        *panels,
        Panel(
            "angle [deg]",
            f"rms of the residual [{unit}]",
            [*sizes, *edges(both[0].half_angle_rad)],
            "means of similar revolutions",
            scales=("linear", "log"),
            # below the axes: what is large may lie anywhere in them
            legend={
                "fontsize": 7,
                "loc": "upper center",
                "bbox_to_anchor": (0.5, -0.17),
                "ncols": 3,
                "columnspacing": 1.0,
            },
        ),
    ]


def ranking(result: Diagnosis) -> Panel:
    """The candidates by what they remove of the excess, best on top; the selected ones full."""
    return ranked_panel(result.effects[:_MOST_EFFECTS])


def ranked_panel(
    shown: Sequence[Any],
    errors: Mapping[str, float] | None = None,
    colours: Sequence[Any] = (_AFTER, COLOURS[7]),
) -> Panel:
    """The panel of candidates; `errors` of the shares, `colours` of selected and others."""
    removed = 100.0 * np.array([c.excess_removed for c in shown])
    error = 100.0 * np.array([(errors or {}).get(c.effect, np.nan) for c in shown])
    picked = np.array([bool(c.selected) for c in shown], dtype=bool)
    place = np.arange(len(shown))
    marks = [
        bars(place[some], removed[some], name, colour, across=True, error=error[some])
        for some, name, colour in zip(
            (picked, ~picked), ("selected", "not selected"), colours, strict=True
        )
        if some.any()
    ]
    for y, c in enumerate(shown):
        p = "p < 0.001" if c.p_adjusted < 0.001 else f"p = {c.p_adjusted:.2g}"
        also = f", or {', '.join(c.group)}" if c.group else ""
        marks.append(words(f"{p}{also}", 100.0 * c.excess_removed, y, va="center", beside=(4, 0)))
    return Panel(
        "share of the excess removed [%]",
        "",
        marks,
        "candidates; full colour: selected",
        ((0.0, 118.0), (max(len(shown), 1) - 0.5, -0.5)),
        y_words=[c.effect for c in shown],
        legend=None,
    )


# ---- The picture of an answer's JSON: what its file holds.


def answer_picture(fields: Mapping[str, Any]) -> Figure:
    """The figure of an answer from its JSON, of `compare`, `diagnose`, `ladder` or `form`.

    It has no waveforms and maps: these are in the answer, not in its JSON. ValueError: the JSON is
    of no answer that has a picture.
    """
    if "steps" in fields:
        return picture(Page([[climbed_panel(fields)]], (8.0, 4.5)))
    if "pressure" in fields and "stiffness" in fields:
        profiles = {name: _profile_of(fields[name]) for name in ("pressure", "stiffness")}
        form: Any = SimpleNamespace(**{**fields, **profiles})
        return form_figure(form)
    if "verdict" in fields and "effects" in fields:
        candidates = [SimpleNamespace(**one) for one in fields["effects"]]
        panels = [ranked_panel(candidates[:_MOST_EFFECTS]), _errors(fields)]
        title = "\n".join(textwrap.wrap(fields["sentence"], _LETTERS))
        return picture(Page([panels], (13.0, 5.5), title))
    if "extra_errors" in fields:
        return picture(Page([[_extra(fields), _errors(fields)]], (13.0, 5.5)))
    raise ValueError("it is of no answer that has a picture")


def _profile_of(fields: Mapping[str, Any]) -> SimpleNamespace:
    """A profile of a form's JSON, with arrays."""
    return SimpleNamespace(**{name: np.array(values, float) for name, values in fields.items()})


def _errors(fields: Mapping[str, Any]) -> Panel:
    """The errors of an answer's JSON over its noise floor."""
    known = {
        said: fields[name] / fields["noise_floor"]
        for name, said in (
            ("rmse", "of the fit"),
            ("rmse_heldout", "held out"),
            ("rmse_heldout_before", "held out, before"),
            ("rmse_heldout_after", "held out, after"),
        )
        if fields.get(name) is not None
    }
    return Panel(
        "",
        "error over the noise floor",
        [bars(np.arange(len(known)), list(known.values())), level(1.0, "noise floor", _FLOOR)],
        x_words=list(known),
    )


def _extra(fields: Mapping[str, Any]) -> Panel:
    """The error that a model adds at least, by where and when, the first on top."""
    observable = fields["observable"].split(" ")[0]
    worst = [
        row
        for row in fields["extra_errors"]
        if row["of"] != "parameter" and row["size"] is not None and row["observable"] == observable
    ]
    factor, unit = shown(observable, fields["unit"])
    return Panel(
        f"error in {observable.replace('_', ' ')} that the model adds at least [{unit}]",
        "",
        [bars(np.arange(len(worst)), [factor * row["size"] for row in worst], across=True)],
        limits=(None, (len(worst) - 0.5, -0.5)),
        y_words=[f"{row['of']} {row['name']}" for row in worst],
    )
