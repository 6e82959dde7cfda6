"""LabVIEW's TDMS as HDF5: /group/channel, with its unit and the step of its samples."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.readers.extra.child import Answer
from tirelog.readers.extra.datasets import Datasets, proper


def load() -> None:
    """Imports what reads it."""
    import nptdms  # noqa: F401


def convert(source: Path, target: Path, answer: Answer) -> None:
    """Writes the channels of numbers and of times to `target`."""
    from nptdms import TdmsFile

    starts: list[Any] = []
    # a stream, not a path: beside that the library looks for an index, which may be another's
    with source.open("rb") as stream, TdmsFile.open(stream) as file, Datasets(target, answer) as to:
        for group in file.groups():
            made, channels = to.group(group.name), group.channels()
            dated = [one.name for one in channels if len(one) and one.dtype.kind == "M"]
            for channel in channels:
                said = channel.properties
                step = _number(said.get("wf_increment"))
                unit = said.get("unit_string") or said.get("NI_UnitDescription")
                attributes = {
                    "units": unit if isinstance(unit, str) else None,
                    "wf_increment": step,
                }
                if len(channel) and channel.dtype.kind == "M":
                    attributes = {"units": "ns since 1970-01-01T00:00:00+00:00"}
                elif step is not None and isinstance(said.get("wf_start_time"), np.datetime64):
                    starts.append(said["wf_start_time"].astype("M8[us]"))
                if len(channel) and channel.dtype.kind not in "iufbM":
                    answer.passed_over.append(f"{proper(channel.name)} holds no real numbers")
                else:
                    name = "time" if dated == [channel.name] else channel.name
                    to.add(made, name, _pieces(channel), attributes)
        if file.file_status.incomplete_final_segment:
            answer.losses.append(
                "the file is cut off in its last segment, whose end is lost; copy it again"
            )
    if starts and not np.isnat(starts).any():
        answer.start = str(min(starts)) + "+00:00"
        apart_s = (max(starts) - min(starts)) / np.timedelta64(1, "s")
        if apart_s > 0.0:
            answer.remarks.append(
                f"channels begin up to {apart_s:g} s after the first, by wf_start_time; "
                "each is taken to begin with the log"
            )


def _pieces(channel: Any) -> Iterator[NDArray[Any]]:
    """The samples as the file's segments hold them; times as whole nanoseconds."""
    for chunk in channel.data_chunks():
        values = chunk[:]
        yield values.astype("M8[ns]").astype(np.int64) if values.dtype.kind == "M" else values


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float | np.number) else None
