"""The tables by name, for whoever makes several of them from one open recording: campaigns and the report.

    MAKERS[name].rows(recording, options) -> (columns, remarks) of each channel

The functions are the commands' own, with the commands' options under the same names.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tirelog.recording import Recording

Rows = Iterator[tuple[Mapping[str, Any], Sequence[str]]]


@dataclass(frozen=True)
class Maker:
    """How a table is made, the kinds of channel it needs, and the options it takes."""

    rows: Callable[[Recording, Mapping[str, Any]], Rows]
    kinds: tuple[str, ...]
    options: tuple[str, ...] = ()

    def suits(self, recording: Recording) -> bool:
        """True where the recording has the channels that the table is made of."""
        return bool(recording.of_kind(*self.kinds))


def _speed(recording: Recording, options: Mapping[str, Any]) -> Rows:
    from tirelog.estimators.speed import speed_tables

    tables, remarks = speed_tables(recording, bool(options.get("calibrate_radius", False)))
    for columns in tables:
        yield columns, remarks
        remarks = []


def _footprint(recording: Recording, options: Mapping[str, Any]) -> Rows:
    from tirelog.dsp.lowpass import Cutoff
    from tirelog.estimators.footprint_table import footprint_of

    for found in footprint_of(recording, Cutoff.parse(str(options.get("cutoff", "auto")))):
        yield found.columns, found.remarks


def _dissipation(recording: Recording, options: Mapping[str, Any]) -> Rows:
    from tirelog.estimators.dissipation import AVERAGED, STEADY_STEP_M_S
    from tirelog.estimators.dissipation_table import dissipation_of

    step, average = float(options.get("steady_step", STEADY_STEP_M_S)), int(options.get("average", AVERAGED))
    for found in dissipation_of(recording, step, average):
        yield found.columns, found.remarks


def _phase_shift(recording: Recording, options: Mapping[str, Any]) -> Rows:
    from tirelog.estimators.calibration import table
    from tirelog.estimators.calibration_file import read_calibration
    from tirelog.estimators.phase_shift import measure

    calibration = read_calibration(Path(options["calibration"])) if "calibration" in options else None
    for passages in measure(recording, str(options.get("zero", "auto"))):
        yield table(passages, calibration), passages.remarks


_STRAIN = ("fbg_strain", "strain")
MAKERS: dict[str, Maker] = {
    "speed": Maker(_speed, (*_STRAIN, "wheel_encoder", "radial_acceleration"), ("calibrate_radius",)),
    "footprint": Maker(_footprint, _STRAIN, ("cutoff",)),
    "dissipation": Maker(_dissipation, _STRAIN, ("steady_step", "average")),
    "phase-shift": Maker(_phase_shift, ("wheel_encoder",), ("calibration", "zero")),
}
