"""The pictures of `compare`.

page   waveforms with the floor's band, and the residual over angle x speed and angle x time,
       whitened too
polar  measured and predicted around the wheel, and the model's contact pressure in the patch
edges  entry and exit edge close up with the floor's band, and what is left there
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.diagnosis.answer import in_unit
from tirelog.diagnosis.fitted import FormProfile, TireForm
from tirelog.errors import UsageError, refuse_unknown
from tirelog.physics.effects import Effect
from tirelog.physics.model.model import Model
from tirelog.physics.model.user_effects import FRAMES
from tirelog.plots.style import (
    COLOURS,
    EDGE,
    MICRO,
    RAW,
    SLIDE,
    by_value,
    figure_page,
    label,
    on_a_slide,
    write,
)
from tirelog.plots.turns import around_the_wheel
from tirelog.vocabulary.conditions import CONDITIONS
from tirelog.vocabulary.observables import WAVEFORMS, drawn
from tirelog.vocabulary.tables import COMPARE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tirelog.diagnosis.diagnose import Diagnosis
    from tirelog.diagnosis.fitted import FitOfLogs
    from tirelog.diagnosis.obstacle_comparison import HitResult, TransientComparison
    from tirelog.diagnosis.propose.results import Proposal
    from tirelog.diagnosis.results import Comparison, Ladder, Map


# ---- The picture of a fit: which parameters its data tell apart.


def fit_figure(fitted: FitOfLogs) -> Figure:
    """A matplotlib figure of the correlations."""
    size = 0.6 * len(fitted.found.names)
    canvas = figure_page(size + 5.5, size + 2.0)
    correlations(canvas.add_subplot(), fitted)
    return canvas


def correlations(axes: Axes, fitted: FitOfLogs) -> None:
    """The correlation of each pair of fitted parameters as colour and number, values beside."""
    found = fitted.found
    sd = np.sqrt(np.diag(found.covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        r = found.covariance / np.outer(sd, sd)
    axes.imshow(r, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    for (i, j), value in np.ndenumerate(r):
        if np.isfinite(value):
            colour = "white" if abs(value) > 0.6 else "black"
            axes.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=7, color=colour)
    labels = []
    for name, value, se in zip(found.names, found.values, found.se, strict=True):
        error = f"± {se:.2g}" if np.isfinite(se) else "(not determined)"
        labels.append(f"{name} = {value:.4g} {error} {fitted.model.parameters[name].unit}")
    places = range(len(found.names))
    axes.set_yticks(places, labels, fontsize=8)
    axes.set_xticks(places, list(found.names), fontsize=8, rotation=60, ha="right")
    axes.set_title("correlation of the fitted parameters", loc="left", fontsize=10)


# ---- The picture of `effects`: what each does to the strain.


def signatures(chosen: Sequence[Effect], path: Path) -> None:
    """Each effect's signature.

    Strain with it (at its probe) less strain without, at two speeds, coasting and braking.
    """
    drawn = [effect for effect in chosen if "strain" in effect.reaches]
    if not drawn:
        raise UsageError(
            f"{chosen[0].id} acts on {', '.join(chosen[0].reaches)}, not on strain",
            allowed="a strain effect can be drawn",
            do="choose another",
        )
    columns = min(len(drawn), 4)
    rows = -(-len(drawn) // columns)
    figure = figure_page(3.6 * columns, 2.6 * rows)
    panels = [figure.add_subplot(rows, columns, place + 1) for place in range(len(drawn))]
    for axes, effect in zip(panels, drawn, strict=True):
        _draw(axes, effect)
    lines, names = panels[0].get_legend_handles_labels()
    figure.legend(lines, names, loc="outside upper center", ncols=len(names), fontsize=8)
    write(figure, path)


def _draw(axes: Axes, effect: Effect) -> None:
    """The change of strain along the tread by one effect."""
    drives: tuple[tuple[float, float, str, dict[str, Any]], ...] = (
        (10.0, 0.0, "10 m/s", {"color": COLOURS[5], "lw": 1.2}),
        (20.0, 0.0, "20 m/s", {"color": COLOURS[0], "lw": 1.6}),
        (20.0, -3.0, "20 m/s, braking 3 m/s²", {"color": COLOURS[1], "lw": 1.2, "ls": "--"}),
    )
    told = {name: c.example for name, c in CONDITIONS.items() if c.example is not None}
    phi = np.linspace(-0.8, 0.8, 801)
    base = Model.new("beam")
    full = base.with_effect(effect)
    full = full.with_values({f"{effect.id}.{p.name}": p.probe for p in effect.parameters})
    for speed, acceleration, text, style in drives:
        conditions = Conditions.of(1, speed_m_s=speed, acceleration_m_s2=acceleration, **told)
        change = (full.predict(conditions, phi) - base.predict(conditions, phi))[0]
        axes.plot(
            1e3 * phi * base.parameters["radius_m"].value, MICRO * change, label=text, **style
        )
    axes.axvspan(-55.0, 55.0, color="0.92", zorder=0)
    axes.set_title(effect.id, fontsize=9)
    axes.set_xlabel("xi [mm], entry to exit; grey: the patch", fontsize=8)
    axes.set_ylabel("change of strain [microstrain]", fontsize=8)
    axes.tick_params(labelsize=7)


# ---- The picture of `ladder`: the error falling to the floor, step by step.


def ladder_figure(result: Ladder) -> Any:
    """A matplotlib figure of a ladder."""
    canvas = figure_page(8.0, 4.5)
    steps(canvas.add_subplot(), result)
    return canvas


def steps(axes: Any, result: Ladder) -> None:
    """Error and floor of each step that was taken, on `axes`."""
    factor, unit = drawn(result.observable, result.unit)
    taken = [s for s in result.steps if s.outcome != "not_added"]
    place = list(range(len(taken)))
    held_out = [float("nan") if s.rmse_heldout is None else s.rmse_heldout * factor for s in taken]
    axes.bar(place, held_out, width=0.6, color=COLOURS[5], label="held-out error")
    axes.plot(place, [s.rmse_fit * factor for s in taken], "k_", ms=22, label="error of the fit")
    axes.step(
        place,
        [s.noise_floor * factor for s in taken],
        where="mid",
        color=COLOURS[1],
        label="noise floor",
    )
    for x, s in zip(place, taken, strict=True):
        text = s.decision if s.p_adjusted is None else f"{s.decision}\np = {s.p_adjusted:.2g}"
        height = max(s.rmse_heldout or s.rmse_fit, s.rmse_fit, s.noise_floor)
        if x == place[-1] and result.rmse_untouched is not None:
            height = max(height, result.rmse_untouched)
        axes.annotate(
            text,
            (x, height * factor),
            xytext=(0, 7),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=8,
        )
    if result.rmse_untouched is not None:
        axes.plot(
            [place[-1]],
            [result.rmse_untouched * factor],
            "D",
            color=COLOURS[4],
            mec="black",
            ls="none",
            label="error on manoeuvres that nothing had touched",
        )
    axes.set_xticks(place, [s.effect for s in taken])
    axes.set(ylabel=f"{result.observable} error [{unit}]")
    axes.margins(y=0.2)
    axes.legend(fontsize=8)


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
    across = 4
    figure = figure_page(10.0, 2.7 * max(-(-order.size // across), 1))
    panels = figure.subplots(max(-(-order.size // across), 1), across, squeeze=False).ravel()
    phi = np.linspace(0.0, 2.0 * np.pi, 361)
    for axes in panels:
        axes.set_axis_off()
    for axes, row in zip(panels, order, strict=False):
        lobes = int(columns["lobes"][row])
        upright = 0.5 * np.pi * ("vertical" in str(columns["shape"][row]))
        out = _DRAWN * np.cos(lobes * (phi - upright)) * (lobes > 0)
        # an inextensible belt moves along itself too: v = -sin(n phi) / n
        turned = np.sin(lobes * (phi - upright))
        along = -_DRAWN * turned / lobes if lobes else np.full(phi.size, _DRAWN)
        angle = phi + along
        axes.plot(np.cos(phi), np.sin(phi), color=RAW, lw=0.8)
        axes.plot((1 + out) * np.cos(angle), (1 + out) * np.sin(angle), color=COLOURS[0], lw=1.4)
        spoke = slice(0, None, 45)
        axes.plot(
            ((1 + out) * np.cos(angle))[spoke], ((1 + out) * np.sin(angle))[spoke], ".", color="k"
        )
        axes.set_aspect("equal")
        axes.set_title(
            f"{float(columns['frequency_Hz'][row]):.1f} Hz, {columns['support'][row]}\n"
            f"{columns['shape'][row]}, {columns['direction'][row]}\n"
            f"{float(columns['share'][row]):.0%} of its energy as drawn",
            fontsize=8,
        )
    write(figure, path)


# ---- The picture of `propose`: the measured shape with its band, and what is left before and
# after.


def propose_figure(result: Proposal) -> Any:
    """A matplotlib figure of a proposal."""
    canvas = figure_page(11.0, 4.5)
    left, right = canvas.subplots(1, 2)
    shape(left, result)
    rest(right, result)
    return canvas


def shape(axes: Any, result: Proposal) -> None:
    """The best measured shape with two standard errors, on `axes`."""
    if not result.shapes:
        return
    best = result.shapes[0]
    frame = FRAMES[best.frame]
    factor, unit = (
        drawn(result.observable, result.unit) if best.acts_on == result.observable else (1.0, "")
    )
    words = {"contact_pressure": "mean pressures", "load": "N"}.get(best.acts_on, unit)
    low, high = best.values - 2.0 * best.band, best.values + 2.0 * best.band
    axes.fill_between(best.nodes, low * factor, high * factor, color=COLOURS[5], alpha=0.5, lw=0)
    axes.plot(best.nodes, best.values * factor, color=COLOURS[0])
    seen = np.abs(best.values) > 3.0 * best.band
    if seen.any():
        axes.set_xlim(best.nodes[seen][0], best.nodes[seen][-1])
        largest = 1.3 * float(np.abs(best.values[seen]).max()) * factor
        axes.set_ylim(-largest, largest)
    of = "" if frame.unit == "1" else f" [{frame.unit}]"
    axes.set(
        xlabel=f"{frame.words.removeprefix('in the ').removeprefix('along the ')}{of}",
        ylabel=f"{best.acts_on} [{words}]",
        title=f"measured shape, times {best.law}",
    )


def rest(axes: Any, result: Proposal) -> None:
    """The leading shape of what is left before and after, on `axes`."""
    factor, unit = drawn(result.observable, result.unit)
    angle = np.degrees(result.phi_rad)
    axes.plot(angle, result.leading_before * factor, color=COLOURS[1], label="before")
    axes.plot(angle, result.leading_after * factor, color=COLOURS[2], label="with the proposal")
    axes.set(xlabel="angle [deg]", ylabel=f"{result.observable} [{unit}]", title="what is left")
    axes.legend(fontsize=8)


# ---- The picture of a tire's form: pressure over the patch, stiffness over wavelength.


def form_figure(form: TireForm) -> Figure:
    """A matplotlib figure of both, each beside what the model's formulas give."""
    canvas = figure_page(9.5, 4.0)
    over_patch(canvas.add_subplot(1, 2, 1), form)
    axes, formula = canvas.add_subplot(1, 2, 2), form.stiffness.formula
    ratio = [x / formula for x in (form.stiffness.value, form.stiffness.se, formula)]
    _form_page(axes, FormProfile(form.stiffness.at, *ratio), 1e3, 1.0)
    axes.set(xscale="log", xlabel="wavelength (mm)", ylabel="stiffness over the formula's")
    return canvas


