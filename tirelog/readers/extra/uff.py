"""Universal files (UFF, sets 58 and 58b) as HDF5: a group per set, its values and its times."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tirelog.readers.extra.child import Answer
from tirelog.readers.extra.datasets import Datasets

#: kinds of function of a set: a general one, a time response; of its axis: unknown, time
_IN_TIME, _TIME_AXES = (0, 1), (0, 17)
#: bytes at the end in which a set's end stands
_END_BYTES = 400
_DIRECTIONS = {1: "+X", 2: "+Y", 3: "+Z", -1: "-X", -2: "-Y", -3: "-Z"}


def load() -> None:
    """Imports what reads it."""
    import pyuff  # noqa: F401


def convert(source: Path, target: Path, answer: Answer) -> None:
    """Writes the sets that are signals in time to `target`."""
    import pyuff

    with source.open("rb") as stream:
        stream.seek(max(source.stat().st_size - _END_BYTES, 0))
        if not stream.read().rstrip().endswith(b"    -1"):
            answer.losses.append(
                "the file does not end with the end of a set: a last one may be lost; copy it again"
            )
    file = pyuff.UFF(str(source))
    with Datasets(target, answer) as to:
        for number, kind in enumerate(np.atleast_1d(file.get_set_types())):
            if int(kind) != 58:
                continue
            name = f"set_{number + 1}"
            try:
                one = file.read_sets(number)
            except MemoryError:
                raise
            # the library says no more than that it could not
            except Exception:
                answer.losses.append(f"{name} is damaged and lost; copy the file again")
                continue
            if why := _no_signal(one):
                answer.passed_over.append(f"{name} is {why}")
                continue
            _write(to, f"{name}{_place(one)}", one)
            missing = int(one.get("num_pts", 0)) - len(one["data"])
            if missing > 0:
                answer.losses.append(
                    f"{name}: {missing} of {one['num_pts']} values are not in the file; "
                    "copy it again"
                )


def _no_signal(one: dict[str, Any]) -> str:
    """Why a set is no signal in time; '' if it is one."""
    if np.iscomplexobj(one["data"]) or one.get("func_type", 0) not in _IN_TIME:
        return f"no signal in time (function {one.get('func_type')})"
    if one.get("abscissa_spec_data_type", 0) not in _TIME_AXES:
        return f"over no time (axis {one.get('abscissa_spec_data_type')})"
    return ""


def _place(one: dict[str, Any]) -> str:
    """The node and direction of a set, as part of a name."""
    node, direction = one.get("rsp_node", 0), _DIRECTIONS.get(one.get("rsp_dir", 0), "")
    return f"_node_{node}{'_' if direction else ''}{direction}" if node else ""


def _write(to: Datasets, name: str, one: dict[str, Any]) -> None:
    group = to.group(name)
    unit = str(one.get("ordinate_axis_units_lab", "") or "").strip()
    even = one.get("abscissa_spacing", 0) == 1
    attributes = {"units": unit if unit.upper() != "NONE" else None}
    if even:
        attributes["dt"] = one.get("abscissa_inc")
    to.add(group, "values", [np.asarray(one["data"])[: _declared(one)]], attributes)
    if not even:
        to.add(group, "time", [np.asarray(one["x"])[: _declared(one)]], {"units": "s"})


def _declared(one: dict[str, Any]) -> int:
    """How many values the set says it has: behind them stand line ends and padding."""
    return max(int(one.get("num_pts", 0)), 0)
