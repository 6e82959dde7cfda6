"""What a shell may complete: values that are known by name.

Nothing here reads a log: an answer has to come while one types.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from tirelog.vocabulary.tables import TABLE_FORMATS


def formats(incomplete: str) -> list[str]:
    """Formats of tables."""
    return _beginning(TABLE_FORMATS, incomplete)


def effects(incomplete: str) -> list[str]:
    """Effects of the catalogue."""
    from tirelog.api.models import catalogue_with

    return _beginning(tuple(catalogue_with()), incomplete)


def nuisances(incomplete: str) -> list[str]:
    """Nuisances of a model."""
    from tirelog.api.models import NUISANCES

    return _beginning(tuple(NUISANCES), incomplete)


def presets(incomplete: str) -> list[str]:
    """Presets of a new model."""
    from tirelog.api.models import PRESETS

    return _beginning(PRESETS, incomplete)


def tables(incomplete: str) -> list[str]:
    """Tables of a log."""
    from tirelog.vocabulary.tables import LOG_TABLES

    return _beginning(tuple(LOG_TABLES), incomplete)


def channels(ctx: Any, incomplete: str) -> list[str]:
    """Channels of the setup that is given, or stands beside the first log."""
    from tirelog.data.setup import load_setup, setup_beside
    from tirelog.errors import TirelogError

    found: tuple[str, ...] = ()
    with suppress(TirelogError, OSError):
        logs = ctx.params.get("logs") or []
        place = ctx.params.get("setup") or (setup_beside(logs[0]) if logs else None)
        if place is not None:
            found = tuple(load_setup(place).channels)
    return _beginning(found, incomplete)


def _beginning(words: tuple[str, ...], incomplete: str) -> list[str]:
    return [word for word in words if word.startswith(incomplete)]
