"""What a campaign calls its files, and the folder of this machine in which they are made."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

from tirelog.storage.documents import json_value
from tirelog.storage.whole import output_error

#: what stands in a campaign's folder beside its results
HIDDEN = ".tirelog"


#: what a campaign writes besides, by its name in the folder
_RESULTS = re.compile(
    r"summary\.csv|table=[^/]+/log=[^/]+/part\.parquet|models/[^/]+/(page|compare|diagnose|ladder)\.json"
)


def is_own(name: str) -> bool:
    """Whether a file of the output folder is the campaign's.

    A result, or anything in its hidden folder.
    """
    return name.startswith(f"{HIDDEN}/") or _RESULTS.fullmatch(name) is not None


def json_of(data: bytes | None) -> dict[str, Any]:
    """A small file of ours as a table; empty if it is not there or was damaged."""
    try:
        content = json_value(data or b"{}")
    except ValueError:
        return {}
    return content if isinstance(content, dict) else {}


def swept(temporary: Path) -> None:
    """An empty folder at `temporary`.  A link in its place is removed, and not followed."""
    try:
        if temporary.is_symlink():
            temporary.unlink()
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir(parents=True)
    except OSError as problem:
        raise output_error(temporary, problem) from problem


def temporary_for(url: str) -> Path:
    """The folder of this machine for a campaign's temporary runs.

    For a campaign whose results are elsewhere. It is always the same one, so that the next run
    sweeps what a kill left.
    """
    import hashlib

    user = os.getuid() if hasattr(os, "getuid") else 0
    return (
        Path(tempfile.gettempdir())
        / f"tirelog-campaign-{user}-{hashlib.sha256(url.encode()).hexdigest()[:16]}"
    )
