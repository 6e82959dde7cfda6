"""Calibration files: versioned TOML.

Checked key by key when read, so that a foreign file cannot do harm.

Calibration --write_calibration--> text, whole or not at all --read_calibration--> Calibration
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.errors import SetupError, refuse_unknown
from tirelog.storage.documents import toml_tables, toml_text
from tirelog.storage.whole import whole_file
from tirelog.wheel.calibration import Calibration, SpeedMap
from tirelog.wheel.forces import ForceMap

#: of the file's layout; another one is refused
VERSION = 1
_MAP = (
    "linear_deg_s_m",
    "quadratic_deg_s2_m2",
    "covariance",
    "low_m_s",
    "high_m_s",
    "rms_deg",
    "passages",
)
_FORCE = ("centre_deg", "coefficients_N", "covariance", "low_deg", "high_deg", "rms_N")
_TABLES = {
    "phase_shift": _MAP,
    "patch_width": ("at_reference_deg", *_MAP),
    "crosstalk": ("k", "se"),
    "telemetry_delay": ("delay_s", "se_s", "beside_force"),
    "vertical_force": _FORCE,
    "longitudinal_force": _FORCE,
}


def write_calibration(path: Path, calibration: Calibration) -> None:
    """The calibration at `path`."""
    c = calibration
    lines = [
        "# tirelog calibration of phase-shift: change with speed against the reference, c1 (v - "
        "v0) + c2 (v - v0)^2",
        f"version = {VERSION}",
        f"reference_speed_m_s = {c.reference_speed_m_s!r}   # the zero of the phase shift",
    ]
    lines += _table("phase_shift", _map_values(c.shift))
    lines += _table("patch_width", {"at_reference_deg": c.patch_width_deg, **_map_values(c.width)})
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
            values = (
                force.centre_deg,
                force.coefficients,
                force.covariance,
                force.low_deg,
                force.high_deg,
                force.rms_N,
            )
            lines += _table(name, dict(zip(_FORCE, values, strict=True)))
    with whole_file(path) as target:
        target.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _map_values(m: SpeedMap) -> dict[str, Any]:
    return dict(
        zip(
            _MAP,
            (m.linear, m.quadratic, m.covariance, m.low_m_s, m.high_m_s, m.rms_deg, m.passages),
            strict=True,
        )
    )


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
    data = _parsed(path)
    if data.get("version") != VERSION:
        raise SetupError(
            f"version {data.get('version')!r}",
            allowed=f"allowed is {VERSION}",
            do="write the file anew with --calibrate",
            file=path,
        )
    allowed = ("version", "reference_speed_m_s", *_TABLES)
    for key in data:
        refuse_unknown(
            key, allowed, f"unknown key {key!r}", do="remove it", error=SetupError, file=path
        )
    take = _Taker(path, data)
    reference = take.number(data, "", "reference_speed_m_s", 0.0, 200.0)
    shift, width = take.speed_map("phase_shift"), take.speed_map("patch_width")
    at_reference = take.number(data["patch_width"], "patch_width", "at_reference_deg", 0.0, 360.0)
    k = take.pair("crosstalk", "k", "se", 1e3)
    delay = take.pair("telemetry_delay", "delay_s", "se_s", 1e3)
    beside = take.flag("telemetry_delay", "beside_force")
    forces = take.force("vertical_force"), take.force("longitudinal_force")
    return Calibration(reference, shift, width, at_reference, *k, *delay, *forces, beside)


def _parsed(path: Path) -> dict[str, Any]:
    text = toml_text(path, SetupError, what="a calibration", advice="name what --calibrate wrote")
    return toml_tables(text, SetupError, file=path)


class _Taker:
    """Takes values out of a parsed file, and refuses what cannot be."""

    def __init__(self, path: Path, data: Mapping[str, Any]) -> None:
        self.path, self.data = path, data

    def error(self, name: str, key: str, value: Any, allowed: str) -> SetupError:
        where = f"[{name}] {key}" if name else key
        return SetupError(
            f"{where} = {str(value)[:60]}",
            allowed=f"allowed is {allowed}",
            do="write the file anew with --calibrate",
            file=self.path,
        )

    def table(self, name: str) -> Mapping[str, Any]:
        table = self.data.get(name)
        if not isinstance(table, dict):
            raise self.error(name, "", table, "a table")
        for key in table:
            if key not in _TABLES[name]:
                raise self.error(
                    name, key, table[key], f"no such key, but {', '.join(_TABLES[name])}"
                )
        return table

    def number(
        self, table: Mapping[str, Any], name: str, key: str, low: float, high: float
    ) -> float:
        value = table.get(key)
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not (math.isfinite(value) and low <= value <= high)
        ):
            raise self.error(name, key, value, f"a number from {low:g} to {high:g}")
        return float(value)

    def array(
        self, table: Mapping[str, Any], name: str, key: str, shape: tuple[int, ...]
    ) -> np.ndarray:
        value = table.get(key)
        try:
            array = np.array(value, dtype=float)
        except (TypeError, ValueError):
            raise self.error(name, key, value, f"numbers of shape {shape}") from None
        if (
            array.shape != shape
            or not np.isfinite(array).all()
            or np.abs(array).max(initial=0.0) > 1e15
        ):
            raise self.error(name, key, value, f"finite numbers of shape {shape}")
        if len(shape) == 2 and (
            np.linalg.eigvalsh(0.5 * (array + array.T)).min()
            < -1e-9 * max(float(np.abs(array).max()), 1e-300)
        ):
            raise self.error(name, key, value, "a covariance: symmetric, no negative variances")
        return array

    def bounds(
        self, table: Mapping[str, Any], name: str, low: str, high: str
    ) -> tuple[float, float]:
        first, last = (
            self.number(table, name, low, -1e4, 1e4),
            self.number(table, name, high, -1e4, 1e4),
        )
        if first >= last:
            raise self.error(name, high, last, f"more than {low} = {first:g}")
        return first, last

    def speed_map(self, name: str) -> SpeedMap:
        table = self.table(name)
        linear, quadratic = (self.number(table, name, key, -1e3, 1e3) for key in _MAP[:2])
        covariance = self.array(table, name, "covariance", (2, 2))
        low, high = self.bounds(table, name, "low_m_s", "high_m_s")
        rms = self.number(table, name, "rms_deg", 0.0, 360.0)
        return SpeedMap(
            linear,
            quadratic,
            covariance,
            low,
            high,
            rms,
            int(self.number(table, name, "passages", 0, 1e12)),
        )

    def pair(self, name: str, value: str, se: str, most: float) -> tuple[float, float]:
        """A value and its standard error; NaN if the file has no such table."""
        if name not in self.data:
            return float("nan"), float("nan")
        table = self.table(name)
        return self.number(table, name, value, -most, most), self.number(table, name, se, 0.0, most)

    def flag(self, name: str, key: str) -> bool:
        """True or false; false if the file does not have it."""
        value = self.table(name).get(key, False) if name in self.data else False
        if not isinstance(value, bool):
            raise self.error(name, key, value, "true or false")
        return value

    def force(self, name: str) -> ForceMap | None:
        if name not in self.data:
            return None
        table = self.table(name)
        size = len(table["coefficients_N"]) if isinstance(table.get("coefficients_N"), list) else 0
        if size not in (2, 3):
            raise self.error(
                name, "coefficients_N", table.get("coefficients_N"), "two or three numbers"
            )
        coefficients = self.array(table, name, "coefficients_N", (size,))
        covariance = self.array(table, name, "covariance", (size, size))
        low, high = self.bounds(table, name, "low_deg", "high_deg")
        centre, rms = (
            self.number(table, name, "centre_deg", -1e4, 1e4),
            self.number(table, name, "rms_N", 0.0, 1e7),
        )
        return ForceMap(centre, coefficients, covariance, low, high, rms)
