"""The functions of commands and notebooks, by subject; a part is imported when it is first named.

So a command calls `api.models.load_model`, and help answers before any science is imported.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from importlib import import_module
from typing import TYPE_CHECKING, Any

from tirelog.errors import TirelogError

if TYPE_CHECKING:
    from tirelog.api import answers, campaigns, logs, models, parts, pictures, tables

__all__ = ["answers", "campaigns", "logs", "models", "parts", "pictures", "tables"]


def __getattr__(name: str) -> Any:
    """A part of this package."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f"{__name__}.{name}")


#: options whose argument in Python has another name
_ARGUMENTS = {
    "-o": "output", "--plot": "path", "--set": "values", "--from": "start", "--to": "stop",
    "--steady-step": "steady_step_m_s",
}  # fmt: skip
#: a command, which stays, or an option
_OPTION = re.compile(r"`[^`]*`|(?<![\w-])(?:--[a-z][a-z-]+|-o\b)")


def in_python(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function, whose errors name its arguments in place of a command's options."""

    @wraps(function)
    def called(*given: Any, **named: Any) -> Any:
        try:
            return function(*given, **named)
        except TirelogError as problem:
            parts = problem.what, problem.allowed, problem.do, problem.message
            problem.what, problem.allowed, problem.do, problem.message = (
                _OPTION.sub(_argument, part) for part in parts
            )
            raise

    called.__module__ = "tirelog"  # where pickle finds it
    return called


def _argument(found: re.Match[str]) -> str:
    """The argument of an option; a command as it is."""
    option = found[0]
    if option.startswith("`"):
        return option
    return _ARGUMENTS.get(option, option.lstrip("-").replace("-", "_"))
