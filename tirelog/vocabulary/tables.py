"""Every table that is made of a log, once: its columns, its options, and who makes it.

From an entry come the command `tirelog NAME` with its help, and `tirelog.NAME` in Python. So do the
table's place in `tirelog tables`, campaigns and `check`, and its section of docs/tables.md.
`columns` has the meaning of each column.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass
from numbers import Integral, Real
from os import PathLike
from pathlib import Path

from tirelog.errors import UsageError
from tirelog.vocabulary.kinds import ACCELERATION_KINDS, STRAIN_KINDS

# ---- Which pictures there are of a log, and which tables of errors, by name.
#
# `plot --kind` takes the one, the first without it, `compare --by` the other.


LOG_PICTURES: Mapping[str, str] = {
    "signal": "every channel over time, with the passages of the patch marked",
    "waterfall": "strain over angle and revolution, in colour",
    "polar": "mean strain around the wheel by speed, with the patch",
    "edges": "entry and exit edge close up by speed, with bands and the edges found",
}
#: tables of errors that `compare` has of obstacles, and all that it can have
BY_OBSTACLE = ("hit",)
ERRORS_BY = ("revolution", "angle", "speed", "regime", "conditions", *BY_OBSTACLE)
#: of files that a picture can be written to
SUFFIXES = (".png", ".svg", ".pdf")


def refuse_no_picture(path: Path) -> None:
    """UsageError: the path's suffix is not a picture's."""
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(
            f"picture {path}: suffix {path.suffix!r}",
            allowed=f"allowed are {', '.join(SUFFIXES)}",
            do="rename it",
        )


def no_matplotlib() -> UsageError:
    """The error that says how to come by what draws pictures."""
    return UsageError(
        "a picture needs matplotlib",
        allowed="allowed without it are tables",
        do="install it: pip install 'tirelog[plot]'",
    )


@dataclass(frozen=True)
class TableOption:
    """A setting of a table.

    name     its keyword in Python and in a campaign's manifest
    flag     how the command calls it
    kind     float, int, str, Path, or bool, which is a switch
    help     what it does, with its unit
    gives    the table of `columns.TABLES` that it gives in place of its own, if it does
    """

    name: str
    flag: str
    kind: type[float | int | str | Path | bool]
    help: str
    gives: str = ""

    @property
    def allowed(self) -> str:
        """Its allowed values, as a clause of an error."""
        return f"allowed is {_KINDS[self.kind]} ({self.help.rstrip('.')})"

    def fits(self, value: object) -> bool:
        """True if the value is of its kind; whether a table can be made with it is not known.

        In place of a file's path a dataclass is allowed: the content of the file.
        """
        if self.kind is bool or isinstance(value, bool):
            return self.kind is bool and isinstance(value, bool)
        if isinstance(value, Real):
            whole = isinstance(value, Integral) and abs(int(value)) < 2**31
            return whole if self.kind is int else self.kind is not Path and math.isfinite(value)
        if isinstance(value, str):
            return self.kind in (str, Path) and value.isprintable() and value != ""
        return self.kind is Path and (isinstance(value, PathLike) or is_dataclass(value))


#: what an option of a kind may be; "none" and "auto" are texts, a speed as text may be a number
_KINDS: Mapping[type, str] = {
    bool: "true or false",
    float: "a number",
    int: "a whole number",
    str: "text or a number",
    Path: "the path of a file",
}


@dataclass(frozen=True)
class LogTable:
    """A table that is made of a recording.

    says     one sentence for the help: what its rows are
    kinds    of channels that it is made of; one of these has to be in the log
    columns  their names, in order
    options  its settings
    views    switches for other rows of the same, of the command and in Python alone: no settings
    made_by  "module:function", called with a Recording and the options as keywords. It gives what
             has `columns` (by name, arrays of one length) and `remarks` (sentences), as a rule once
             per channel. Empty: `products` makes the table, together with others
    checked_by  "module:function", called with the options as keywords before any log is opened; it
             raises UsageError for options that no log can be made a table with
    picture  "module:function" that gives the figure of all that was kept of the parts: the command
             then has --plot
    sketch   "module:function" for what the picture keeps of a part while its log is open,
             (recording, part); empty: (recording, part) themselves
    driven   False for a table that is only made if it is asked for by name, such as that of a
             static test: not by `tables` without names, campaigns and reports
    rows_of  kinds of channel that its rows are of, if others than `kinds`
    stretch  "rows": those outside of a stretch are left out; "own": its function takes `start` and
             `stop` [s]; "none": its rows are no moments
    drawn    "whole" for a picture of the whole log, whatever the stretch
    """

    name: str
    says: str
    kinds: tuple[str, ...]
    columns: tuple[str, ...]
    options: tuple[TableOption, ...] = ()
    views: tuple[TableOption, ...] = ()
    made_by: str = ""
    checked_by: str = ""
    picture: str = ""
    sketch: str = ""
    driven: bool = True
    rows_of: tuple[str, ...] = ()
    stretch: str = "rows"
    drawn: str = "rows"

    @property
    def asked(self) -> tuple[TableOption, ...]:
        """All options of its command: settings, views, and the ends of a stretch of the log."""
        ends = () if self.stretch == "none" else STRETCH
        return (*self.options, *self.views, *ends)

    @property
    def python_name(self) -> str:
        """Its function's name in `tirelog`."""
        return self.name.replace("-", "_")

    def given(self, options: Mapping[str, object]) -> str:
        """The table of `columns.TABLES` that these options give."""
        views = (view.gives for view in self.views if view.gives and options.get(view.name))
        return next(views, self.name)


