"""Models over a whole campaign: compare, diagnose and ladder on all its logs together, each under its own conditions.

    logs that could be read --stacks--> discrepancy --> output/models/<model>/{compare,diagnose,ladder}.json

What differs between logs (load, pressure, water, age) is what lets `diagnose` see effects that no single log shows.  A result carries the
key of everything it was made of, so it is made again only when a log, a setup, the model or tirelog changes.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tirelog import __version__
from tirelog.campaign.ledger import Ledger
from tirelog.campaign.manifest import Campaign, CampaignModel
from tirelog.campaign.work import Task
from tirelog.discrepancy import compare, diagnose, ladder, stacks_from_logs
from tirelog.errors import TirelogError, UsageError
from tirelog.files import whole_file
from tirelog.ingest import open_recording
from tirelog.physics.model import Model
from tirelog.recording import Recording
from tirelog.setup import parse_setup

_COMMANDS: dict[str, Callable[..., Any]] = {"compare": compare, "diagnose": diagnose, "ladder": ladder}


def run_models(campaign: Campaign, ledger: Ledger, tasks: list[Task], said: Callable[[str], None]) -> list[str]:
    """Make every model's results that are not made yet; sentences on those that could not be made."""
    readable = [task for task in tasks if (entry := ledger.entry(task.name)) is not None and not entry.error]
    failed = []
    for model in campaign.models:
        try:
            _run(campaign, model, readable, said)
        except TirelogError as problem:
            failed.append(f"{model.file}: {problem.message}")
    return failed


def _run(campaign: Campaign, model: CampaignModel, tasks: list[Task], said: Callable[[str], None]) -> None:
    """One model's results."""
    if not tasks:
        raise UsageError("no log of the campaign could be read, so there is nothing to hold the model against")
    read = Model.load(model.file)
    key = hashlib.sha256(json.dumps([[t.key for t in tasks], model.file.read_text(), __version__]).encode()).hexdigest()
    folder = campaign.output / "models" / model.file.stem
    waiting = [name for name in model.commands if _key_of(folder / f"{name}.json") != key]
    if not waiting:
        return
    stacks = stacks_from_logs(_recordings(tasks), read.observable, None)
    folder.mkdir(parents=True, exist_ok=True)
    for name in waiting:
        result = _COMMANDS[name](stacks, read).to_json()
        with whole_file(folder / f"{name}.json") as part:
            part.write_text(json.dumps({"key": key, **result}, indent=1) + "\n", encoding="utf-8")
        said(f"note: {folder / name}.json" + (f": {result['verdict']}" if "verdict" in result else ""))


def _key_of(path: Path) -> str | None:
    try:
        return str(json.loads(path.read_text("utf-8")).get("key"))
    except (OSError, ValueError, AttributeError):
        return None


def _recordings(tasks: list[Task]) -> Iterator[Recording]:
    """The logs, one open at a time; one without the model's observable (an encoder log, say) is no part of it."""
    for task in tasks:
        with open_recording(task.log, parse_setup(task.setup_text, task.setup_file)) as recording:
            if recording.of_kind("fbg_strain", "strain", "radial_acceleration"):
                yield recording