def over_patch(axes: Axes, form: TireForm) -> None:
    """The contact pressure per length of the patch, entry edge to the left."""
    _form_page(axes, form.pressure, 1e3, 1e-3)
    axes.set(xlabel="place in the patch, entry to exit (mm)", ylabel="contact pressure (N/mm)")
    axes.set_title(f"{form.load_N:.0f} N, {form.speed_m_s:.1f} m/s", loc="left", fontsize=10)
    axes.legend(fontsize=8)


def _form_page(axes: Axes, profile: FormProfile, of_place: float, of_value: float) -> None:
    """A profile with a band of two standard errors."""
    at, value, se = profile.at * of_place, profile.value * of_value, profile.se * of_value
    axes.fill_between(at, value - 2 * se, value + 2 * se, color=COLOURS[0], alpha=0.25, lw=0)
    axes.plot(at, value, color=COLOURS[0], label="this tire, ± 2 standard errors")
    axes.plot(at, profile.formula * of_value, "--", color=COLOURS[5], label="the model's formula")


# ---- The picture of `compare` on transients.
#
# A row per hit, in time (measured, predicted, missed) and in frequency (added, missed, floor).


#: hits that are drawn, and how long [s] of each
_MOST_HITS = 4
SHOWN_S = 0.25


def transient_figure(result: TransientComparison) -> Any:
    """A matplotlib figure of the first hits."""
    factor, unit = drawn(result.observable, result.unit)
    shown = result.hits[:_MOST_HITS]
    canvas = figure_page(13.0, 3.2 * len(shown) + 0.6)
    grid = canvas.add_gridspec(len(shown), 2, width_ratios=(1.7, 1.0))
    for row, hit in enumerate(shown):
        _in_time(canvas.add_subplot(grid[row, 0]), hit, factor, unit, first=row == 0)
        _in_frequency(canvas.add_subplot(grid[row, 1]), hit, factor, unit, first=row == 0)
    return canvas


