"""The tables of logs as DataFrames; the commands of the same names write them as files.

Each has the columns of its command, one row per passage of the patch, SI units in every name, and
in ``attrs``: ``units`` and ``descriptions`` by column, ``remarks`` on the logs. Nothing is dropped:
what is wrong with a row stands in its ``quality``; input that was lost is warned of.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from inspect import Parameter, Signature, signature
from textwrap import fill, indent
from typing import TYPE_CHECKING, Any

import pandas as pd

from tirelog.api.logs import Logs, Path, each_log
from tirelog.data.setup import Setup
from tirelog.products import Part, checked, tables_of
from tirelog.strain.dissipation_table import regressions
from tirelog.tables.frame import frame_of, whole_frame
from tirelog.vocabulary.tables import LogTable

if TYPE_CHECKING:
    from tirelog.wheel.calibration import Calibration

#: columns, None if there are none, and remarks
Rows = tuple[Mapping[str, Any] | None, Sequence[str]]


def speed(
    logs: Logs, setup: Path | Setup | None = None, *, calibrate_radius: bool = False
) -> pd.DataFrame:
    """Speed at each passage of the patch, with standard error and acceleration.

    Parameters
    ----------
    logs : str, os.PathLike, Recording or a list of them
        Logs or runs, by path or open.
    setup : str, os.PathLike or Setup, optional
        The setup of logs given by path; without it the TOML file beside each.
    calibrate_radius : bool
        Take the rolling radius from the log's ``vehicle_speed``.

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
    return _table("speed", logs, setup, {"calibrate_radius": calibrate_radius})


def footprint(
    logs: Logs, setup: Path | Setup | None = None, *, cutoff: str = "auto"
) -> pd.DataFrame:
    """Contact length, edges and slip onset at each passage of the patch (P2).

    Parameters
    ----------
    logs, setup
        As for `speed`.
    cutoff : str
        Low-pass of the plain lengths: ``"auto"``, hertz (``"400Hz"``) or multiples of the wheel
        frequency (``"40x"``).

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
    return _table("footprint", logs, setup, {"cutoff": cutoff})


def dissipation(
    logs: Logs,
    setup: Path | Setup | None = None,
    *,
    steady_step_m_s: float | None = None,
    averaged: int | None = None,
    fit: bool = False,
) -> pd.DataFrame:
    """Dissipation factor and specific power of the strain in each revolution (P1).

    Parameters
    ----------
    logs, setup
        As for `speed`.
    steady_step_m_s : float, optional
        Largest step of a constant speed between revolutions [m/s].
    averaged : int, optional
        Revolutions of a moving average.
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
    options = {"steady_step": steady_step_m_s, "average": averaged}
    if not fit:
        return _table("dissipation", logs, setup, options)
    return _table("dissipation", logs, setup, options, called="dissipation-fit", rows=_regressions)


def _regressions(part: Part, log: str) -> Rows:
    return regressions(log, part.found)


def phase_shift(
    logs: Logs,
    setup: Path | Setup | None = None,
    *,
    calibration: Path | Calibration | None = None,
    zero: str | float = "auto",
) -> pd.DataFrame:
    """Patch width and phase shift in wheel angle, from encoder and accelerometer (P4).

    Parameters
    ----------
    logs, setup
        As for `speed`.
    calibration : str, os.PathLike or Calibration, optional
        Speed maps, cross-talk and force maps to apply (``tirelog phase-shift --calibrate``).
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
    13.2
    """
    return _table("phase-shift", logs, setup, {"calibration": calibration, "zero": zero})


def inflation(
    logs: Logs,
    setup: Path | Setup | None = None,
    *,
    from_Pa: float | None = None,
    to_Pa: float | None = None,
) -> pd.DataFrame:
    """Strain against inflation pressure in a static test: slope, linearity, leaks at stops.

    Parameters
    ----------
    logs, setup
        As for `speed`.
    from_Pa, to_Pa : float, optional
        Pressures at the beginning and the end [Pa], if no channel records them.

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
    return _table("inflation", logs, setup, {"from_Pa": from_Pa, "to_Pa": to_Pa})


def table_function(table: LogTable) -> Callable[..., pd.DataFrame]:
    """The function of a table that has none above: its options as keywords, as for `inflation`."""

    def made(logs: Logs, setup: Path | Setup | None = None, **options: Any) -> pd.DataFrame:
        return _table(table.name, logs, setup, options)

    told = "".join(f"{option.name}\n    {option.help}\n" for option in table.options)
    columns = fill(f"``{', '.join(table.columns)}``.", 90)
    made.__name__ = made.__qualname__ = table.python_name
    made.__doc__ = (
        f"{table.says}\n\nParameters\n----------\nlogs, setup\n    As for `speed`.\n{told}\n"
        f"Returns\n-------\npandas.DataFrame\n{indent(columns, '    ')}\n"
    )
    shared = [p for p in signature(made).parameters.values() if p.kind != Parameter.VAR_KEYWORD]
    own = [
        Parameter(o.name, Parameter.KEYWORD_ONLY, default=None, annotation=f"{o.kind.__name__}")
        for o in table.options
    ]
    vars(made).update(__signature__=Signature([*shared, *own]))  # what help() shows
    return made


def _own(part: Part, log: str) -> Rows:
    return part.columns, ()


def _table(
    name: str,
    logs: Logs,
    setup: Path | Setup | None,
    options: Mapping[str, Any],
    *,
    called: str | None = None,
    rows: Callable[[Part, str], Rows] = _own,
) -> pd.DataFrame:
    """One table of all logs; `rows` (columns, remarks) of each part, as the table `called`."""
    wanted = checked({name: {k: v for k, v in options.items() if v is not None}})
    parts, remarks = [], []
    for recording in each_log(logs, setup):
        remarks += [f"{recording.log}: {remark}" for remark in recording.remarks]
        for part in tables_of(recording, wanted):
            columns, more = rows(part, recording.log)
            if columns is not None:
                parts.append(frame_of(columns))
            remarks += [f"{recording.log}: {remark}" for remark in (*part.remarks, *more)]
    frame = whole_frame(called or name, parts)
    frame.attrs["remarks"] = remarks
    return frame
