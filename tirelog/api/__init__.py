"""What commands and notebooks ask, by what it is about; a part is imported when it is first named.

So a command says `api.models.load_model`, and help answers before any science is there.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tirelog.api import answers, campaigns, logs, models, parts, tables

__all__ = ["answers", "campaigns", "logs", "models", "parts", "tables"]


def __getattr__(name: str) -> Any:
    """A part of this package."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f"{__name__}.{name}")
