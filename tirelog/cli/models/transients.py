"""What `compare` shows of logs whose setup has a [road].

The model's answer to the obstacles, hit by hit, and its picture.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tirelog.diagnosis.obstacles.compare import TransientComparison

TABLES = ("hit", "time", "frequency")


def transients_page(result: TransientComparison) -> None:
    """The hits to read."""
    from tirelog.cli.models.answers_page import _console, _table
    from tirelog.vocabulary.observables import shown

    out = _console()
    factor, unit = shown(result.observable, result.unit)
    total = result.to_json()
    out.print(
        f"obstacles: {len(result.hits)} hits; the model covers {100.0 * total['covered']:.0f} % "
        "of what they added "
        f"({total['nuisance_parameters']} nuisance numbers: when, phase, level and alignment of "
        "each)"
    )
    names = ["added", "missed", "rmse", "rmse_steady", "noise_floor", "excess"]
    rows = [
        [
            f"  {row['log']} at {row['time_s']:.4f} +- {row['time_se_s']:.1g} s",
            row["speed_m_s"],
            *(row[name] * factor for name in names),
        ]
        for row in result.tables["hit"]
    ]
    out.print(
        _table([f"in {unit}", "m/s", "added", "missed", "rmse", "steady", "floor", "excess"], rows)
    )


def draw_transients(result: TransientComparison, path: Path) -> Path:
    """The picture of the hits, beside the comparison's: NAME_transient.SUFFIX."""
    from tirelog.plots.models.transient import draw

    beside = path.with_name(f"{path.stem}_transient{path.suffix}")
    draw(result, beside)
    return beside