def draw_transient(result: TransientComparison, path: Path) -> None:
    """Write the figure; the suffix decides the format."""
    write(transient_figure(result), path)


def _in_time(axes: Any, result: HitResult, factor: float, unit: str, *, first: bool) -> None:
    hit = result.hit
    at = hit.since_s <= SHOWN_S
    time = 1e3 * hit.since_s[at]
    axes.plot(time, factor * hit.measured[at], color=COLOURS[6], lw=0.9, label="measured")
    axes.plot(time, factor * hit.predicted[at], color=COLOURS[0], lw=0.9, label="model")
    below = factor * (hit.measured[at].min() - 1.2 * np.abs(hit.added[at]).max())
    for values, colour, words in (
        (hit.added, 7, "added by the obstacle"),
        (hit.missed, 1, "of that missed by the model"),
    ):
        axes.plot(time, below + factor * values[at], color=COLOURS[colour], lw=0.8, label=words)
    title = (
        f"{Path(result.log.log).name}, {hit.time_s:.3f} s, {hit.speed_m_s:.1f} m/s: "
        f"{100 * result.row()['covered']:.0f} % covered"
    )
    label(axes, "time since the hit [ms]", unit, title)
    if first:
        axes.legend(fontsize=7, ncols=2)


def _in_frequency(axes: Any, result: HitResult, factor: float, unit: str, *, first: bool) -> None:
    s = result.spectrum
    lines = (
        ("added", s.added, 7),
        ("missed", s.missed, 1),
        ("residual", s.residual, 0),
        ("off the obstacle", s.steady, 4),
        ("floor", s.floor, 2),
    )
    for name, squares, colour in lines:
        axes.stairs(
            factor * np.sqrt(np.maximum(squares, 0.0)),
            s.edges_Hz,
            color=COLOURS[colour],
            label=name,
        )
    axes.set_yscale("log")
    label(axes, "frequency [Hz]", f"rms in the band [{unit}]")
    if first:
        axes.legend(fontsize=7)


