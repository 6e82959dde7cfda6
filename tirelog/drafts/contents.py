"""What a log holds, without a setup: every series with its rate, range, examples and likely kind.

log --listed--> series --the readers' own blocks--> samples from its begin
    --clock--> rates --guess--> kinds
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.data.setup import ChannelSetup, Setup
from tirelog.drafts.guess import Guess, guessed
from tirelog.drafts.listing import listed
from tirelog.errors import ReadError, SetupError
from tirelog.readers.base import LogReader, counted_floats
from tirelog.readers.series import Series
from tirelog.runs.ingest import (
    LogStream,
    clock_of,
    is_file,
    log_part,
    open_log_bytes,
    opened_log,
    read_head,
    reader_of,
)
from tirelog.storage.whole import failed_writes, temporary_folder
from tirelog.vocabulary.arrays import FloatArray

#: blocks that are looked at: each of some MB
_BLOCKS = 48
#: sentences on topics that cannot be read, which are mostly alike
_MOST_UNREAD = 3
#: samples of a series that are kept
_MOST_SAMPLES = 1 << 17


@dataclass(frozen=True)
class FoundSeries:
    """A series with what its first samples tell.

    `unit` as the log spells it ('' if it does not); `rate_Hz` None if no stamps and no rate are
    there; `samples` looked at, shape (n,), NaN where lost, in the log's unit; `guess` its kind.
    """

    series: Series
    unit: str
    rate_Hz: float | None
    duration_s: float | None
    samples: FloatArray
    guess: Guess

    @property
    def known(self) -> FloatArray:
        """The samples that are not lost."""
        return self.samples[np.isfinite(self.samples)]


@dataclass(frozen=True)
class Contents:
    """What is in a log; `whole` is false if only its beginning was looked at.

    `others` are topics, columns or datasets that hold no numbers; `clock` says what is wrong with
    stamps that tell no rate.
    """

    log: str
    format: str
    start: str | None
    time: str
    found: tuple[FoundSeries, ...]
    remarks: tuple[str, ...]
    losses: tuple[str, ...]
    whole: bool
    others: tuple[str, ...] = ()
    clock: str = ""


def contents(log: str) -> Contents:
    """What the log at a path ('-' for standard input) holds.

    ReadError: nothing in it can be read.
    """
    with _local(log) as path, open_log_bytes(str(path)) as raw:
        head = read_head(raw, log)
        stream = LogStream(head, raw, False)
        with opened_log(str(path), head, stream, log) as opened:
            inside = listed(opened.made, opened.path or path, log)
            some = ", ".join(inside.others[:8])
            if not inside.series and inside.unread:
                what = f"holds no series of numbers that can be read{some and f', only {some}'}"
                why = "; ".join(inside.unread[:_MOST_UNREAD])
                raise ReadError(f"{what}: {why}", file=log)
            if not inside.series:
                raise ReadError(
                    f"holds no series of numbers{some and f', only {some}'}",
                    allowed="a log has columns, topics or datasets of numbers",
                    do="check the recording",
                    file=log,
                )
            names = {f"c{k}": one for k, one in enumerate(inside.series)}
            reader = reader_of(stream, opened, _setup(names), log)
            found = _read(log, reader, names, inside.time)
            said = (*inside.unread[:_MOST_UNREAD], *found.remarks)
            return replace(found, others=inside.others, remarks=said)


@contextmanager
def _local(log: str) -> Iterator[Path]:
    """The log as a file, which can be opened again."""
    if is_file(log):
        yield Path(log)
        return
    with temporary_folder() as folder, open_log_bytes(log) as raw:
        path = folder / "log"
        with failed_writes(path), path.open("wb") as copy:
            while part := log_part(raw, log):
                copy.write(part)
        yield path


def _setup(names: dict[str, Series]) -> Setup:
    """A setup that reads every series as it is recorded."""
    channels = {}
    for name, one in names.items():
        kind = "signal" if one.window_nm is None else "fbg_strain"
        middle = None if one.window_nm is None else sum(one.window_nm) / 2.0
        channels[name] = ChannelSetup(
            kind=kind, source=one.source, window_nm=one.window_nm, reference_wavelength_nm=middle
        )
    return Setup(channels=channels)


def _read(log: str, reader: LogReader, names: dict[str, Series], time: str) -> Contents:
    parts: dict[str, list[FloatArray]] = {name: [] for name in names}
    kept = dict.fromkeys(names, 0)
    places = {n: group.decimals.get(n) for group in reader.groups for n in group.channels}
    clocks = {group.name: clock_of(group, reader.setup) for group in reader.groups}
    blocks, whole = reader.blocks(), True
    for number, block in enumerate(islice(blocks, _BLOCKS + 1)):
        if number == _BLOCKS:
            whole = False
            break
        size = 0
        for name, values in block.values.items():
            size = values.size
            if kept[name] < _MOST_SAMPLES:
                parts[name].append(counted_floats(values[:_MOST_SAMPLES], places[name]))
                kept[name] += size
        clocks[block.group].add(block.stamps_s, block.number, size)
    blocks.close()  # type: ignore[attr-defined]  # every reader's blocks are a generator
    found, remarks, why = [], [], ""
    for group in reader.groups:
        clock, rate, duration = clocks[group.name], None, None
        try:
            axis = clock.axis()
            rate, duration = axis.rate_Hz, axis.duration_s
            remarks += [said for said in clock.remarks if said not in remarks]
        except (ReadError, SetupError) as problem:
            why = problem.message if clock.stamped else why
        for name in group.channels:
            one, setup = names[name], reader.setup.channels[name]
            samples = np.concatenate([np.zeros(0), *parts[name]])
            unit = setup.unit or ""
            if samples.size:
                guess = guessed(one.source, unit, samples, rate)
                found.append(FoundSeries(one, unit, rate, duration, samples, guess))
    order = {one: k for k, one in enumerate(names.values())}
    found.sort(key=lambda one: order[one.series])
    report = reader.report
    losses = [_with_source(loss, names) for loss in report.losses]
    said = [*(_with_source(remark, names) for remark in report.remarks), *remarks]
    said += [why] if why else []
    return Contents(
        log, report.format, report.start, time, tuple(_twins(found)), tuple(said), tuple(losses),
        whole, clock=why,
    )  # fmt: skip


def _with_source(sentence: str, names: dict[str, Series]) -> str:
    """A reader's sentence with a series' own name for the channel's."""
    for name, one in names.items():
        if sentence.startswith(f"channel {name}: "):
            return f"{one.source}: {sentence.removeprefix(f'channel {name}: ')}"
    return sentence


