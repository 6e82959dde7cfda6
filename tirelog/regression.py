"""`check`: does a table still say what an earlier one said?

    two tables --match rows by key--> differences beyond each column's tolerance, largest first

A row's key is what names it (log, channel, revolution, step, effect, ...: the key columns that both tables have; without any, the row
number).  A float may move by its column's absolute + relative tolerance (`columns.COLUMNS`), anything else not at all; rows that
only one table has are differences too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from tirelog.columns import COLUMNS
from tirelog.errors import UsageError

KEYS = ("log", "table", "channel", "revolution", "step", "effect", "manoeuvre", "regime", "quantity", "angle", "name")
_DEFAULT_RELATIVE = 1e-6


@dataclass(frozen=True)
class Difference:
    """One value that moved.  `excess` is its difference over what is allowed (inf where the values cannot be compared)."""

    key: str
    column: str
    value: str
    against: str
    excess: float


def differences(table: pd.DataFrame, against: pd.DataFrame, tolerance: Mapping[str, float] | None = None) -> list[Difference]:
    """What moved between `against` (the older table) and `table`, largest first.

    `tolerance` replaces a column's own tolerance by an absolute one.  UsageError: a tolerance for a column that is not there.
    """
    tolerance = dict(tolerance or {})
    for name in tolerance:
        if name not in against.columns:
            raise UsageError(f"--tolerance {name}: no such column; allowed are {', '.join(map(str, against.columns))}; mend the name")
    keys = [k for k in KEYS if k in table.columns and k in against.columns]
    table, against = _indexed(table, keys), _indexed(against, keys)
    found = [Difference("(all rows)", str(c), "absent", "present", np.inf) for c in against.columns.difference(table.columns)]
    found += [Difference("(all rows)", str(c), "present", "absent", np.inf) for c in table.columns.difference(against.columns)]
    found += [Difference(str(k), "(row)", "absent", "present", np.inf) for k in against.index.difference(table.index)]
    found += [Difference(str(k), "(row)", "present", "absent", np.inf) for k in table.index.difference(against.index)]
    common = against.index.intersection(table.index)
    for name in [c for c in against.columns if c in table.columns]:
        found += _moved(str(name), table.loc[common, name], against.loc[common, name], tolerance.get(str(name)))
    return sorted(found, key=lambda d: -d.excess)


def _indexed(table: pd.DataFrame, keys: list[str]) -> pd.DataFrame:
    """The table with its key as index: `log=a.csv channel=strain_1 revolution=3`, numbered where keys repeat."""
    if not keys:
        return table.set_axis([f"row={i}" for i in range(len(table))], axis=0)
    key = table[keys[0]].map(lambda v: f"{keys[0]}={v}")
    for name in keys[1:]:
        key = key + table[name].map(lambda v, name=name: f" {name}={v}")
    again = key.groupby(key).cumcount()
    key = key.where(again == 0, key + " #" + (again + 1).astype(str))
    return table.drop(columns=keys).set_axis(key.to_numpy(), axis=0)


def _moved(name: str, new: pd.Series, old: pd.Series, tolerance: float | None) -> list[Difference]:
    """The values of one column that differ by more than is allowed."""
    numbers = pd.api.types.is_float_dtype(new) or pd.api.types.is_float_dtype(old)
    if not (numbers and pd.api.types.is_numeric_dtype(new) and pd.api.types.is_numeric_dtype(old)):
        same = (new.astype(str) == old.astype(str)) | (new.isna() & old.isna())
        return [Difference(str(k), name, str(new[k]), str(old[k]), np.inf) for k in new.index[~same.to_numpy()]]
    a, b = new.to_numpy(float), old.to_numpy(float)
    column = COLUMNS.get(name)
    if tolerance is not None:
        allowed = np.full(a.size, tolerance)
    else:
        allowed = (column.absolute if column else 0.0) + (column.relative if column else _DEFAULT_RELATIVE) * np.abs(b)
    one_missing = np.isnan(a) != np.isnan(b)
    with np.errstate(invalid="ignore", divide="ignore"):
        excess = np.where(one_missing, np.inf, np.where(a == b, 0.0, np.abs(a - b) / allowed))
    excess = np.where(np.isnan(a) & np.isnan(b), 0.0, excess)
    return [Difference(str(new.index[int(i)]), name, f"{a[i]:.9g}", f"{b[i]:.9g}", float(excess[i])) for i in np.flatnonzero(excess > 1.0)]


def as_table(found: list[Difference]) -> dict[str, Any]:
    """The differences as columns."""
    return {
        "key": np.array([d.key for d in found], dtype=object),
        "column": np.array([d.column for d in found], dtype=object),
        "value": np.array([d.value for d in found], dtype=object),
        "against": np.array([d.against for d in found], dtype=object),
        "excess": np.array([d.excess for d in found]),
    }
