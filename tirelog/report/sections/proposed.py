"""The section of what `propose` wrote down: formulas or a measured shape, and how well they do.

Proposal --> sentence, formulas with their numbers, errors on locked manoeuvres, two figures, the
command that writes the model file
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tirelog.physics.model.own.empirical import FRAMES
from tirelog.report.figures import GREY, INK, Figure, band, layout, line
from tirelog.report.page import PageTable, Section
from tirelog.report.sections.models import ANGLE, page_table, shown_value

if TYPE_CHECKING:
    from tirelog.diagnosis.propose.results import Proposal

#: what a shape acts on -> the unit of its values, if it is not the observable's
_UNITS = {"contact_pressure": "mean pressures", "load": "N"}


def proposed(result: Proposal, command: str) -> Section:
    """The section; of no proposal the reason."""
    if result.status == "nothing":
        return Section("propose", "What is unknown, written down", command, [result.sentence])
    terms = result.terms if result.status == "formula" else ()
    tables = [page_table(result.terms_table())] if terms else []
    return Section(
        "propose",
        "What is unknown, written down",
        command,
        [result.sentence, *result.sentences()],
        [*_shape(result), _rest(result)],
        [*_errors(result), *tables],
        folded=False,
        formulas=[(term.name, term.formula.expression) for term in terms],
    )


def _errors(result: Proposal) -> list[PageTable]:
    """Errors before and after, on manoeuvres that the search saw and on those it did not."""
    factor, unit = shown_value(result.observable, result.unit)
    rows = []
    if result.rmse_heldout_before is not None and result.noise_floor is not None:
        seen = (result.rmse_heldout_before, result.rmse_heldout_after, result.noise_floor)
        cells = ["" if error is None else f"{error * factor:.3g}" for error in seen]
        rows.append(["seen, held out in turn", str(result.manoeuvres), *cells])
    if (locked := result.locked) is not None:
        errors = (locked.before, locked.after, locked.floor)
        cells = [f"{error * factor:.3g}" for error in errors]
        rows.append(["locked away from the search", str(locked.manoeuvres), *cells])
    header = ["manoeuvres", "how many", *(f"{w} [{unit}]" for w in ("before", "after", "floor"))]
    return [PageTable("Errors without and with the proposal", header, rows)] if rows else []


def _shape(result: Proposal) -> list[Figure]:
    """The best measured shape with two standard errors."""
    if not result.shapes:
        return []
    best = result.shapes[0]
    frame = FRAMES[best.frame]
    factor, unit = 1.0, _UNITS.get(best.acts_on, "1")
    if best.acts_on == result.observable:
        factor, unit = shown_value(result.observable, result.unit)
    values, error = best.values * factor, 2.0 * best.band * factor
    traces = band(best.nodes, values - error, values + error, "two standard errors", GREY)
    traces[1]["showlegend"] = True
    traces.append(line(best.nodes, values, "measured shape", INK, line={"width": 2}))
    seen = np.abs(best.values) > 3.0 * best.band
    reach: dict[str, tuple[float, float]] = {}
    if seen.any() and best.nodes[seen].size > 1:  # beyond it the shape is noise about nothing
        most = 1.3 * float(np.abs(values[seen]).max())
        ends = (float(best.nodes[seen][0]), float(best.nodes[seen][-1]))
        reach = {"xrange": ends, "yrange": (-most, most)}
    along = frame.words.removeprefix("in the ").removeprefix("along the ")
    x, y = f"{along} [{frame.unit}]", f"{best.acts_on} [{unit}]"
    law = "" if best.law == "1" else f", times {best.law}"
    title = f"Measured shape {best.words}{law}"
    alt = (
        f"A free shape {best.words}{law}, with two standard errors as a band: what any formula "
        "in this frame can remove at most."
    )
    return [Figure("propose-shape", title, alt, traces, layout(x, y, **reach), half=True)]


def _rest(result: Proposal) -> Figure:
    """The leading shape of what is left, before and after."""
    factor, unit = shown_value(result.observable, result.unit)
    angle = np.degrees(result.phi_rad)
    before, after = result.leading_before * factor, result.leading_after * factor
    traces = [
        line(angle, before, "before", GREY, line={"dash": "dash", "width": 2}),
        line(angle, after, "with the proposal", INK, line={"width": 2}),
    ]
    alt = "The leading shape of what is left over the angle, before and with the proposal."
    shape = layout(ANGLE, f"{result.observable} [{unit}]")
    return Figure("propose-rest", "What is left, before and after", alt, traces, shape, half=True)
