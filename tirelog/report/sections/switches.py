"""Effects on and off.

For every combination the fitted model, its waveforms, residual map and errors, made before the page
is opened.

    stacks, top model
        --cells once--> for each subset of its effects: `prepare` (fit, floor, held-out error)
        --comparison_of--> State
    States --> a section whose figures show one state, and the data by which the page's script
               changes them

A combination is fitted anew, since a model without an effect bends its other parameters to make up
for it: this is the error that the model without it really has. All numbers are those of `compare`
on that model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.errors import ModelError, UsageError, nearest
from tirelog.report.figures import (
    GREY,
    Figure,
    LogColours,
    bars,
    colour_reach,
    layout,
    packed_array,
    unpacked_array,
)
from tirelog.report.page import Section
from tirelog.report.sections.models import (
    logs_of,
    over_angle,
    residual_map,
    shown_value,
    wave_traces,
)

if TYPE_CHECKING:
    from tirelog.diagnosis.compare import Measured
    from tirelog.diagnosis.results import Comparison
    from tirelog.physics.effects import Effect
    from tirelog.physics.model.model import Model

#: effects that have a switch: 2^5 combinations are fitted
MOST_EFFECTS = 5
#: up to so many combinations are fitted from several starts
_THOROUGH = 4

Progress = Callable[[str], None]


def top_of_ladder(
    model: Model, climbed: Mapping[str, Any], catalogue: Mapping[str, Effect]
) -> Model:
    """The model with the effects that a ladder added and the values it found.

    UsageError: an effect that nobody knows.
    """
    added = [step for step in climbed["steps"] if step["outcome"] == "added"]
    for step in added:
        name = step["effect"]
        if name in [e.id for e in model.effects]:
            continue
        if name not in catalogue:
            raise UsageError(
                f"the ladder has the effect {name!r}{nearest(name, catalogue)}, which is not "
                "known here",
                do="give it with --effects",
            )
        model = model.with_effect(catalogue[name])
    values = {
        name: p["value"]
        for step in added[-1:]
        for name, p in step["parameters"].items()
        if name in model.parameters
    }
    return model.with_values(values)


def comparisons(
    measured: Measured, top: Model, names: Sequence[str], bare: Model, progress: Progress
) -> dict[int, Comparison | str]:
    """The comparison of each combination of the effects `names` of `top`, by bit mask.

    If a combination cannot be computed, why. `bare` gives the carcass's start values of
    combinations that lack an effect.
    """
    from tirelog.diagnosis.compare import comparison_of, measured_pieces, start_from

    pieces = measured_pieces(measured)
    full = (1 << len(names)) - 1
    own = {p.name: p.value for p in bare.base if p.name in top.parameters}
    found: dict[int, Comparison | str] = {}
    for mask in range(full + 1):
        model = top if mask == full else top.with_values(own)
        off = [name for bit, name in enumerate(names) if not mask & (1 << bit)]
        try:
            model = model.without_effect(*off)
            found[mask] = comparison_of(start_from(pieces, model, several=full < _THOROUGH))
        except ModelError as problem:
            found[mask] = problem.message
        progress(f"effects on and off: {mask + 1} of {full + 1} combinations fitted")
    return found


def switches(
    found: Mapping[int, Comparison | str],
    names: Sequence[str],
    command: str,
    left_out: Sequence[str] = (),
    colours: LogColours | None = None,
) -> Section | None:
    """The section with its switches, all effects on at first.

    None if the full model cannot be computed.
    """
    start = max(found)
    full = found[start]
    if isinstance(full, str):
        return None
    factor, _ = shown_value(full.observable, full.unit)
    known = [result for result in found.values() if not isinstance(result, str)]
    reach = max(colour_reach(result.by_speed.residual * factor) for result in known)
    highest = (
        max(max(result.rmse, result.rmse_heldout or 0.0, result.noise_floor) for result in known)
        * factor
    )
    title = "Residual over angle and speed, by switches"
    figures = [
        _waveforms(full, LogColours(logs_of(full)) if colours is None else colours),
        replace(residual_map("switch-map", title, full.by_speed, full, reach), half=True),
        _error(full, highest),
    ]
    states = {
        str(mask): _state(result, full, figures, _combination(mask, names))
        for mask, result in found.items()
    }
    words = [
        "Turn an effect off and see what the model without it, fitted anew, predicts and leaves."
    ]
    if left_out:
        words.append(f"Always on, for want of room: {', '.join(left_out)}.")
    return Section(
        "switches",
        "Effects on and off",
        command,
        words,
        figures,
        (),
        {"effects": list(names), "start": start, "states": states},
        folded=False,
    )


def _combination(mask: int, names: Sequence[str]) -> str:
    on = [name for bit, name in enumerate(names) if mask & (1 << bit)]
    return f"With {', '.join(on)}" if on else "Without any of these effects"


def _waveforms(full: Comparison, colours: LogColours) -> Figure:
    _, unit = shown_value(full.observable, full.unit)
    alt = (
        "Measured (points) and predicted (lines) waveforms of the chosen combination of effects; "
        "its errors stand beside the switches."
    )
    traces = wave_traces(full, colours, floors=False)
    shape = over_angle(full, f"{full.observable} [{unit}]")
    return Figure("switch-waves", "Prediction, by switches", alt, traces, shape, half=True)


def _error(full: Comparison, highest: float) -> Figure:
    """Three bars on an axis that holds those of every combination."""
    factor, unit = shown_value(full.observable, full.unit)
    values = _errors(full, factor)
    words = ["fitted", "held out", "noise floor"]
    shape = layout(
        "", f"error [{unit}]", yrange=(0.0, 1.05 * highest), height=300, showlegend=False
    )
    shape["xaxis"] = {"type": "category", "automargin": True}
    alt = (
        "Error on the data of the fit, error on held-out manoeuvres, and noise floor of the "
        "chosen combination."
    )
    return Figure(
        "switch-error", "Error, by switches", alt, [bars(words, values, "error", GREY)], shape
    )


def _errors(result: Comparison, factor: float) -> list[float]:
    """Fitted, held out (not a number if none is), noise floor."""
    held_out = np.nan if result.rmse_heldout is None else result.rmse_heldout
    return [error * factor for error in (result.rmse, held_out, result.noise_floor)]


def _state(
    result: Comparison | str, full: Comparison, figures: Sequence[Figure], combination: str
) -> dict[str, Any]:
    """What changes when the switches stand so: the text, and values by figure and trace."""
    waves, map_, error = figures
    if isinstance(result, str):
        empty = {
            f.id: {
                str(i): {key: packed_array(np.full(np.shape(unpacked_array(t[key])), np.nan))}
                for i, t in enumerate(f.traces)
                for key in _changing(f, i)
            }
            for f in figures
        }
        return {"text": f"{combination}: cannot be computed ({result}).", "figures": empty}
    from tirelog.diagnosis.results import in_unit

    factor, unit = shown_value(result.observable, result.unit)
    text = (
        f"{combination}: held-out error {in_unit(result.rmse_heldout, factor)} {unit}, noise "
        f"floor {result.noise_floor * factor:.3g}, "
        f"excess {in_unit(result.excess_heldout, factor)}, reduced chi-square "
        f"{result.reduced_chi2:.3g}."
    )
    changes: dict[str, Any] = {
        waves.id: {
            str(2 * i): {"y": packed_array(y * factor)}
            for i, y in enumerate(result.waveforms.predicted)
        },
        error.id: {"0": {"y": packed_array(_errors(result, factor))}},
    }
    key = "z" if full.by_speed.phi_rad.size > 1 else "y"
    residual = result.by_speed.residual * factor
    changes[map_.id] = {"0": {key: packed_array(residual if key == "z" else residual[:, 0])}}
    for i, y in enumerate(result.waveforms.measured):
        changes[waves.id][str(2 * i + 1)] = {"y": packed_array(y * factor)}
    return {"text": text, "figures": changes}


def _changing(figure: Figure, trace: int) -> list[str]:
    """Which values of a trace depend on the switches."""
    return ["z"] if "z" in figure.traces[trace] else ["y"]