#: the map's colours end at this quantile of the residual, and are linear up to so many standard
#: errors, or to the noise floor
_QUANTILE = 99.9
_SIGMAS = 3.0
#: half of a close-up of an edge, in half angles of the patch; and the edge, if none is known
_CLOSE, _NO_EDGE_DEG = 0.6, 10.0


def compare_figure(result: Comparison, kind: str = "page") -> Any:
    """A matplotlib figure of a comparison, of a kind of `pictures.COMPARE`.

    UsageError: not of a number per revolution, which has no waveform.
    """
    refuse_unknown(kind, COMPARE, f"no picture is called {kind!r}", do="choose one")
    if kind != "page":
        return _of_waveforms(result, kind)

    factor, unit = drawn(result.observable, result.unit)
    canvas = figure_page(12.0, 9.5)
    grid = canvas.add_gridspec(3, 2, height_ratios=(1.1, 1.0, 1.0))
    waveforms(canvas.add_subplot(grid[0, :]), result)
    for row, (left, text) in enumerate(
        (("residual", f"residual [{unit}]"), ("whitened", "residual [standard errors]")), start=1
    ):
        for column, (map_, name) in enumerate(
            ((result.by_speed, "speed [m/s]"), (result.by_time, "time [s]"))
        ):
            axes = canvas.add_subplot(grid[row, column])
            _map(
                canvas,
                axes,
                map_,
                left,
                factor if left == "residual" else 1.0,
                result.noise_floor * factor if left == "residual" else _SIGMAS,
                text,
                name,
                result.half_angle_rad,
            )
    canvas.suptitle(
        f"held-out error {in_unit(result.rmse_heldout, factor)} {unit}, noise floor "
        f"{result.noise_floor * factor:.3g}, "
        f"excess {in_unit(result.excess_heldout, factor)}; reduced chi-square "
        f"{result.reduced_chi2:.3g}"
    )
    return canvas


