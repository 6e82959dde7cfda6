"""Answers as a notebook keeps them: frozen, with `plot`, `to_json` and a form in HTML."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from tirelog.diagnosis.diagnose import Diagnosis
from tirelog.diagnosis.form import TireForm
from tirelog.diagnosis.gratings.found import GratingsFound
from tirelog.diagnosis.obstacles.compare import TransientComparison
from tirelog.diagnosis.obstacles.learn import Learned
from tirelog.diagnosis.propose.results import Proposal
from tirelog.diagnosis.results import Candidate, Comparison, Ladder, in_unit, plain_values
from tirelog.diagnosis.told import (
    ToldTable,
    errors_sentence,
    errors_table,
    floor_sentences,
    further_sentences,
    hits_table,
    nuisances_sentence,
    parameters_table,
    ranking_table,
    steps_table,
    terms_table,
    together_table,
)
from tirelog.errors import UsageError, refuse_unknown
from tirelog.inference.fit.result import FitResult
from tirelog.physics.model.model import Model
from tirelog.plots.style import write
from tirelog.tables.html import document, table
from tirelog.vocabulary.observables import shown
from tirelog.vocabulary.pictures import BY_OBSTACLE, ERRORS_BY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "Candidate", "Comparison", "ComparisonOfLogs", "DiagnosisOfLogs", "FitOfLogs", "GratingsFound",
    "LadderOfLogs", "Learned", "ProposalOfLogs", "ToldTable", "TransientComparison", "answer_of",
    "errors_sentence", "errors_table", "floor_sentences", "further_sentences", "hits_table",
    "nuisances_sentence", "parameters_table", "ranking_table", "together_table",
]  # fmt: skip

#: reduced chi-square above which what a fit leaves is no noise, as for "nothing missing" in
#: `diagnose`; twice as high would leave unsaid a misfit as large as the noise itself
FORM_IN_DOUBT = 1.2

Answer = TypeVar("Answer")


def answer_of(kind: type[Answer], base: Any, **more: Any) -> Answer:
    """An answer with the fields of its base."""
    return kind(**{f.name: getattr(base, f.name) for f in fields(base)}, **more)


def _drawn(
    target: str | Path | Axes | None,
    figure: Callable[[], Figure],
    panel: Callable[[Axes], None],
) -> Any:
    """The picture: returned, written to a path as well, or its main panel on axes that are given.

    UsageError: no picture has the path's suffix.
    """
    if target is None:
        return figure()
    if isinstance(target, str | Path):
        made = figure()
        write(made, Path(target))
        return made
    panel(target)
    return target.figure


def _html(title: str, tables: Iterable[ToldTable], remarks: Iterable[str]) -> str:
    """An answer as a notebook shows it."""
    return document(title, [table(one.names, one.rows) for one in tables], remarks)


@dataclass(frozen=True)
class ComparisonOfLogs(Comparison):
    """A fitted model against logs (see `Comparison`), and its answer to their obstacles.

    obstacles  errors hit by hit, None without a [road] or with a model that does not move
    aside      remarks on what was not compared
    """

    obstacles: TransientComparison | None = None
    aside: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        comparison: Comparison,
        obstacles: TransientComparison | None = None,
        aside: tuple[str, ...] = (),
    ) -> ComparisonOfLogs:
        """The comparison with what was said of obstacles."""
        if isinstance(comparison, cls):  # a diagnosis that names nothing has one for both
            return comparison
        return answer_of(cls, comparison, obstacles=obstacles, aside=aside)

    def by(self, name: str) -> Iterator[list[dict[str, Any]]]:
        """Rows of the errors by revolution, angle, speed, ... (`ERRORS_BY`), part by part.

        UsageError: no such table, or one of obstacles where there are none.
        """
        refuse_unknown(name, ERRORS_BY, f"no table of errors by {name!r}", do="choose one")
        if name not in BY_OBSTACLE:
            return self.tables.parts(name)
        if self.obstacles is None:
            steady = [word for word in ERRORS_BY if word not in BY_OBSTACLE]
            raise UsageError(
                f"--by {name} is for a coupled_ring model and logs whose setup has a [road]",
                allowed=f"allowed here are {', '.join(steady)}",
                do="choose one, or add the [road]",
            )
        return iter([self.obstacles.tables[name]])

    def rows(self) -> list[dict[str, Any]]:
        """One row: the numbers of `to_json` that are neither lists nor tables."""
        told = self.to_json().items()
        return [{name: v for name, v in told if not isinstance(v, dict | list)}]

    def draw(self, path: Path, kind: str = "page") -> list[Path]:
        """The pictures as files: the first observable's at `path`, of others and of hits beside it.

        Those beside it come back. UsageError: a kind that is none for a number per revolution.
        """
        from tirelog.plots.models.compare import draw

        beside = draw(self, path, kind)
        if self.obstacles is not None:
            from tirelog.plots.models.transient import draw as draw_hits

            beside.append(path.with_stem(f"{path.stem}_transient"))
            draw_hits(self.obstacles, beside[-1])
        return beside

    @property
    def notes(self) -> tuple[str, ...]:
        """All that a reader should know before believing the numbers."""
        hits = self.obstacles.remarks if self.obstacles is not None else ()
        return (*self.aside, *self.remarks, *hits)

    def to_json(self) -> dict[str, Any]:
        """The numbers, in the observable's unit; with obstacles their part under `transients`."""
        told = super().to_json()
        del told["obstacles"], told["aside"]
        return told | ({"transients": self.obstacles.to_json()} if self.obstacles else {})

    def plot(self, path_or_axes: str | Path | Axes | None = None, kind: str = "page") -> Any:
        """Waveforms with the floor's band and maps of the residual; the figure.

        path_or_axes  a file to write it to as well (.png, .svg, .pdf), or axes that get the
                      waveforms alone
        kind          "page", "polar" (around the wheel, with the contact pressure) or "edges" (of
                      the patch, close up)
        """
        from tirelog.plots.models.compare import figure, waveforms

        return _drawn(path_or_axes, lambda: figure(self, kind), lambda axes: waveforms(axes, self))

    def __repr__(self) -> str:
        factor, unit = shown(self.observable, self.unit)
        return (
            f"{self.observable} in {unit}: {self.revolutions} revolutions, "
            f"{self.manoeuvres} manoeuvres, held-out error {in_unit(self.rmse_heldout, factor)}, "
            f"noise floor {in_unit(self.noise_floor, factor)}"
        )

    def _repr_html_(self) -> str:
        errors = together_table(self) if self.parts else errors_table(self)
        said = [text for text in (nuisances_sentence(self), self.agreement) if text]
        return _html(repr(self), [errors, parameters_table(self)], (*said, *self.notes))