def _twins(found: list[FoundSeries]) -> list[FoundSeries]:
    """The series, gratings that hardly move taken for twins of those that do."""
    gratings = [one for one in found if one.guess.kind == "fbg_strain"]
    moves = {id(one): float(np.ptp(np.quantile(one.known, [0.02, 0.98]))) for one in gratings}
    most = max(moves.values(), default=0.0)
    out = []
    for one in found:
        still = id(one) in moves and len(gratings) > 1 and moves[id(one)] < 0.25 * most
        guess = Guess("fbg_temperature", one.guess.unit, "a grating that hardly moves: a twin")
        out.append(replace(one, guess=guess) if still else one)
    return out


def rows(inside: Contents) -> dict[str, Any]:
    """What is in a log as columns of a table, one row per series."""
    found = inside.found

    def number(values: list[float | None]) -> FloatArray:
        return np.array([np.nan if value is None else value for value in values])

    return {
        "log": np.array([inside.log] * len(found), dtype=object),
        "source": np.array([one.series.source for one in found], dtype=object),
        "unit": np.array([one.unit for one in found], dtype=object),
        "rate_Hz": number([one.rate_Hz for one in found]),
        "samples": np.array([one.samples.size for one in found]),
        "lost_samples": np.array([one.samples.size - one.known.size for one in found]),
        "lowest": number([float(one.known.min()) if one.known.size else None for one in found]),
        "highest": number([float(one.known.max()) if one.known.size else None for one in found]),
        "likely_kind": np.array([one.guess.kind for one in found], dtype=object),
        "likely_unit": np.array([one.guess.unit for one in found], dtype=object),
        "reason": np.array([one.guess.reason for one in found], dtype=object),
    }
