"""One file and what is known of it: read right, or why not."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import tirelog
from tirelog.data.setup import parse_setup
from tirelog.drafts.setup import contents
from tirelog.errors import TirelogError
from tirelog.runs.ingest import open_recording

#: rows that may be missing at a log's begin, which its own times do not tell
_MOST_SHIFT = 4


@dataclass(frozen=True)
class Case:
    """A file and what is known of it.

    `truth` values per channel in SI (n,); `times_s` (n,) from the first row; `refused` is a part of
    the message if refusing is right; `own_times_s` those from the log's first sample of channels
    that do not begin with it; `said` a part of what has to be said; `time_error_s` how far a
    time may be off, `value_error` a value; `needs` the library of an extra; not `checked` if the
    values are no tire's; `speed_m_s` of a wheel whose rows of `speed` are judged, if it is one.
    Without a `setup` the channels c0, c1, ... are the sources that the log's own list has.
    """

    source: str
    layout: str
    name: str
    write: Callable[[Path], object]
    setup: str
    truth: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    times_s: NDArray[np.float64] | None = None
    refused: str = ""
    said: str = ""
    own_times_s: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    time_error_s: float = 1e-6
    value_error: float = 1e-9
    needs: str = ""
    checked: bool = True
    speed_m_s: float = 0.0

    @property
    def can_be_made(self) -> bool:
        """True if the library that writes and reads it is installed."""
        return not self.needs or find_spec(self.needs) is not None


@dataclass(frozen=True)
class Verdict:
    """Rows and rate that were read; `wrong` says what is not right ('' if all is).

    `skipped` says why it was not even made.
    """

    rows: int = 0
    rate_Hz: float = float("nan")
    told: str = ""
    wrong: str = ""
    skipped: str = ""


def read(
    path: Path,
    setup: str,
    truth: Mapping[str, NDArray[np.float64]] | None = None,
    times_s: NDArray[np.float64] | None = None,
    time_error_s: float = 0.0,
    *,
    refused: str = "",
) -> Verdict:
    """The verdict on a file that is there."""
    case = Case(
        "", "", path.name, lambda _: None, setup, truth or {}, times_s, refused,
        time_error_s=time_error_s,
    )  # fmt: skip
    return judged(case, path.parent)


def judged(case: Case, folder: Path) -> Verdict:
    """The verdict on a case, whose file is made in `folder`."""
    path = folder / case.name
    case.write(path)
    try:
        text = case.setup or _listed(path)
        read_by = parse_setup(text, "setup.toml")
        with open_recording(str(path), read_by, check=case.checked) as recording:
            first = next(iter(recording.channels.values()))
            wrong = [
                said
                for name, truth in case.truth.items()
                if (said := _compared(case, name, truth, recording))
            ]
            told = " ".join([*recording.remarks, *recording.losses])
            if case.speed_m_s:
                wrong += _speeds(case, path, text)
            if case.refused:
                wrong.append("read, where it must be refused")
            if case.said and case.said not in told:
                wrong.append(f"{case.said!r} is not said")
            if "look like rows" in told and "look like rows" not in case.said:
                wrong.append("rows are said to be left out, and none are")
            rows, rate = first.size, first.axis.rate_Hz
            told = "; ".join(recording.losses)
    except TirelogError as problem:
        right = bool(case.refused) and case.refused in str(problem)
        named = str(problem).startswith((str(path), "setup.toml"))
        wrong_name = "" if named else "the message does not name the file"
        return Verdict(told=str(problem), wrong=wrong_name if right else f"refused: {problem}")
    except Exception as problem:  # what a command would call a defect of its own
        return Verdict(wrong=f"crashed: {type(problem).__name__} {problem}")
    return Verdict(rows, rate, told, "; ".join(wrong))


def _listed(path: Path) -> str:
    """A setup of all series that `tirelog info` lists."""
    return "".join(
        f'[channels.c{k}]\nkind = "signal"\nunit = "1"\nsource = {json.dumps(one.series.source)}\n'
        for k, one in enumerate(contents(str(path)).found)
    )


def _speeds(case: Case, path: Path, setup: str) -> list[str]:
    """What is wrong with the rows of `tirelog speed`: wrong ones that are ok, or too few."""
    given = path.with_suffix(".toml")
    given.write_text(setup)
    rows = tirelog.speed(path, setup=given)
    good = rows[rows.quality == "ok"]
    off = np.abs(good.speed_m_s - case.speed_m_s)
    wrong = int(np.sum((off > 5.0 * good.speed_se_m_s) & (off > 0.01 * case.speed_m_s)))
    # half of the turns: a code of 0.2 s each second takes two of eleven, and those beside them
    few = good.speed_m_s.size < 0.5 * 106
    return [f"{wrong} of {len(good)} ok rows are wrong"] * bool(wrong) + [
        f"{len(good)} rows ok of {len(rows)}"
    ] * few


def _compared(case: Case, name: str, truth: NDArray[np.float64], recording) -> str:
    """What is wrong with a channel: samples that are not those written, or lost in silence."""
    channel = recording.channels.get(name)
    if channel is None:
        return f"channel {name} is missing"
    values, times = channel.read(), channel.axis.time()
    true_times = case.times_s if case.times_s is not None else np.arange(truth.size) / 100.0
    if name in case.own_times_s:
        times, true_times = times - case.own_times_s[name][0], case.own_times_s[name]
    if values.size == truth.size:  # by their order, else by their times
        found = [
            (0, np.arange(truth.size), float(np.abs(times - true_times + true_times[0]).max()))
        ]
    else:
        found = [_placed(times, true_times, k) for k in range(min(_MOST_SHIFT, truth.size - 1))]
    _, at, off = min(
        found, key=lambda one: (not _alike(values, truth, one[1], case.value_error), one[2])
    )
    if off > case.time_error_s:
        return f"{name}: times are off by {off:.3g} s"
    if not _alike(values, truth, at, case.value_error):
        return f"{name}: samples are not those that were written"
    missing = truth.size - np.unique(at[np.isfinite(values)]).size
    if missing > np.isnan(truth).sum() and not recording.losses:
        return f"{name}: {missing} samples are lost in silence"
    return ""


def _placed(
    times: NDArray[np.float64], true_times: NDArray[np.float64], shift: int
) -> tuple[int, NDArray[np.int64], float]:
    """(rows missing in front, the written row of each sample, largest error in time [s])."""
    wanted = times + true_times[shift]
    after = np.clip(np.searchsorted(true_times, wanted), 1, true_times.size - 1)
    nearer = wanted - true_times[after - 1] < true_times[after] - wanted
    at = after - nearer
    return shift, at, float(np.abs(wanted - true_times[at]).max(initial=0.0))


def _alike(
    values: NDArray[np.float64], truth: NDArray[np.float64], at: NDArray[np.int64], error: float
) -> bool:
    there = np.isfinite(values)
    return bool(
        np.all(np.abs(values[there] - truth[at][there]) <= error * (1.0 + np.abs(truth[at][there])))
    )