@dataclass(frozen=True)
class DiagnosisOfLogs(Diagnosis):
    """Which effect is missing (see `Diagnosis`)."""

    @cached_property
    def before(self) -> ComparisonOfLogs:
        """The comparison of the model as it came."""
        return ComparisonOfLogs.of(super().before)

    @cached_property
    def after(self) -> ComparisonOfLogs:
        """The comparison of the model with what was selected."""
        return ComparisonOfLogs.of(super().after)

    def rows(self) -> list[dict[str, Any]]:
        """The ranking, a row per effect."""
        names = ("effect", "rank", "excess_removed", "p_adjusted", "selected")
        return [
            {name: getattr(c, name) for name in names} | {"group": ";".join(c.group)}
            for c in self.effects
        ]

    def draw(self, path: Path) -> list[Path]:
        """The pictures as files: the verdict's at `path`, those of further observables beside it.

        The latter come back.
        """
        from tirelog.plots.models.diagnose import draw

        return draw(self, path)

    def to_json(self) -> dict[str, Any]:
        """The verdict and all that is said with it."""
        return super().to_json() | {"remarks": list(self.before.remarks)}

    def plot(self, path_or_axes: str | Path | Axes | None = None) -> Any:
        """What is left before and after at one scale, and the ranking; the figure.

        path_or_axes  a file to write it to as well (.png, .svg, .pdf), or axes that get the ranking
        """
        from tirelog.plots.models.diagnose import figure, ranking

        return _drawn(path_or_axes, lambda: figure(self), lambda axes: ranking(axes, self))

    def __repr__(self) -> str:
        return self.sentence

    def _repr_html_(self) -> str:
        said = [self.certainty.sentence, errors_sentence(self), *further_sentences(self)]
        return _html(repr(self), [ranking_table(self)], (*said, *self.before.remarks))


@dataclass(frozen=True)
class ProposalOfLogs(Proposal):
    """The unknown effect written down (see `Proposal`)."""

    def plot(self, path_or_axes: str | Path | Axes | None = None) -> Any:
        """The measured shape with its band, and what is left before and after; the figure.

        path_or_axes  a file to write it to as well (.png, .svg, .pdf), or axes that get the shape
        """
        from tirelog.plots.models.propose import figure, shape

        return _drawn(path_or_axes, lambda: figure(self), lambda axes: shape(axes, self))

    def __repr__(self) -> str:
        return self.sentence

    def _repr_html_(self) -> str:
        return _html(self.sentence, [terms_table(self)] if self.terms else [], self.sentences())