def draw_compare(result: Comparison, path: Path, kind: str = "page") -> list[Path]:
    """Write the figure of a kind; the suffix decides the format.

    Of several observables the first has this path, each other one a path of its own beside it;
    these come back.
    """
    from tirelog.storage.whole import whole_file

    lead, *others = result.parts or (result,)
    beside = [path.with_stem(f"{path.stem}_{other.observable}") for other in others]
    for one, target in zip((lead, *others), (path, *beside), strict=True):
        with whole_file(target) as part:
            own = kind if one is lead or one.observable in WAVEFORMS else "page"
            compare_figure(one, own).savefig(part, format=path.suffix.lstrip(".") or "png", dpi=110)
    return beside


def _of_waveforms(result: Comparison, kind: str) -> Any:
    """A slide of the waveforms.  UsageError: the model gives a number per revolution."""
    if result.observable not in WAVEFORMS:
        raise UsageError(
            f"--plot-kind {kind} of {result.observable}, a number per revolution",
            allowed="it is allowed for waveforms: strain and radial_acceleration",
            do="leave it out",
        )
    with on_a_slide():
        made = {"polar": _polar, "edges": _edge_zoom}[kind](result)
        made.draw_without_rendering()  # while letters are large
    return made


def _polar(result: Comparison) -> Any:
    """Measured and predicted around the wheel; the contact pressure that the model has there."""
    factor, unit = drawn(result.observable, result.unit)
    waves = result.waveforms
    colours = by_value(waves.conditions.speed_m_s)
    canvas = figure_page(*SLIDE)
    grid = canvas.add_gridspec(1, 2, width_ratios=(1.25, 1.0))
    wheel = canvas.add_subplot(grid[0], projection="polar")
    zero = around_the_wheel(
        wheel,
        [
            (phi, factor * predicted, 2.0 * factor * floor, name)
            for phi, predicted, floor, name in zip(
                waves.phi_rad, waves.predicted, waves.floor, waves.labels, strict=True
            )
        ],
        colours,
        result.half_angle_rad,
        unit,
    )
    for phi, measured, colour in zip(waves.phi_rad, waves.measured, colours, strict=True):
        wheel.plot(phi, zero + factor * measured, ".", ms=4, color=colour)
    wheel.set_title(f"{result.observable}: dots measured, lines predicted")
    wheel.legend(loc="center", fontsize=9)
    patch = canvas.add_subplot(grid[1])
    radius_mm = 1e3 * result.model.values["radius_m"]
    reach = 1.5 * max(result.half_angle_rad, 0.05)
    phi = np.linspace(-reach, reach, 301)
    pressure = result.model.predict(
        waves.conditions, phi, surface="outer", observable="contact_pressure"
    )
    for line, colour in zip(1e-3 * pressure, colours, strict=True):
        patch.plot(radius_mm * phi, line, color=colour)
    edges(patch, result.half_angle_rad, radius_mm * np.pi / 180.0)
    label(patch, "ξ from the patch centre [mm]", "contact pressure, as the model has it [N/mm]")
    return canvas


