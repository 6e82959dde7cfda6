"""Calibration files: versioned TOML.

Checked key by key when read, so that a foreign file cannot do harm.

Calibration --write_calibration--> text, whole or not at all --read_calibration--> Calibration
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.errors import SetupError
from tirelog.storage.schema import FLAG, Document, FilePlace, KeyKind, Table, ValueKind, number
from tirelog.storage.whole import toml_text, whole_file
from tirelog.wheel.calibration import Calibration, ForceMap, SpeedMap

#: of the file's layout; another one is refused
VERSION = 1


def _is_array(ndim: int, value: Any) -> bool:
    """Whether a value is an array of finite numbers, none of them huge."""
    if not isinstance(value, list):
        return False
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        return False
    return (
        array.ndim == ndim and bool(np.isfinite(array).all()) and bool((abs(array) <= 1e15).all())
    )


def _is_covariance(value: Any) -> bool:
    """Whether a value is a square array without negative variances."""
    if not _is_array(2, value):
        return False
    array = np.array(value, dtype=float)
    rows, columns = array.shape
    least = -1e-9 * max(float(abs(array).max(initial=0.0)), 1e-300)
    return rows == columns > 1 and bool(np.linalg.eigvalsh(0.5 * (array + array.T)).min() >= least)


_COVARIANCE = ValueKind(
    "a covariance of finite numbers: symmetric, no negative variances",
    _is_covariance,
    partial(np.array, dtype=float),
)
_COEFFICIENTS = ValueKind(
    "two or three finite numbers",
    lambda value: _is_array(1, value) and len(value) in (2, 3),
    partial(np.array, dtype=float),
)
_SLOPE, _BOUND, _SMALL = number(-1e3, 1e3), number(-1e4, 1e4), number(0.0, 1e3)
_ANGLE = number(0.0, 360.0)
_MAP: dict[str, KeyKind] = {
    "linear_deg_s_m": _SLOPE,
    "quadratic_deg_s2_m2": _SLOPE,
    "covariance": _COVARIANCE,
    "low_m_s": _BOUND,
    "high_m_s": _BOUND,
    "rms_deg": _ANGLE,
    "passages": replace(number(0, 1e12), made=int),
}
_FORCE: dict[str, KeyKind] = {
    "centre_deg": _BOUND,
    "coefficients_N": _COEFFICIENTS,
    "covariance": _COVARIANCE,
    "low_deg": _BOUND,
    "high_deg": _BOUND,
    "rms_N": number(0.0, 1e7),
}
_PATCH: dict[str, KeyKind] = {"at_reference_deg": _ANGLE, **_MAP}
_FORCE_TABLE = Table(_FORCE, needed=tuple(_FORCE))
_CALIBRATION = Table(
    {
        "version": ValueKind(f"{VERSION}", lambda version: version == VERSION),
        "reference_speed_m_s": number(0.0, 200.0),
        "phase_shift": Table(_MAP, needed=tuple(_MAP)),
        "patch_width": Table(_PATCH, needed=tuple(_PATCH)),
        "crosstalk": Table({"k": _SLOPE, "se": _SMALL}, needed=("k", "se")),
        "telemetry_delay": Table(
            {"delay_s": _SLOPE, "se_s": _SMALL, "beside_force": FLAG}, needed=("delay_s", "se_s")
        ),
        "vertical_force": _FORCE_TABLE,
        "longitudinal_force": _FORCE_TABLE,
    },
    needed=("version", "reference_speed_m_s", "phase_shift", "patch_width"),
)


def write_calibration(path: Path, calibration: Calibration) -> None:
    """The calibration at `path`."""
    c = calibration
    lines = [
        "# tirelog calibration of phase-shift: change with speed against the reference, c1 (v - "
        "v0) + c2 (v - v0)^2",
        f"version = {VERSION}",
        f"reference_speed_m_s = {c.reference_speed_m_s!r}   # the zero of the phase shift",
    ]
    lines += _table("phase_shift", _of_map(_MAP, c.shift))
    lines += _table(
        "patch_width", {"at_reference_deg": c.patch_width_deg, **_of_map(_MAP, c.width)}
    )
    if math.isfinite(c.crosstalk):
        lines += _table("crosstalk", {"k": c.crosstalk, "se": c.crosstalk_se})
    if math.isfinite(c.delay_s):
        lines += _table("telemetry_delay", {"delay_s": c.delay_s, "se_s": c.delay_se_s})
        lines.append(
            f"beside_force = {str(c.beside_force).lower()}   # whether the longitudinal force "
            "was measured and taken off"
        )
    for name, force in (("vertical_force", c.vertical), ("longitudinal_force", c.longitudinal)):
        if force is not None:
            lines += _table(name, _of_map(_FORCE, force))
    with whole_file(path) as target:
        target.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _of_map(keys: Mapping[str, KeyKind], values: SpeedMap | ForceMap) -> dict[str, Any]:
    """The values of a map by the file's keys, which stand in the order of its fields."""
    return dict(zip(keys, vars(values).values(), strict=True))


def _table(name: str, values: Mapping[str, Any]) -> list[str]:
    return [
        "",
        f"[{name}]",
        *(f"{key} = {np.asarray(value).tolist()!r}" for key, value in values.items()),
    ]


def read_calibration(path: Path) -> Calibration:
    """The calibration at `path`.

    SetupError: no such file, not one of ours, or a value that cannot be.
    """
    text = toml_text(path, SetupError, what="a calibration", advice="name what --calibrate wrote")
    again = "write the file anew with --calibrate"
    document = Document(text, SetupError, "a calibration", path, again)
    data = document.read(_CALIBRATION)
    place = FilePlace(document)
    shift, width = (_speed_map(data[n], place / n) for n in ("phase_shift", "patch_width"))
    vertical, longitudinal = (
        _force_map(data.get(n), place / n) for n in ("vertical_force", "longitudinal_force")
    )
    nan = float("nan")
    crosstalk = data.get("crosstalk", {"k": nan, "se": nan})
    delay = {"delay_s": nan, "se_s": nan, "beside_force": False} | data.get("telemetry_delay", {})
    return Calibration(
        data["reference_speed_m_s"],
        shift,
        width,
        data["patch_width"]["at_reference_deg"],
        crosstalk["k"],
        crosstalk["se"],
        delay["delay_s"],
        delay["se_s"],
        vertical,
        longitudinal,
        delay["beside_force"],
    )


def _speed_map(table: Mapping[str, Any], place: FilePlace) -> SpeedMap:
    """The map in a table."""
    _refuse_map(table, 2, "low_m_s", "high_m_s", place)
    return SpeedMap(*(table[name] for name in _MAP))


def _force_map(table: Mapping[str, Any] | None, place: FilePlace) -> ForceMap | None:
    """The map in a table; None without one."""
    if table is None:
        return None
    _refuse_map(table, table["coefficients_N"].size, "low_deg", "high_deg", place)
    return ForceMap(*(table[name] for name in _FORCE))


def _refuse_map(table: Mapping[str, Any], size: int, low: str, high: str, place: FilePlace) -> None:
    """SetupError: a range without extent, or a covariance of another size than the numbers."""
    if len(table["covariance"]) != size:
        raise (place / "covariance").wrong(
            table["covariance"].tolist(), f"allowed are finite numbers of shape {(size, size)}"
        )
    if table[low] >= table[high]:
        raise (place / high).wrong(table[high], f"allowed is more than {low} = {table[low]:g}")
