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
    from tirelog.api.answers import (
        compare,
        diagnose,
        fit,
        ladder,
        measure,
        propose,
        tire_form,
        write_report,
    )
    from tirelog.api.campaigns import campaign_status, run_campaign
    from tirelog.api.logs import (
        check_setup,
        draft_setup,
        ingest,
        load_setup,
        open_log,
        simulate,
    )
    from tirelog.api.models import contributions, load_model, new_model, predict, save_model
    from tirelog.api.parts import save_calibration
    from tirelog.api.pictures import plot, plot_table
    from tirelog.api.tables import (
        calibrate,
        check,
        dissipation,
        footprint,
        inflation,
        phase_shift,
        speed,
    )
    from tirelog.data.recording import Conditions, Recording
    from tirelog.errors import TirelogError
    from tirelog.physics.model.model import Model

#: where each public name is defined
_HOMES = {
    name: module
    for module, names in {
        "tirelog.api.answers": (
            *("compare", "diagnose", "fit", "ladder", "measure", "propose", "tire_form"),
            "write_report",
        ),
        "tirelog.api.campaigns": ("campaign_status", "run_campaign"),
        "tirelog.api.logs": (
            *("check_setup", "draft_setup", "ingest", "load_setup", "open_log", "simulate"),
        ),
        "tirelog.api.models": (
            *("contributions", "load_model", "new_model", "predict", "save_model"),
        ),
        "tirelog.api.parts": ("save_calibration",),
        "tirelog.api.pictures": ("plot", "plot_table"),
        "tirelog.api.tables": (
            *("calibrate", "dissipation", "footprint", "inflation", "phase_shift", "check"),
            "speed",
        ),
        "tirelog.data.recording": ("Conditions", "Recording"),
        "tirelog.errors": ("TirelogError",),
        "tirelog.physics.model.model": ("Model",),
    }.items()
    for name in names
}

__all__ = [
    "Conditions", "Model", "Recording", "TirelogError", "calibrate", "campaign_status", "check",
    "check_setup", "compare", "contributions", "diagnose", "dissipation", "draft_setup", "fit",
    "footprint", "inflation", "ingest", "ladder", "load_model", "load_setup", "measure",
    "new_model", "open_log", "phase_shift", "plot", "plot_table", "predict", "propose",
    "run_campaign", "save_calibration", "save_model", "simulate", "speed", "tire_form",
    "write_report",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """A public name, from where it is defined; a table of the register, from its entry."""
    if name in _HOMES:
        value = getattr(import_module(_HOMES[name]), name)
    elif name in (tables := _log_tables()):
        value = import_module("tirelog.api.tables").table_function(tables[name])
    else:
        raise AttributeError(f"module 'tirelog' has no attribute {name!r}")
    if not isinstance(value, type):
        value = import_module("tirelog.api").in_python(value)
    globals()[name] = value  # the next time it is found without this
    return value


def _log_tables() -> dict[str, Any]:
    """The register's tables by their names in Python."""
    from tirelog.vocabulary.tables import LOG_TABLES

    return {table.python_name: table for table in LOG_TABLES.values()}


def __dir__() -> list[str]:
    return sorted({"__doc__", "__version__", *__all__, *_log_tables()})
