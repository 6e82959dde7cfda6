"""Models over a whole campaign.

Compare, diagnose and ladder on all its logs together, each under its own conditions.

    pieces that the workers kept, a log's share of each --> diagnosis
        --> output/models/<model>/{compare,diagnose,ladder}.json
        --> output/models/<model>/page.json, sections for the report

Logs differ in load, pressure, water and age, so `diagnose` finds effects that no single log shows.
A result has the key of everything that it was made of. It is made again only if a log, a setup,
the model or tirelog changes.

Memory: means of revolutions, as many as `inference.cells.pieces` has room for, whatever the
campaign's size, and no revolutions. Logs share that room as those of one `diagnose` do, so that
both give the same numbers. A result has the number of the means.
"""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from tirelog.campaign.ledger import Ledger, json_bytes, json_table, read_pieces
from tirelog.campaign.manifest import Campaign, CampaignModel, LogTask
from tirelog.campaign.runner import pieces_name
from tirelog.errors import ReadError, TirelogError, UsageError
from tirelog.physics.model.file import load_model
from tirelog.physics.model.user_effects import own_effects
from tirelog.version import __version__

if TYPE_CHECKING:
    from tirelog.inference.cells.pieces import Pieces

#: changes with what a result is made of beside logs, setups and models, so that older results are
#: made again
_FORM = "steady revolutions, shared room"


def run_models(
    campaign: Campaign, ledger: Ledger, tasks: list[LogTask], said: Callable[[str], None]
) -> list[str]:
    """Make the missing results of every model; sentences on those that could not be made."""
    failed = []
    for model in campaign.models:
        try:
            _run(model, str(campaign.file), ledger, tasks, said)
        except TirelogError as problem:
            failed.append(f"{model.file}: {problem.message}")
    return failed


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _run(
    model: CampaignModel,
    manifest: str,
    ledger: Ledger,
    tasks: list[LogTask],
    said: Callable[[str], None],
) -> None:
    """One model's results; what is made already is seen without the science."""
    measured = [
        t
        for t in tasks
        if (entry := ledger.entries.get(t.name))
        and not entry.error
        and entry.pieces.get(model.observable) == ""
    ]
    if not measured:
        raise UsageError(
            f"no log of the campaign measures {model.observable}, so there is nothing to hold "
            "the model against"
        )
    read, text = load_model(model.file), model.file.read_text("utf-8")
    key = _digest(json.dumps([[t.key for t in measured], text, __version__, _FORM]).encode())
    folder = f"models/{model.file.stem}"
    waiting = [
        name
        for name in model.commands
        if json_table(ledger.folder.read(f"{folder}/{name}.json")).get("key") != key
    ]
    if not waiting:
        return
    from tirelog.diagnosis.compare import compare
    from tirelog.diagnosis.diagnose import diagnose
    from tirelog.diagnosis.ladder import ladder

    candidates = own_effects()
    commands: dict[str, Callable[..., Any]] = {
        "compare": compare,
        "diagnose": partial(diagnose, effects=candidates),
        "ladder": partial(ladder, effects=candidates),
    }
    pieces, about = _pieces(measured, model.observable, ledger)
    results = {}
    for name in model.commands:
        results[name] = commands[name](pieces, read)
        found = [getattr(results[name], "verdict", ""), *getattr(results[name], "selected", ())]
        outcome = f": {found[0]}" if found[0] else ""
        outcome += f", {' '.join(found[1:])}" if found[1:] else ""
        said(f"{ledger.folder.root}/{folder}/{name}.json{outcome}")
    ledger.folder.write(f"{folder}/page.json", json_bytes(_page(results, manifest)))
    # after the page, which is whole once these say so by their key
    for name, result in results.items():
        ledger.folder.write(
            f"{folder}/{name}.json", json_bytes({"key": key, **about, **result.to_json()})
        )


def _page(results: Mapping[str, Any], manifest: str) -> dict[str, Any]:
    """What the report shows of these results.

    The sections that it makes of a model and single logs.
    """
    from tirelog.physics.effects import BY_ID
    from tirelog.report.build import stored, story_of
    from tirelog.report.sections.models import ladder_section

    command = shlex.join(["tirelog", "campaign", "run", manifest])
    found, climbed = (
        results.get("diagnose"),
        results["ladder"].to_json() if "ladder" in results else None,
    )
    compared = results.get("compare") or (found.before if found is not None else None)
    if compared is None:
        return stored([] if climbed is None else [ladder_section(climbed, command)], [])
    return stored(story_of(compared, found, climbed, lambda name: command, BY_ID), [])


def _pieces(tasks: list[LogTask], observable: str, ledger: Ledger) -> tuple[Pieces, dict[str, Any]]:
    """Each log's share of pieces, and what to say of it."""
    from tirelog.inference.cells.pieces import chosen_logs, joined_pieces, left_out, room, share_out
    from tirelog.vocabulary.observables import SCALARS

    most = room(1 if observable in SCALARS else 2)
    chosen = [tasks[i] for i in chosen_logs(len(tasks), most)]
    sizes, seen = [], dict[str, str]()
    for task in chosen:  # read twice: all of them at once may not fit
        kept = _kept(task, observable, ledger)
        sizes.append(len(kept))
        same = seen.setdefault(_digest(kept.values.tobytes()), task.name)
        if same != task.name:
            raise UsageError(
                f"{task.name} holds the same samples as {same}",
                allowed="each log counts once",
                do="leave one of them out of the manifest",
            )
    parts = [
        _kept(task, observable, ledger).thinned(share, number)
        for number, (task, share) in enumerate(zip(chosen, share_out(sizes, most), strict=True))
    ]
    pieces = joined_pieces(parts)
    said = left_out(len(pieces), sum(sizes), len(parts), len(tasks))
    about = {
        "logs_used": len(parts),
        "logs": len(tasks),
        "cells_used": len(pieces),
        "cells": sum(sizes),
    }
    pieces = replace(pieces, notes=(*pieces.notes, *said))
    return pieces, {**about, "remarks": list(pieces.notes)}


def _kept(task: LogTask, observable: str, ledger: Ledger) -> Pieces:
    """The pieces that a log's worker kept.  ReadError: the file is damaged."""
    name = pieces_name(observable, task.name)
    try:
        return read_pieces(ledger.folder.read(name) or b"")
    except (ValueError, OSError):
        raise ReadError(
            f"{name} is damaged",
            allowed="it is made by campaign run",
            do="remove it and run again",
            file=ledger.folder.root,
        ) from None