def _edge_zoom(result: Comparison) -> Any:
    """Each edge of the patch close up: waveforms with two noise floors, and what is left."""
    factor, unit = drawn(result.observable, result.unit)
    waves = result.waveforms
    colours = by_value(waves.conditions.speed_m_s)
    canvas = figure_page(*SLIDE)
    panels = canvas.subplots(2, 2, sharex="col", sharey="row", height_ratios=(1.3, 1.0))
    half = np.degrees(result.half_angle_rad) or _NO_EDGE_DEG
    for (above, below), side, name in zip(panels.T, (-1.0, 1.0), ("entry", "exit"), strict=True):
        heights = []
        for i, colour in enumerate(colours):
            phi = np.degrees(waves.phi_rad[i])
            near = np.abs(phi - side * half) <= _CLOSE * half
            predicted, measured = factor * waves.predicted[i], factor * waves.measured[i]
            band = 2.0 * factor * waves.floor[i]
            above.plot(phi[near], predicted[near], color=colour, label=waves.labels[i])
            above.fill_between(
                phi[near],
                (predicted - band)[near],
                (predicted + band)[near],
                color=colour,
                alpha=0.3,
                lw=0,
            )
            above.plot(phi[near], measured[near], ".", ms=6, color=colour)
            below.fill_between(phi[near], -band[near], band[near], color=colour, alpha=0.15, lw=0)
            below.plot(phi[near], (measured - predicted)[near], ".-", ms=5, lw=1.0, color=colour)
            heights.append(phi[near])
        for axes in (above, below):
            axes.axvline(side * half, color=EDGE, lw=1.5, ls="--")
        label(above, "", f"{result.observable} [{unit}]" if side < 0 else "")
        label(below, "angle [deg]", f"measured - predicted [{unit}]" if side < 0 else "")
        above.set_title(f"{name} edge", loc="left")
    panels[0, 0].legend(loc="best", fontsize=9)
    canvas.suptitle("dots measured, lines predicted, bands two noise floors of a mean", fontsize=12)
    return canvas


def waveforms(axes: Any, result: Comparison) -> None:
    """Means of like revolutions on `axes`: measured, predicted, and the floor's band."""
    factor, unit = drawn(result.observable, result.unit)
    waves = result.waveforms
    colours = by_value(waves.conditions.speed_m_s)
    for i, name in enumerate(waves.labels):
        phi = np.rad2deg(waves.phi_rad[i])
        band = waves.floor[i] * factor
        axes.plot(
            phi, waves.predicted[i] * factor, lw=1.2, color=colours[i], label=f"model, {name}"
        )
        axes.fill_between(
            phi,
            waves.predicted[i] * factor - 2 * band,
            waves.predicted[i] * factor + 2 * band,
            color=colours[i],
            alpha=0.2,
            lw=0,
        )
        axes.plot(phi, waves.measured[i] * factor, ".", ms=2.5, color=colours[i])
    edges(axes, result.half_angle_rad)
    axes.set(
        xlabel="angle from the patch centre [deg], entry to exit",
        ylabel=f"{result.observable} [{unit}]",
    )
    if result.half_angle_rad > 0:
        reach = np.rad2deg(6.0 * result.half_angle_rad)
        axes.set_xlim(-reach, reach)
    axes.set_title(
        "dots measured (means of like revolutions), lines predicted, band two noise floors",
        fontsize=9,
    )
    axes.legend(fontsize=7)


