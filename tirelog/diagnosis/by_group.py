"""A diagnosis asked again: without each log or tire, of each alone, of manoeuvres drawn anew.

    pieces of all logs, groups of logs -> the pieces without each group, or of it alone
        -> a diagnosis each -> `stability.Stability`, `stability.Each`

It takes as many diagnoses as there are logs, or tires.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from tirelog.diagnosis.candidates.search import Progress
from tirelog.diagnosis.certainty import GroupVerdict, PerGroup, Stability, inclusion
from tirelog.diagnosis.diagnose import Diagnosis, diagnose
from tirelog.errors import TirelogError, UsageError
from tirelog.inference.cells.joint import JointPieces
from tirelog.inference.cells.pieces import Pieces
from tirelog.physics.effects import Effect
from tirelog.physics.model.model import Model

#: the pieces of the logs of these names
Some = Callable[[Sequence[str]], Pieces | JointPieces]


def with_draws(found: Diagnosis, draws: int, effects: Iterable[Effect] = ()) -> Diagnosis:
    """The diagnosis, with how often its effects are named over draws of its manoeuvres."""
    drawn = inclusion(found.found, draws, effects)
    return replace(found, inclusion=drawn, notes=(*found.notes, *drawn.sentences))


def with_stability(
    found: Diagnosis, stability: Stability, each: PerGroup | None = None
) -> Diagnosis:
    """The diagnosis, with whether it stands without single logs or tires, and what each says."""
    said = [stability.sentence, *([] if each is None else [each.sentence])]
    return replace(found, stability=stability, each=each, notes=(*found.notes, *said))


def logs_of(pieces: Pieces | JointPieces) -> dict[str, tuple[str, ...]]:
    """Every log as a group of its own."""
    return {log: (log,) for log in dict.fromkeys(pieces.logs)}


def of_logs(pieces: Pieces | JointPieces, logs: Iterable[str]) -> Pieces | JointPieces:
    """The pieces of some of the logs; UsageError: there is none."""
    names = set(logs)
    if isinstance(pieces, JointPieces):
        parts = [_of_logs(part, names) for part in pieces.parts]
        if any(part is None for part in parts):
            raise UsageError(
                "a sensor is in none of the other logs",
                allowed="each observable and grating must be in one log at least",
                do="give more logs",
            )
        return JointPieces.of([p for p in parts if p is not None], pieces.places)
    found = _of_logs(pieces, names)
    if found is None:
        raise UsageError("no log is left", allowed="one at least", do="give more logs")
    return found


def _of_logs(pieces: Pieces, names: set[str]) -> Pieces | None:
    """The pieces of some logs, logs and manoeuvres numbered anew; None if there is none."""
    kept = np.flatnonzero([log in names for log in pieces.logs])
    mine = np.isin(pieces.log, kept)
    if not mine.any():
        return None
    some = pieces.take(mine)
    number, log = np.unique(some.log, return_inverse=True)
    return replace(
        some,
        log=log,
        manoeuvre=np.unique(some.manoeuvre, return_inverse=True)[1],
        logs=tuple(pieces.logs[i] for i in number),
    )


def answer_of(group: str, logs: Sequence[str], found: Diagnosis) -> GroupVerdict:
    """A diagnosis in few words."""
    p = found.marks.least_p
    left = found.unexplained["p"]
    if found.verdict == "unknown" and left is not None:
        p = min(p, left)
    return GroupVerdict(
        group,
        tuple(logs),
        found.verdict,
        found.selected,
        found.ambiguous_groups,
        # two questions are asked: of candidates, and of any shape
        None if found.verdict == "too_few" else min(2.0 * p, 1.0),
        found.certainty.probability,
    )


def _asked(
    some: Some, group: str, logs: Sequence[str], model: Model, effects: Sequence[Effect]
) -> GroupVerdict:
    """The diagnosis of some logs; what cannot be asked says why."""
    try:
        found = diagnose(some(logs), model, effects=effects)
    except TirelogError as problem:
        return GroupVerdict(group, tuple(logs), "", problem=problem.message)
    return answer_of(group, logs, found)


def leave_one_out(
    groups: Mapping[str, Sequence[str]],
    some: Some,
    model: Model,
    whole: Diagnosis,
    *,
    by: str = "log",
    effects: Iterable[Effect] = (),
    progress: Progress = lambda text: None,
) -> Stability:
    """The verdict without each group of logs in turn.

    groups  name -> its logs: those of one tire, or one log each;  some  gives the pieces of logs
    whole   what is said of all
    UsageError: there is but one group.
    """
    refuse_one(groups, by, "none can be left out")
    extra, answers = tuple(effects), []
    every = [log for logs in groups.values() for log in logs]
    for name, logs in groups.items():
        progress(f"once more without {name}")
        rest = [log for log in every if log not in logs]
        answers.append(_asked(some, name, rest, model, extra))
    return Stability(by, answer_of("", every, whole), tuple(answers))


def each_alone(
    groups: Mapping[str, Sequence[str]],
    some: Some,
    model: Model,
    *,
    by: str = "log",
    effects: Iterable[Effect] = (),
    progress: Progress = lambda text: None,
) -> PerGroup:
    """What each group of logs says alone, with p adjusted over them; as `leave_one_out`."""
    refuse_one(groups, by, "it is the whole")
    extra, answers = tuple(effects), []
    for name, logs in groups.items():
        progress(f"{name} alone")
        answers.append(_asked(some, name, logs, model, extra))
    return PerGroup(by, tuple(answers))


def refuse_one(groups: Mapping[str, Sequence[str]], by: str, but_one: str) -> None:
    """UsageError: there is but one group."""
    if len(groups) < 2:
        raise UsageError(
            f"one {by} alone: {but_one}", allowed=f"two {by}s at least", do="give more logs"
        )
