"""The tables of logs as DataFrames; the commands of the same names write them as files.

Each has the columns of its command, one row per passage of the patch, SI units in every name, and
in ``attrs``: ``units`` and ``descriptions`` by column, ``remarks`` on the logs. Nothing is dropped:
``quality`` has the faults of a row; a warning tells of lost input.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import Parameter, Signature, signature
from textwrap import fill, indent
from typing import TYPE_CHECKING, Any

import pandas as pd

from tirelog.api.logs import Logs, Path, SetupLike, each_log
from tirelog.api.parts import calibrated, checked_options, parts_of
from tirelog.tables.frame import (
    Difference,
    as_table,
    differences,
    frame_of,
    of_like_logs,
    read_table,
    summary,
    whole_frame,
)
from tirelog.vocabulary.tables import LOG_TABLES, LogTable

if TYPE_CHECKING:
    from tirelog.wheel.calibration import Calibration


#: an end of a stretch: seconds since the first sample, or a stamp as in the log
Moment = float | str | None


def speed(
    logs: Logs,
    setup: SetupLike | None = None,
    *,
    calibrate_radius: bool = False,
    start: Moment = None,
    stop: Moment = None,
) -> pd.DataFrame:
    """Speed at each passage of the patch, with standard error and acceleration.

    Parameters
    ----------
    logs : str, os.PathLike, Recording or a list of them
        Logs or runs, by path or open.
    setup : str, os.PathLike, Setup or dict, optional
        The setup of logs given by path; without it the TOML file beside each.
    calibrate_radius : bool
        Take the rolling radius from the log's ``vehicle_speed``.
    start, stop : float or str, optional
        Only the rows of this stretch of each log: seconds since the first sample, or stamps as in
        the log. The rows are those of the whole log's table: at the ends of the stretch too they
        use their neighbours.

    Returns
    -------
    pandas.DataFrame
        ``log, channel, revolution, time_s, speed_m_s, period_s, speed_se_m_s,
        acceleration_m_s2`` (positive: faster), ``quality``.

    Raises
    ------
    UsageError
        No channel tells the speed, or there is nothing to calibrate against.
    ReadError, SetupError
        As `open_log`.

    Examples
    --------
    >>> import tirelog
    >>> table = tirelog.speed("sample_data/drive.csv.gz")
    >>> round(float(table.speed_m_s.median()), 1), table.attrs["units"]["speed_m_s"]
    (15.2, 'm/s')
    """
    options = {"calibrate_radius": calibrate_radius, "start": start, "stop": stop}
    return _table("speed", logs, setup, options)


def footprint(
    logs: Logs,
    setup: SetupLike | None = None,
    *,
    cutoff: float | str = "auto",
    friction_ratio: float | None = None,
    start: Moment = None,
    stop: Moment = None,
) -> pd.DataFrame:
    """Contact length, edges and slip onset at each passage of the patch (P2).

    Parameters
    ----------
    logs, setup, start, stop
        As for `speed`.
    cutoff : float or str
        Low-pass of the plain lengths: hertz (``400`` or ``"400Hz"``), multiples of the wheel
        frequency (``"40x"``), ``"rest"`` (by the log's spectrum at rest), or ``"auto"``.
    friction_ratio : float, optional
        Sliding over static friction, for the slip onset; else the setup's, or 0.75 +- 0.13.

    Returns
    -------
    pandas.DataFrame
        ``length_m`` (best estimate) with ``length_se_m`` and ``length_form_se_m``, the plain
        lengths, ``entry_time_s, exit_time_s, edge_asymmetry`` (above 0: exit sharper),
        ``slip_onset_m`` (entry -L to exit +L), beside the columns of every table.

    Raises
    ------
    UsageError
        No strain channel, a wheel that does not turn, or no such cut-off.

    Examples
    --------
    >>> import tirelog
    >>> table = tirelog.footprint("sample_data/drive.csv.gz")
    >>> round(float(table.length_m.median()), 3)
    0.116
    """
    ends = {"start": start, "stop": stop}
    return _table(
        "footprint", logs, setup, {"cutoff": cutoff, "friction_ratio": friction_ratio, **ends}
    )


def dissipation(
    logs: Logs,
    setup: SetupLike | None = None,
    *,
    steady_step_m_s: float | None = None,
    fit: bool = False,
    start: Moment = None,
    stop: Moment = None,
) -> pd.DataFrame:
    """Dissipation factor and specific power of the strain in each revolution (P1).

    Parameters
    ----------
    logs, setup, start, stop
        As for `speed`.
    steady_step_m_s : float, optional
        Largest step of a constant speed between revolutions [m/s].
    fit : bool
        The regressions of factor and specific power on speed instead, one row per channel and
        quantity; none (and a remark) with too few revolutions of constant speed.

    Returns
    -------
    pandas.DataFrame
        ``dissipation_factor_1_m, dissipation_factor_se_1_m, specific_power_m3_s2, steady`` and
        the moving averages, beside the columns of every table.

    Raises
    ------
    UsageError
        No strain channel, a wheel that does not turn, or a number that cannot be.

    Examples
    --------
    >>> import tirelog
    >>> table = tirelog.dissipation("sample_data/drive.csv.gz")
    >>> round(1e3 * float(table.dissipation_factor_1_m.median()), 2)
    0.16
    """
    options = {"steady_step": steady_step_m_s, "fit": fit, "start": start, "stop": stop}
    return _table("dissipation", logs, setup, options)


def phase_shift(
    logs: Logs,
    setup: SetupLike | None = None,
    *,
    calibration: Path | Calibration | None = None,
    zero: str | float = "auto",
    start: Moment = None,
    stop: Moment = None,
) -> pd.DataFrame:
    """Patch width and phase shift in wheel angle, from encoder and accelerometer (P4).

    Parameters
    ----------
    logs, setup, start, stop
        As for `speed`.
    calibration : str, os.PathLike or Calibration, optional
        Speed maps, cross-talk and force maps to apply, which `calibrate` learns.
    zero : str or float
        Where the shift is zero: ``"auto"``, ``"none"``, a speed [m/s] or ``"START:STOP"`` [s].

    Returns
    -------
    pandas.DataFrame
        ``entry_angle_deg, exit_angle_deg, patch_width_deg, phase_shift_deg`` (negative: braking)
        with standard errors, detrended and corrected; with force maps the forces [N].

    Raises
    ------
    SetupError
        No encoder or no accelerometer.
    DataLoss
        The encoder shows no teeth, or the accelerometer no patch.

    Examples
    --------
    >>> import tirelog
    >>> table = tirelog.phase_shift("sample_data/encoder.h5")
    >>> round(float(table.patch_width_deg.median()), 1)
    13.4
    """
    options = {"calibration": calibration, "zero": zero, "start": start, "stop": stop}
    return _table("phase-shift", logs, setup, options)


def calibrate(
    logs: Logs, setup: SetupLike | None = None, *, forces: bool = False, zero: str = "auto"
) -> Calibration:
    """How patch width and phase shift change with speed, with torque and, if asked, with force.

    Parameters
    ----------
    logs, setup
        As for `speed`: drives whose tire, pressure and wheel are those to be calibrated.
    forces : bool
        Also maps from width and shift to the logs' force channels.
    zero : str
        As for `phase_shift`.

    Returns
    -------
    Calibration
        For `phase_shift`; `save_calibration` writes it as a file.

    Raises
    ------
    UsageError
        Too few passages, or no force channel to learn from.

    Examples
    --------
    >>> import tirelog
    >>> round(tirelog.calibrate("sample_data/encoder_ramp.h5").patch_width_deg, 1)
    13.4
    """
    options = {"zero": zero, "forces": True}
    parts = (p for r in each_log(logs, setup) for p in parts_of(r, "phase-shift", options))
    return calibrated(parts, forces=forces)[0]


def inflation(logs: Logs, setup: SetupLike | None = None) -> pd.DataFrame:
    """Strain against inflation pressure in a static test: slope, linearity, leaks at stops.

    Parameters
    ----------
    logs, setup
        As for `speed`.

    Returns
    -------
    pandas.DataFrame
        One row per stretch (the whole, ramps, stops): ``strain_slope_1_Pa`` with its error,
        ``nonlinearity``, ``leak``.

    Raises
    ------
    UsageError
        The wheel turns, or the strain goes up and down: no test at rest.

    Examples
    --------
    >>> import tirelog
    >>> table = tirelog.inflation("sample_data/inflation.csv.gz")
    >>> round(1e11 * float(table.strain_slope_1_Pa[0]), 1)  # microstrain per bar
    1000.1
    """
    return _table("inflation", logs, setup, {})


def table_function(table: LogTable) -> Callable[..., pd.DataFrame]:
    """The function of a table that has none above: its options as keywords, as for `inflation`."""

    def made(logs: Logs, setup: SetupLike | None = None, **options: Any) -> pd.DataFrame:
        return _table(table.name, logs, setup, options)

    meanings = "".join(f"{option.name}\n    {option.help}\n" for option in table.asked)
    columns = fill(f"``{', '.join(table.columns)}``.", 90)
    made.__name__ = made.__qualname__ = table.python_name
    made.__doc__ = (
        f"{table.says}\n\nParameters\n----------\nlogs, setup\n    As for `speed`.\n{meanings}\n"
        f"Returns\n-------\npandas.DataFrame\n{indent(columns, '    ')}\n"
    )
    shared = [p for p in signature(made).parameters.values() if p.kind != Parameter.VAR_KEYWORD]
    own = [
        Parameter(o.name, Parameter.KEYWORD_ONLY, default=None, annotation=f"{o.kind.__name__}")
        for o in table.asked
    ]
    vars(made).update(__signature__=Signature([*shared, *own]))  # what help() shows
    return made


def _table(
    name: str, logs: Logs, setup: SetupLike | None, options: Mapping[str, Any]
) -> pd.DataFrame:
    """One table of all logs."""
    checked_options(name, options)  # before a log is opened
    parts, remarks = [], []
    for recording in each_log(logs, setup):
        remarks += [f"{recording.log}: {remark}" for remark in recording.remarks]
        for part in parts_of(recording, name, options):
            if part.columns:
                parts.append(frame_of(part.columns))
            remarks += [f"{recording.log}: {remark}" for remark in part.remarks]
    frame = whole_frame(LOG_TABLES[name].given(options), parts)
    frame.attrs["remarks"] = remarks
    return frame


# ---- Does a table still hold what an earlier one held?


@dataclass(frozen=True)
class TableCheck:
    """What moved between two tables, largest first, and sentences on it."""

    differences: tuple[Difference, ...]
    remarks: tuple[str, ...]

    @property
    def columns(self) -> dict[str, Any]:
        """Columns of `tirelog check`: a row per difference."""
        return as_table(list(self.differences))


def check(table: Path, against: Path, tolerance: Mapping[str, float] | None = None) -> TableCheck:
    """The rows of a table that are not as in an earlier one.

    Parameters
    ----------
    table, against : str or os.PathLike
        Tables as files; ``"-"`` is csv on standard input. Rows are matched by the log's path, or,
        if the tables share no path, by the log's file name; then there is a remark.
    tolerance : mapping of str to float, optional
        Absolute ones by column, in place of the columns' own.

    Returns
    -------
    TableCheck
        ``differences``, none if the tables agree; ``columns``; ``remarks``.

    Raises
    ------
    ReadError
        One of them is no table.
    UsageError
        A tolerance for a column that is not there.
    """
    new, old, remark = of_like_logs(read_table(os.fspath(table)), read_table(os.fspath(against)))
    found = differences(new, old, tolerance or {})
    return TableCheck(tuple(found), tuple(line for line in (remark, summary(found)) if line))
