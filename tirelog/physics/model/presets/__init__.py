"""Models with the numbers of the papers' tables; each file names its table and what was corrected.

A new one is a model file beside these, and its name in `PRESETS`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tirelog.errors import refuse_unknown
from tirelog.physics.model.file import load_model
from tirelog.physics.model.model import Model

PRESETS = ("P1", "P2", "P3")


def preset_model(
    name: str, *, observable: str | Sequence[str] | None = None, contact: str | None = None
) -> Model:
    """The model that a paper's table describes, without effects.

    With another observable or contact than the paper's, the numbers that such a model has.

    UsageError: no such preset.
    """
    refuse_unknown(name, PRESETS, f"unknown preset {name!r}", do="choose one of them")
    printed = load_model(Path(__file__).with_name(f"{name}.toml"))
    if observable in (None, printed.observable) and contact in (None, printed.contact):
        return printed
    other = Model.new(printed.carcass, observable or printed.observable, contact or printed.contact)
    return other.with_values({k: v for k, v in printed.values.items() if k in other.parameters})
