"""tirelog: from the recorded logs of a sensorised tire to tidy tables, and from tables to the
physics a model lacks.

What a notebook needs is here, and is loaded when it is first asked for:

    import tirelog

    log = tirelog.open_log("drive.csv.gz")          # its setup beside it, or setup="drive.toml"
    speed = tirelog.speed(log)                      # a pandas.DataFrame that knows its units
    model = tirelog.load_model("beam.toml")
    measured = tirelog.measure(log, model)          # the one way from logs to what models see
    print(tirelog.compare(measured, model).excess_heldout)
    print(tirelog.diagnose(measured, model).sentence)

Units are SI and stand in every name. Every error that a user can mend is a `TirelogError`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from tirelog.version import __version__ as __version__

if TYPE_CHECKING:
    from tirelog.api.answers import compare, diagnose, fit, ladder, measure, propose
    from tirelog.api.logs import open_log
    from tirelog.api.models import contributions, load_model, predict
    from tirelog.api.simulated import simulate
    from tirelog.api.tables import dissipation, footprint, inflation, phase_shift, speed
    from tirelog.data.recording import Conditions, Recording
    from tirelog.errors import TirelogError
    from tirelog.physics.model.model import Model
    from tirelog.physics.model.save import save_model

#: where each public name is defined
_HOMES = {
    "open_log": "tirelog.api.logs",
    "speed": "tirelog.api.tables",
    "footprint": "tirelog.api.tables",
    "dissipation": "tirelog.api.tables",
    "phase_shift": "tirelog.api.tables",
    "inflation": "tirelog.api.tables",
    "load_model": "tirelog.api.models",
    "save_model": "tirelog.physics.model.save",
    "predict": "tirelog.api.models",
    "contributions": "tirelog.api.models",
    "measure": "tirelog.api.answers",
    "fit": "tirelog.api.answers",
    "compare": "tirelog.api.answers",
    "diagnose": "tirelog.api.answers",
    "ladder": "tirelog.api.answers",
    "propose": "tirelog.api.answers",
    "simulate": "tirelog.api.simulated",
    "Conditions": "tirelog.data.recording",
    "Model": "tirelog.physics.model.model",
    "Recording": "tirelog.data.recording",
    "TirelogError": "tirelog.errors",
}

__all__ = [
    "Conditions", "Model", "Recording", "TirelogError", "compare", "contributions",
    "diagnose", "dissipation", "fit", "footprint", "inflation", "ladder", "load_model", "measure",
    "open_log", "phase_shift", "predict", "propose", "save_model", "simulate", "speed",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """A public name, from where it is defined; a table of the register, from its entry."""
    if name in _HOMES:
        value = getattr(import_module(_HOMES[name]), name)
    elif name in (tables := _log_tables()):
        value = import_module("tirelog.api.tables").table_function(tables[name])
    else:
        raise AttributeError(f"module 'tirelog' has no attribute {name!r}")
    globals()[name] = value  # the next time it is found without this
    return value


def _log_tables() -> dict[str, Any]:
    """The register's tables by their names in Python."""
    from tirelog.vocabulary.tables import LOG_TABLES

    return {table.python_name: table for table in LOG_TABLES.values()}


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_log_tables()})