#: a stretch of the log, for every table whose rows are moments
STRETCH = (
    TableOption(
        "start",
        "--from",
        str,
        "Only rows from this moment on: seconds since the first sample, or an ISO stamp.",
    ),
    TableOption("stop", "--to", str, "Only rows before this moment, likewise."),
)

_BEGIN = ("log", "channel", "revolution", "time_s", "speed_m_s")


def _revolutions(*own: str) -> tuple[str, ...]:
    """A table with a row per revolution: the common beginning, its own columns, and the quality."""
    return (*_BEGIN, *own, "quality")


_ALL = (
    LogTable(
        "speed",
        "Speed at each passage of the patch, with standard error and acceleration.",
        (*STRAIN_KINDS, "wheel_encoder", "radial_acceleration"),
        _revolutions("period_s", "speed_se_m_s", "acceleration_m_s2"),
        (
            TableOption(
                "calibrate_radius",
                "--calibrate-radius",
                bool,
                "Take the rolling radius from the log's vehicle_speed, with its error.",
            ),
        ),
        picture="tirelog.plots.tables:rows_picture",
    ),
    LogTable(
        "footprint",
        "Contact length, edges and slip onset at each passage of the patch.",
        (*STRAIN_KINDS, *ACCELERATION_KINDS),
        _revolutions(
            "length_m", "length_se_m", "length_form_se_m", "length_d2_m", "length_d2_se_m",
            "length_d1_m", "length_d1_se_m", "entry_time_s", "exit_time_s", "edge_asymmetry",
            "slip_onset_m", "slip_onset_se_m", "slip_onset_reason",
        ),
        (
            TableOption(
                "cutoff",
                "--cutoff",
                str,
                "Low-pass of the plain lengths: auto, rest (by the log's spectrum at rest), hertz "
                "(400Hz), or multiples of the wheel frequency (40x).",
            ),
            TableOption(
                "friction_ratio",
                "--friction-ratio",
                float,
                "Sliding over static friction, for the slip onset; default the setup's, or "
                "0.75 +- 0.13.",
            ),
        ),
        picture="tirelog.plots.tables:footprint_picture",
        sketch="tirelog.plots.tables:footprint_sketch",
        drawn="whole",
    ),
    LogTable(
        "dissipation",
        "Dissipation factor and power of the strain in each revolution.",
        STRAIN_KINDS,
        _revolutions(
            "dissipation_factor_1_m", "dissipation_factor_se_1_m", "specific_power_m3_s2",
            "steady", "dissipation_factor_mean_1_m", "specific_power_mean_m3_s2", "strip_power_W",
            "strip_rolling_resistance_N", "strip_rolling_resistance_coefficient",
        ),
        (
            TableOption(
                "steady_step",
                "--steady-step",
                float,
                "Largest step of a constant speed between revolutions, m/s; default 0.08.",
            ),
        ),
        views=(
            TableOption(
                "fit",
                "--fit",
                bool,
                "The regressions of factor and specific power on speed instead.",
                gives="dissipation-fit",
            ),
        ),
        picture="tirelog.plots.tables:dissipation_picture",
        sketch="tirelog.plots.tables:dissipation_sketch",
        drawn="whole",
    ),
    LogTable(
        "phase-shift",
        "Patch width and phase shift from a wheel encoder and an in-tire accelerometer.",
        ("wheel_encoder",),
        _revolutions(
            "entry_angle_deg", "exit_angle_deg", "patch_width_deg", "patch_width_se_deg",
            "phase_shift_deg", "phase_shift_se_deg", "patch_width_detrended_deg",
            "phase_shift_detrended_deg", "phase_shift_corrected_deg", "vertical_force_N",
            "vertical_force_se_N", "longitudinal_force_N", "longitudinal_force_se_N",
        ),
        (
            TableOption("calibration", "--calibration", Path, "Calibration file to apply."),
            TableOption(
                "zero",
                "--zero",
                str,
                "Zero of the phase shift: auto, none, a speed in m/s, or START:STOP in s.",
            ),
        ),
        drawn="whole",
        picture="tirelog.plots.tables:phase_shift_picture",
        rows_of=("radial_acceleration",),
    ),
    LogTable(
        "slip",
        "Longitudinal slip of each turn of the wheel, from the vehicle's speed.",
        ("vehicle_speed",),
        _revolutions("vehicle_speed_m_s", "slip", "slip_se", "slip_delay_se"),
        views=(
            TableOption(
                "fit",
                "--fit",
                bool,
                "The slope of slip over force, and the road's friction by it, instead.",
                gives="slip-fit",
            ),
        ),
        made_by="tirelog.strain.slip:slip_of",
        driven=False,
    ),
    LogTable(
        "grip",
        "Adhesion share of the patch, friction used and friction left, from the slip onset.",
        STRAIN_KINDS,
        _revolutions(
            "adhesion_share", "adhesion_share_se", "brush_slip", "friction_used",
            "friction_used_se", "grip_left", "vertical_force_N", "vertical_force_se_N",
            "longitudinal_force_N", "longitudinal_force_se_N", "slip_onset_reason",
        ),
        (
            TableOption(
                "static_friction", "--static-friction", float, "Static friction; default 0.8."
            ),
            TableOption(
                "sliding_friction",
                "--sliding-friction",
                float,
                "Sliding friction; default the static one times the ratio of footprint.",
            ),
            TableOption(
                "stiffness_ratio",
                "--stiffness-ratio",
                float,
                "Stiffness of the tread over that of the brush model; default 1.",
            ),
            TableOption(
                "load_exponent",
                "--load-exponent",
                float,
                "Exponent of the load in the patch length; default 0.5.",
            ),
        ),
        made_by="tirelog.strain.slip:grip_of",
        checked_by="tirelog.strain.slip:refuse_frictions",
        driven=False,
    ),
    LogTable(
        "strain-shift",
        "Patch width and phase shift from a wheel encoder and a strain sensor.",
        ("wheel_encoder",),
        _revolutions(
            "entry_angle_deg", "exit_angle_deg", "patch_width_deg", "patch_width_se_deg",
            "phase_shift_deg", "phase_shift_se_deg", "wheel_speed_m_s",
        ),
        made_by="tirelog.strain.slip:strain_shift_of",
        driven=False,
        rows_of=STRAIN_KINDS,
    ),
    LogTable(
        "wheel-angle",
        "Encoder signal, wheel speed and wheel angle at each sample, by default of 0.1 s.",
        ("wheel_encoder",),
        _revolutions("encoder_signal", "turned_deg"),
        (
            TableOption("every", "--every", int, "Keep every Nth sample."),
        ),
        made_by="tirelog.wheel.phase_shift:wheel_angle_of",
        picture="tirelog.plots.tables:rows_picture",
        driven=False,
        stretch="own",
    ),
    LogTable(
        "inflation",
        "Strain against inflation pressure in a static test: slope, linearity, leaks at stops.",
        STRAIN_KINDS,
        _revolutions(
            "stretch", "duration_s", "inflation_pressure_Pa", "pressure_change_Pa", "strain",
            "strain_se", "strain_change", "strain_slope_1_Pa", "strain_slope_se_1_Pa",
            "strain_rate_1_s", "nonlinearity", "leak", "leak_se",
        ),
        made_by="tirelog.strain.inflation:inflation_of",
        picture="tirelog.plots.tables:inflation_picture",
        driven=False,
        stretch="none",
    ),
)  # fmt: skip

#: in the order of `tables`; those that are only made by name behind
LOG_TABLES: Mapping[str, LogTable] = {table.name: table for table in _ALL}
#: how a table may be written
TABLE_FORMATS = ("csv", "ndjson", "parquet", "json")