def _map(
    canvas: Any,
    axes: Any,
    map_: Map,
    kind: str,
    factor: float,
    small: float,
    label: str,
    name: str,
    edge: float,
) -> None:
    values = getattr(map_, kind) * factor
    known = np.abs(values[np.isfinite(values)])
    largest = float(np.percentile(known, _QUANTILE)) if known.size else 1.0
    mesh = coloured(axes, map_, values, small, max(largest, small))
    if mesh is None:
        axes.plot(
            np.rad2deg(map_.phi_rad) if map_.phi_rad.size > 1 else map_.axis, np.ravel(values), "."
        )
        axes.set(xlabel=name if map_.phi_rad.size == 1 else "angle [deg]", ylabel=label)
        return
    canvas.colorbar(mesh, ax=axes, label=label, format="%g")
    edges(axes, edge)
    for begin in map_.begins:
        axes.axhline(begin, color="black", lw=1.0)
    axes.set(
        xlabel="angle [deg]",
        ylabel=f"{name}, logs one after the other" if map_.begins else name,
    )


def coloured(axes: Any, map_: Map, values: Any, small: float, largest: float) -> Any:
    """A map's `values` (k, m) in colour on `axes`; None, and nothing drawn, if it has one row.

    Linear up to `small`, by orders of magnitude beyond, so that 1 and 40 are told on one scale.
    """
    from matplotlib.colors import SymLogNorm

    if map_.axis.size < 2 or map_.phi_rad.size < 2:
        return None
    largest = largest if largest > 0.0 else 1.0
    small = min(small, largest) if small > 0.0 else largest
    return axes.pcolormesh(
        np.rad2deg(map_.phi_rad),
        map_.axis,
        values,
        cmap="RdBu_r",
        norm=SymLogNorm(linthresh=small, vmin=-largest, vmax=largest, base=10),
        shading="nearest",
    )


def edges(axes: Any, edge: float, per_degree: float = 1.0) -> None:
    """The patch's edges [rad] as lines on `axes`, of degrees or of `per_degree` of something."""
    for side in (-edge, edge):
        axes.axvline(per_degree * np.rad2deg(side), color="0.5", lw=0.7, ls="--")


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


def diagnose_figure(result: Diagnosis) -> Any:
    """A matplotlib figure of a diagnosis."""
    canvas = figure_page(13.0, 8.5)
    grid = canvas.add_gridspec(2, 3, height_ratios=(1.0, 0.9))
    before, after = _first(result.before), _first(result.after)
    if before.by_speed.phi_rad.size > 1:
        _maps(canvas, grid, before, after)
    else:
        _values(canvas.add_subplot(grid[0, :]), before, after)
    ranking(canvas.add_subplot(grid[1, :]), result)
    canvas.suptitle("\n".join(textwrap.wrap(result.sentence, _LETTERS)), fontsize=11)
    return canvas


def draw_diagnose(result: Diagnosis, path: Path) -> list[Path]:
    """Write the figure; the suffix decides the format.

    Of several observables it shows the first; the comparison of each other one has a path of its
    own beside it, and these come back.
    """
    from tirelog.storage.whole import whole_file

    with whole_file(path) as part:
        diagnose_figure(result).savefig(part, format=path.suffix.lstrip(".") or "png", dpi=110)
    others = []
    for other in result.after.parts[1:]:
        target = path.with_stem(f"{path.stem}_{other.observable}")
        draw_compare(other, target)
        others.append(target)
    return others


def _first(result: Comparison) -> Comparison:
    return result.parts[0] if result.parts else result