@dataclass(frozen=True)
class LadderOfLogs(Ladder):
    """Effects added one by one (see `Ladder`)."""

    def plot(self, path_or_axes: str | Path | Axes | None = None) -> Any:
        """The error falling to the floor, step by step; the figure.

        path_or_axes  a file to write it to as well (.png, .svg, .pdf), or axes that get the steps
        """
        from tirelog.plots.models.ladder import figure, steps

        return _drawn(path_or_axes, lambda: figure(self), lambda axes: steps(axes, self))

    def __repr__(self) -> str:
        return f"{self.verdict.replace('_', ' ')}: {len(self.steps)} steps"

    def _repr_html_(self) -> str:
        return _html(repr(self), [steps_table(self.to_json())], self.remarks)


@dataclass(frozen=True)
class FormOfLogs(TireForm):
    """A tire's contact pressure and stiffness (see `TireForm`)."""

    def plot(self, path_or_axes: str | Path | Axes | None = None) -> Any:
        """Pressure over the patch and stiffness over wavelength; the figure.

        path_or_axes  a file to write it to as well (.png, .svg, .pdf), or axes that get the
                      pressure
        """
        from tirelog.plots.models.form import figure, over_patch

        return _drawn(path_or_axes, lambda: figure(self), lambda axes: over_patch(axes, self))


@dataclass(frozen=True)
class FitOfLogs:
    """A model fitted to logs.

    model    with values and standard errors
    found    what the fit to steady revolutions says: errors, covariance, correlations, bounds
    learned  what obstacles told, None without them or if nothing of it is free
    remarks  what a reader should know before believing it
    """

    model: Model
    found: FitResult
    learned: Learned | None = None
    remarks: tuple[str, ...] = ()

    @property
    def doubts(self) -> tuple[str, ...]:
        """Sentences on what the errors do not cover: the model's form, what shares one scale."""
        form = (
            "what is left is more than noise: the errors hold only as far as the model's form "
            "does; `tirelog diagnose` tells more",
        )
        in_doubt = self.found.reduced_chi2 > FORM_IN_DOUBT
        return (*(form if in_doubt else ()), *self.found.degenerate)

    def to_json(self) -> dict[str, Any]:
        """Values, standard errors (None: not determined) and units by name, and how good it is."""
        parameters = self.model.parameters
        names = (*self.found.names, *(self.learned.names if self.learned else ()))
        errors = dict(zip(self.found.names, self.found.se, strict=True))
        told: dict[str, Any] = plain_values(
            {
                "observable": self.model.observable,
                "parameters": {
                    name: {
                        "value": parameters[name].value,
                        "se": errors.get(name, parameters[name].se),
                        "se_with_form": parameters[name].se_with_form,
                        "unit": parameters[name].unit,
                    }
                    for name in names
                },
                "reduced_chi2": self.found.reduced_chi2,
                "freedom": self.found.freedom,
                "revolutions": self.found.revolutions,
                "correlations": self.found.correlations,
                "at_bound": self.found.at_bound,
                "degenerate": self.found.degenerate,
                "hits": self.learned.hits if self.learned else 0,
                "remarks": self.remarks,
            }
        )
        return told

    def plot(self, path_or_axes: str | Path | Axes | None = None) -> Any:
        """Which parameters the data tell apart: their correlations, values beside; the figure.

        path_or_axes  a file to write it to as well (.png, .svg, .pdf), or axes to draw on
        """
        from tirelog.plots.models.fit import correlations, figure

        return _drawn(
            path_or_axes,
            lambda: figure(self.model, self.found),
            lambda axes: correlations(axes, self.model, self.found),
        )

    def __repr__(self) -> str:
        found = self.found
        return f"{found.revolutions} revolutions, reduced chi-square {found.reduced_chi2:.3f}"

    def _repr_html_(self) -> str:
        bounds = [f"{name} stands at a bound" for name in self.found.at_bound]
        rows = [
            (name, p.value, p.se if p.se is None or np.isfinite(p.se) else "not determined", p.unit)
            for name, p in self.model.parameters.items()
            if p.free
        ]
        fitted = ToldTable("Parameters as fitted", ["parameter", "value", "error", "unit"], rows)
        return _html(repr(self), [fitted], (*bounds, *self.doubts, *self.remarks))
