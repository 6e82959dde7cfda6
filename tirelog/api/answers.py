"""From logs to measured revolutions, and the answers of a model to them.

    logs --measure--> MeasuredLogs --fit, compare, diagnose, ladder--> frozen results

`measure` is the only way in, so that every answer is about the same revolutions.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path as File
from typing import Any

from tirelog.api.logs import Logs, Path, SetupLike, as_logs, each_log, open_log
from tirelog.api.models import ModelLike, as_model
from tirelog.data.recording import Recording
from tirelog.diagnosis import compare as comparing
from tirelog.diagnosis import diagnose as diagnosing
from tirelog.diagnosis import fitted as forming
from tirelog.diagnosis import ladder as climbing
from tirelog.diagnosis.answer import AnswerTable
from tirelog.diagnosis.diagnose import Diagnosis
from tirelog.diagnosis.fitted import FitOfLogs, TireForm, fit_of_logs
from tirelog.diagnosis.gratings import GratingsFound
from tirelog.diagnosis.obstacles import (
    FittedMotion,
    TransientComparison,
    compare_transients,
    learn_motion,
)
from tirelog.diagnosis.propose import propose as proposing
from tirelog.diagnosis.propose.propose import Proposal
from tirelog.diagnosis.results import Comparison, Ladder
from tirelog.errors import ModelError, UsageError, or_refusal
from tirelog.inference.cells.cells import without_ratios
from tirelog.inference.measured import MeasuredLogs, measured_for, motion_names
from tirelog.physics.effects import Effect
from tirelog.physics.model.model import Model
from tirelog.physics.model.user_effects import own_effects
from tirelog.report.page import ReportRequest
from tirelog.storage.whole import whole_file
from tirelog.vocabulary.observables import (
    OBSERVABLES,
)

__all__ = [
    "AnswerTable",
    "Comparison",
    "Diagnosis",
    "FitOfLogs",
    "FittedMotion",
    "GratingsFound",
    "Ladder",
    "MeasuredLogs",
    "Proposal",
    "ReportRequest",
    "TireForm",
    "TransientComparison",
    "compare",
    "diagnose",
    "fit",
    "ladder",
    "make_report",
    "measure",
    "propose",
    "report_page",
    "tire_form",
    "write_report",
]

Progress = Callable[[str], None]


def measure(
    logs: Logs,
    model: ModelLike,
    channel: str | None = None,
    *,
    setup: SetupLike | None = None,
) -> MeasuredLogs:
    """The revolutions of logs that are to be compared with a model.

    Parameters
    ----------
    logs : str, os.PathLike, Recording or an iterable of them
        Logs or runs, by path or open. Those given by path are opened one after the other.
    model : Model, str, os.PathLike or dict
        The model that they will be compared with: itself, the path of its file, or the file's
        tables. If it is of several observables, logs may each measure some of them. Or the
        observable: ``"strain"``, ``"radial_acceleration"``, ``"patch_length"``,
        ``"dissipation_factor"``, ``"phase_shift"``, ``"patch_width"``.
    channel : str, optional
        The channel to take; by default the first of each log that measures the observable. Of
        strain also several gratings for one fit: their names with commas between, or ``"all"``.
    setup : str, os.PathLike, Setup or dict, optional
        The setup of logs given by path; without it the TOML file beside each.

    Returns
    -------
    MeasuredLogs
        Steady revolutions as ``stacks`` (values [SI], shape (revolutions, angles)), logs that met
        an obstacle as ``obstacles``, and what was set apart on the way as ``notes``. The logs
        need not stay open.

    Raises
    ------
    UsageError
        No such observable or channel, or fewer than six revolutions.
    ReadError, SetupError
        As `open_log`.

    Examples
    --------
    >>> import tirelog
    >>> found = tirelog.measure("sample_data/drive.csv.gz", "strain")
    >>> sum(len(stack) for stack in found.stacks)
    241
    """
    if isinstance(model, str) and (
        model in OBSERVABLES or not (model.endswith(".toml") or os.path.isfile(model))
    ):
        return measured_for(each_log(logs, setup), (model,), channel)
    model = as_model(model)
    level = not model.ac_coupled
    return measured_for(each_log(logs, setup), model.observables, channel, level=level)


def fit(measured: MeasuredLogs, model: ModelLike) -> FitOfLogs:
    """The model's free parameters fitted to measured revolutions, as `compare` fits them.

    Parameters
    ----------
    measured : MeasuredLogs
        What `measure` gave. Masses, damping and bristles of a coupled ring are fitted to the
        obstacles, if the logs met some.
    model : Model, str, os.PathLike or dict
        The start of the fit, as for `measure`; its bounds are kept.

    Returns
    -------
    FitOfLogs
        ``model`` with values and standard errors, ``found`` (covariance, correlations, bounds),
        ``to_json()``, ``plot()``.

    Raises
    ------
    ModelError
        Nothing is free, or an effect needs a condition that a log does not know.
    UsageError
        Model and revolutions do not fit together.
    """
    model, given = as_model(model), _known(measured)
    found, remarks = fit_of_logs(given.revolutions, model)
    notes = list(remarks)
    moving = motion_names(model)
    fitted = found.model.with_parameters({name: model.parameters[name] for name in moving})
    learned = learn_motion(given.obstacles, fitted) if given.obstacles and moving else None
    if moving and learned is None:
        notes.append(
            f"{', '.join(moving)}: unchanged; only obstacles determine them, and no log has a "
            "[road] in its setup"
        )
    fitted = without_ratios(fitted if learned is None else learned.model)
    return FitOfLogs(fitted, found, learned, tuple(notes))


def compare(
    measured: MeasuredLogs,
    model: ModelLike,
    others: Sequence[ModelLike] = (),
    *,
    learn: bool = False,
) -> Comparison:
    """A model fitted on part of the manoeuvres, and its error on the rest beside the noise floor.

    Parameters
    ----------
    measured : MeasuredLogs
        What `measure` gave.
    model : Model, str, os.PathLike or dict
        Fitted from its values, within its bounds; fixed parameters keep their values.
    others : model or sequence of models, optional
        Fitted to the same logs; ``ranking`` then has all of them, the best first.
    learn : bool
        Also what a residual that is learnt on the other manoeuvres would gain, in ``learnt``.

    Returns
    -------
    Comparison
        ``rmse`` and ``rmse_heldout``, ``noise_floor``, ``excess`` and ``excess_heldout`` in the
        observable's SI unit, ``reduced_chi2``, ``tables`` by revolution, angle, speed, regime and
        conditions, ``model`` as fitted, ``obstacles``; ``to_json()``, ``plot()``.

    Raises
    ------
    UsageError
        Model and revolutions do not fit together.

    Examples
    --------
    >>> import tirelog
    >>> model = tirelog.Model.new("beam", "patch_length")
    >>> found = tirelog.measure("sample_data/drive.csv.gz", model)
    >>> round(1e3 * tirelog.compare(found, model).noise_floor, 2)  # mm
    0.62
    """
    found = _known(measured)
    several = [others] if isinstance(others, str | os.PathLike | Mapping | Model) else others
    result = comparing.compare(
        found.revolutions, as_model(model), [as_model(other) for other in several], learn=learn
    )
    if not found.obstacles:
        return result
    if result.model.carcass != "coupled_ring":
        aside = (
            f'a {result.model.carcass} says nothing of the obstacles; carcass = "coupled_ring" '
            "does",
        )
        return replace(result, aside=aside)
    answers = or_refusal(compare_transients)(found.obstacles, result.model, unit=result.unit)
    if isinstance(answers, ModelError):
        return replace(result, aside=(f"the obstacles are not compared: {answers}",))
    return replace(result, obstacles=answers)


def tire_form(measured: MeasuredLogs, model: ModelLike) -> TireForm:
    """Contact pressure over the patch and stiffness over wavelength, with standard errors.

    Parameters
    ----------
    measured : MeasuredLogs
        What `measure` gave.
    model : Model, str, os.PathLike or dict
        A model of a waveform, with the effects that the tire is known to have: what is missing
        from it is in the form by its mean.

    Returns
    -------
    TireForm
        ``pressure`` [N/m] over the place in the patch [m], ``stiffness`` [N/m^2] over wavelength
        [m], each with ``at``, ``value``, ``se`` and ``formula``; ``half_length_m``; ``rows()``,
        ``to_json()``, ``plot()``.

    Raises
    ------
    UsageError
        The model has no waveform or no patch, or does not fit to the revolutions.
    """
    return forming.tire_form(_known(measured).revolutions, as_model(model))


def diagnose(
    measured: MeasuredLogs,
    model: ModelLike,
    *,
    effects: Iterable[Effect] = (),
    leave_one_out: bool | Mapping[str, Sequence[str]] = False,
    progress: Progress | None = None,
) -> Diagnosis:
    """Which effect the model lacks, which cannot be separated, and what to drive next.

    Parameters
    ----------
    measured : MeasuredLogs
        What `measure` gave.
    model : Model, str, os.PathLike or dict
        The model that may lack something.
    effects : iterable of Effect
        Candidates of your own beside the catalogue, those of installed packages, and those of the
        file that the model was read with.
    leave_one_out : bool or mapping
        Diagnose without each log in turn, or without the logs of each tire by its name:
        ``stability`` says where the verdict changes.
    progress : callable, optional
        Called with a sentence on each step.

    Returns
    -------
    Diagnosis
        ``verdict``, ``sentence``, ``selected``, ``effects`` (the ranking), ``model`` with what
        was selected; ``to_json()``, ``plot()``.

    Raises
    ------
    UsageError
        Model and revolutions do not fit together.
    """
    asked, model = _known(measured).revolutions, as_model(model)
    candidates = _candidates(model, effects)
    progress = progress or _silent
    pieces = comparing.measured_pieces(asked) if leave_one_out is not False else None
    groups: Mapping[str, Sequence[str]] = {}
    by = "log" if leave_one_out is True else "tire"
    if pieces is not None:
        known = diagnosing.logs_of(pieces)
        groups = known if isinstance(leave_one_out, bool) else _of_these(leave_one_out, known)
        diagnosing.refuse_one(groups, by)
    result = diagnosing.diagnose(asked, model, effects=candidates, progress=progress)
    if pieces is not None:
        some = partial(diagnosing.of_logs, pieces)
        result = diagnosing.with_groups(
            result, groups, some, model, by=by, effects=candidates, progress=progress
        )
    return result


def _of_these(
    groups: Mapping[str, Sequence[str]], known: Mapping[str, Sequence[str]]
) -> dict[str, list[str]]:
    """The groups, of the logs that were measured; UsageError: one of these is in none."""
    count = {log: sum(log in logs for logs in groups.values()) for log in known}
    if wrong := [log for log, n in count.items() if n != 1]:
        raise UsageError(
            f"{wrong[0]} is in {count[wrong[0]]} of the groups to leave out",
            allowed="each log is in one",
            do="correct leave_one_out",
        )
    own = {name: [log for log in known if log in logs] for name, logs in groups.items()}
    return {name: logs for name, logs in own.items() if logs}


def ladder(
    measured: MeasuredLogs,
    model: ModelLike,
    *,
    effects: Iterable[Effect] = (),
    propose: bool = False,
    progress: Progress | None = None,
) -> Ladder:
    """Effects added one by one until nothing more is worth adding.

    Parameters
    ----------
    measured, model, effects, progress
        As for `diagnose`.
    propose : bool
        If the effects end above the floor, the last step identifies what is unknown.

    Returns
    -------
    Ladder
        ``steps`` (effect, errors, decision), ``model`` at the top, ``rmse_untouched`` on
        manoeuvres reserved for the end; ``to_json()``, ``plot()``.

    Raises
    ------
    UsageError
        Model and revolutions do not fit together.
    """
    found, model = _known(measured), as_model(model)
    if propose:
        _one_grating(found, "propose", "leave --propose out, or measure one channel")
    return climbing.ladder(
        found.revolutions,
        model,
        effects=_candidates(model, effects),
        proposing=propose,
        progress=progress or _silent,
    )


def propose(
    measured: MeasuredLogs,
    model: ModelLike,
    *,
    effects: Iterable[Effect] = (),
    always: bool = False,
    shape: bool = False,
    progress: Progress | None = None,
) -> Proposal:
    """The unknown effect as formulas or as a measured shape: an identification.

    A third of the manoeuvres is reserved before the search and serves once, for the error of the
    result.

    Parameters
    ----------
    measured : MeasuredLogs
        What `measure` gave; twelve manoeuvres at least.
    model : Model, str, os.PathLike or dict
        The model that lacks something: of strain or of radial acceleration.
    effects : iterable of Effect
        Candidates of your own beside the catalogue, which go before any proposal.
    always : bool
        Search even if an effect of the catalogue explains it.
    shape : bool
        A measured shape in place of formulas.
    progress : callable, optional
        Called with a sentence on each step.

    Returns
    -------
    Proposal
        ``status`` ("formula", "shape" or "nothing"), ``sentence``, ``terms``, ``shapes``,
        ``locked``, ``model`` with what is proposed (None if nothing is); ``to_json()``,
        ``plot()``.

    Raises
    ------
    UsageError
        Model and revolutions do not fit together, or the model gives a number per revolution.
    """
    found, model = _known(measured), as_model(model)
    _one_grating(found, "propose", "measure one channel; `diagnose` has a row per grating")
    return proposing.propose(
        found.stacks,
        model,
        effects=_candidates(model, effects),
        despite=always,
        shape=shape,
        progress=progress or _silent,
    )


def _candidates(model: Model, given: Iterable[Effect]) -> list[Effect]:
    """Effects to try beside the catalogue: those given, installed ones, the model's own file's."""
    chosen = {effect.id: effect for effect in own_effects(model.effects_file)}
    return list((chosen | {effect.id: effect for effect in given}).values())


def _silent(text: str) -> None:
    """Drop a remark that nobody wants."""


def _one_grating(found: MeasuredLogs, question: str, do: str) -> None:
    """UsageError: several gratings were measured for one fit."""
    if found.gratings:
        raise UsageError(
            f"{len(found.gratings)} gratings in one",
            allowed=f"{question} takes one grating; compare, diagnose, ladder and fit take several",
            do=do,
        )


def _known(value: object) -> MeasuredLogs:
    """The measured revolutions.  UsageError: the value is something else, such as a log."""
    if not isinstance(value, MeasuredLogs):
        raise UsageError(
            f"{type(value).__name__} holds no measured revolutions",
            allowed="allowed is the result of tirelog.measure(logs, model)",
            do="measure first",
        )
    return value


# ---- Reports: one offline page of logs, tables, a campaign, and a model's answers.


_PAGES = (".html", ".htm")


def report_page(asked: ReportRequest, output: File | None) -> File:
    """The page to write, .html.  UsageError, before any work: the request cannot be carried out.

    The commands on the page have the names of logs and files in `asked`.
    """
    from tirelog.report.page import plotting_library

    if not asked.logs and asked.campaign is None:
        raise UsageError(
            "nothing to report on",
            allowed="allowed are logs, runs and --campaign DIR",
            do="give one",
        )
    if output is None:
        raise UsageError("nothing to write", do="add -o PAGE.html")
    if output.suffix.lower() not in _PAGES and (output.is_file() or not output.exists()):
        raise UsageError(
            f"-o {output}: the page is HTML",
            allowed=f"allowed are the suffixes {', '.join(_PAGES)}",
            do="rename it",
        )
    plotting_library()
    return output


def make_report(
    recordings: Sequence[Recording],
    asked: ReportRequest,
    page: File,
    progress: Progress = lambda text: None,
    model: Model | None = None,
) -> tuple[str, ...]:
    """The page of open logs, as `report_page` allows it; a sentence on the written file.

    A `model` takes the place of the file's in `asked`.
    """
    from tirelog.report.build import build
    from tirelog.report.page import render

    made = build(recordings, asked, progress, model)
    with whole_file(page) as part, part.open("w", encoding="utf-8") as stream:
        stream.writelines(render(made))
        size = stream.tell()
    return (f"{page}: {len(made.sections)} sections, {size / 1e6:.1f} MB",)


def write_report(
    logs: Logs = (),
    output: Path | None = None,
    *,
    setup: SetupLike | None = None,
    tables: Sequence[Path] = (),
    campaign: Path | None = None,
    model: ModelLike | None = None,
    ladder: Path | None = None,
    channel: str | None = None,
) -> tuple[str, ...]:
    """One offline page: the logs, their tables, and where a model fails.

    Parameters
    ----------
    logs : str, os.PathLike, Recording or a list of them, optional
        Logs or runs, by path or open.
    output : str or os.PathLike, optional
        The page to write, .html.
    setup : str, os.PathLike, Setup or dict, optional
        The setup of logs given by path; without it the TOML file beside each.
    tables : sequence of str or os.PathLike
        Tables already made, which are not made again.
    campaign : str or os.PathLike, optional
        A campaign's output folder.
    model : Model, str, os.PathLike or dict, optional
        A model to compare with the logs. Commands on the page call one that is no path MODEL.toml.
        One with effects of your own is read by `load_model`.
    ladder : str or os.PathLike, optional
        The JSON of a `ladder`.
    channel : str, optional
        As for `measure`.

    Returns
    -------
    tuple of str
        A sentence on the page that was written.

    Raises
    ------
    UsageError
        Nothing to report on or to write, or a file of another kind.
    ReadError, SetupError
        As `open_log`.
    """
    in_memory = None if model is None or isinstance(model, str | os.PathLike) else as_model(model)
    given: dict[str, Any] = {
        "setup": setup if isinstance(setup, str | os.PathLike) else None,
        "model": model if in_memory is None else "MODEL.toml",
        "ladder": ladder, "campaign": campaign,
        "effects": None if in_memory is None else in_memory.effects_file,
    }  # fmt: skip
    named = list(as_logs(logs))
    asked = ReportRequest(
        tuple(log.log if isinstance(log, Recording) else os.fspath(log) for log in named),
        tables=tuple(map(File, tables)),
        channel=channel,
        **{name: None if path is None else File(path) for name, path in given.items()},
    )
    page = report_page(asked, None if output is None else File(output))
    with ExitStack() as resources:
        opened = [
            log if isinstance(log, Recording) else resources.enter_context(open_log(log, setup))
            for log in named
        ]
        return make_report(opened, asked, page, model=in_memory)