def _maps(canvas: Any, grid: Any, before: Comparison, after: Comparison) -> None:
    """The residual over angle and speed before and after, and its size by angle."""
    factor, unit = drawn(before.observable, before.unit)
    floor = before.noise_floor * factor
    shown = [one.by_speed.residual * factor for one in (before, after)]
    limit = np.nanmax(np.abs(shown[0])) if np.isfinite(shown[0]).any() else 1.0
    all_axes = []
    for column, (word, one, values) in enumerate(
        zip(("before", "after"), (before, after), shown, strict=True)
    ):
        axes = canvas.add_subplot(grid[0, column])
        mesh = coloured(axes, one.by_speed, values, floor, float(limit))
        edges(axes, one.half_angle_rad)
        axes.set(xlabel="angle [deg]", ylabel="speed [m/s]" if column == 0 else "")
        axes.set_title(f"{word}: {_error(one, factor)} {unit}", fontsize=10)
        all_axes.append(axes)
    if mesh is not None:
        canvas.colorbar(
            mesh,
            ax=all_axes,
            label=f"residual [{unit}]",
            location="bottom",
            format="%g",
            shrink=0.6,
        )
    axes = canvas.add_subplot(grid[0, 2])
    for word, one, colour in (("before", before, _BEFORE), ("after", after, _AFTER)):
        phi, size = _by_angle(one.by_speed)
        axes.plot(phi, size * factor, color=colour, label=word, lw=1.4)
    axes.axhline(floor, color=_FLOOR, ls="--", lw=1.0, label="noise floor of a revolution")
    edges(axes, before.half_angle_rad)
    axes.set(xlabel="angle [deg]", ylabel=f"rms of what is left [{unit}]", yscale="log")
    axes.legend(fontsize=8, loc="upper left")
    axes.set_title("means of like revolutions", fontsize=10)


def _values(axes: Any, before: Comparison, after: Comparison) -> None:
    """The residual of a number per revolution over the speed, before and after."""
    factor, unit = drawn(before.observable, before.unit)
    for word, one, colour in (("before", before, _BEFORE), ("after", after, _AFTER)):
        axes.plot(
            one.by_speed.axis,
            np.ravel(one.by_speed.residual) * factor,
            ".",
            color=colour,
            label=f"{word}: {_error(one, factor)} {unit}",
        )
    for side in (-1.0, 1.0):
        axes.axhline(side * before.noise_floor * factor, color=_FLOOR, ls="--", lw=1.0)
    axes.set(xlabel="speed [m/s]", ylabel=f"residual [{unit}]")
    axes.legend(fontsize=8)


def _by_angle(map_: Map) -> tuple[Any, Any]:
    """Angle [deg] and root mean square over the speeds, where anything is known."""
    known = np.isfinite(map_.residual)
    number = known.sum(axis=0)
    square = np.where(known, map_.residual, 0.0) ** 2
    some = number > 0
    return np.rad2deg(map_.phi_rad[some]), np.sqrt(square.sum(axis=0)[some] / number[some])


def _error(one: Comparison, factor: float) -> str:
    if one.rmse_heldout is None:
        return f"error of the fit {in_unit(one.rmse, factor)}"
    return f"held-out error {in_unit(one.rmse_heldout, factor)}"


def ranking(axes: Any, result: Diagnosis) -> None:
    """The candidates by what they remove of the excess, on `axes`; the selected ones full."""
    shown = result.effects[:_MOST_EFFECTS]
    place = np.arange(len(shown))[::-1]
    colours = [_AFTER if c.selected else COLOURS[7] for c in shown]
    axes.barh(place, [100.0 * c.excess_removed for c in shown], color=colours, height=0.65)
    for y, c in zip(place, shown, strict=True):
        p = "p < 0.001" if c.p_adjusted < 0.001 else f"p = {c.p_adjusted:.2g}"
        axes.annotate(
            f"{p}{', or ' + ', '.join(c.group) if c.group else ''}",
            (100.0 * c.excess_removed, y),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
        )
    axes.set_yticks(place, [c.effect for c in shown])
    axes.set(xlabel="of the excess removed [%]", xlim=(0.0, 118.0))
    axes.set_title("candidates; full colour: selected", fontsize=10)
