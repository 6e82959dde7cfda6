r"""From a log to a run: the one way in for every command.

    bytes --reader--> raw blocks --clock--> time axes
                          \--store--> run            (one pass, bounded memory)

`open_recording` is what commands call: a run is opened as it is; any other log is ingested first
into a temporary run (flat files in the folder for temporary files). So a log, its run and standard
input give the same rows by construction.
"""

from __future__ import annotations

import hashlib
import io
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from tirelog.data.plausibility import check_recording
from tirelog.data.recording import Recording
from tirelog.data.setup import Setup, load_setup, setup_beside
from tirelog.errors import ReadError, SetupError, UsageError
from tirelog.readers.base import Group, LogReader, RawBlock, ReadReport, of_damaged
from tirelog.readers.other.formats import FORMATS, HEAD_BYTES, name_of, refuse_foreign
from tirelog.runs.clock import ClockFit
from tirelog.runs.store import is_run, open_run, recording_of, write_file
from tirelog.runs.temporary import Run, RunWriter
from tirelog.storage.whole import (
    LARGEST_BYTES,
    failed_writes,
    open_input,
    refuse_other_role,
    shown,
    temporary_folder,
    whole_file,
)
from tirelog.version import __version__

#: what opens a log by its format; text is of none
_READERS = {
    "HDF5": "tirelog.readers.hdf5.reader:Hdf5Log",
    "MCAP": "tirelog.readers.mcap.reader:McapLog",
}
_TEXT = "tirelog.readers.text.reader:open_text"
#: what makes a file that is read of one of FORMATS
_BY_LIBRARY = "tirelog.readers.other.conversion:convert"


class LogStream(io.RawIOBase):
    """A binary stream behind a head that was read before.

    Counts, and if asked for hashes, what is read through it.
    """

    def __init__(self, head: bytes, rest: BinaryIO, hashed: bool) -> None:
        self._head, self._rest = head, rest
        self._sha256 = hashlib.sha256() if hashed else None
        self.size = 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        if self._head:
            got = min(len(self._head), len(buffer))
            buffer[:got], self._head = self._head[:got], self._head[got:]
        else:
            got = self._rest.readinto(buffer) or 0  # type: ignore[attr-defined]  # every binary stream has it
        if self._sha256 is not None:
            self._sha256.update(memoryview(buffer)[:got])
        self.size += got
        return got

    def finish(self) -> str:
        """Read to the end and give the hash of the whole.

        A reader may stop before the end. '' if the hash was not asked for, or not to be had.
        """
        buffer = bytearray(1 << 20)
        try:
            while self.readinto(buffer):
                pass
        except OSError:
            return ""
        return "" if self._sha256 is None else self._sha256.hexdigest()


@dataclass
class IngestSummary:
    """What an ingest met, for the page it prints and for the provenance."""

    log: str
    format: str = ""
    sha256: str = ""
    bytes: int = 0
    start: str | None = None
    samples: dict[str, int] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    repairs: dict[str, dict[str, int]] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)


def _setup_for(log: str, setup: Setup | None) -> Setup:
    """The setup given, or the one beside the log.

    SetupError: there is none. ReadError: nor is it known whether the log, an HDF5 file, is a run.
    """
    if setup is not None:
        return setup
    beside = None if log == "-" else setup_beside(log)
    if beside is None:
        if is_file(log):
            from tirelog.readers.hdf5.reader import refuse_damaged

            refuse_damaged(Path(log), log)
        where = "standard input has no setup beside it"
        raise SetupError(
            where if log == "-" else "no setup file beside the log",
            allowed="a setup says what the channels are",
            do="give one with --setup FILE",
            file=log,
        )
    return load_setup(beside)


@contextmanager
def failed_reads(log: str, more: type[Exception] = OSError) -> Iterator[None]:
    """What the system says of a log that it does not give becomes a ReadError."""
    try:
        yield
    except (OSError, more) as problem:
        what = getattr(problem, "strerror", None) or problem
        raise ReadError(
            f"cannot be read ({what})",
            allowed="a log is a file or '-'",
            do="give another path",
            file=log,
        ) from None


def open_log_bytes(log: str) -> BinaryIO:
    with failed_reads(log, ValueError):  # a NUL in the name
        if log.endswith(".toml") and is_file(log):
            with open_input(log) as stream:
                text = stream.read(LARGEST_BYTES).decode("utf-8", "replace")
            refuse_other_role(text, "a log", UsageError, log)
        return open_input(log)


def is_file(log: str) -> bool:
    """True if `log` is a regular file, which can be read again and from any place.

    A pipe or device cannot.
    """
    try:
        return log != "-" and stat.S_ISREG(os.stat(log).st_mode)
    except (OSError, ValueError):
        return False


class OpenedLog(NamedTuple):
    """A log with its format ('' for text), as a file if that has to be one.

    `made` is the format of what it was made, and so of the file; its own if it was not converted.
    """

    format: str
    made: str
    path: Path | None = None
    converted: ReadReport | None = None


def reader_of(stream: LogStream, opened: OpenedLog, setup: Setup, log: str) -> LogReader:
    """The reader for what the bytes are; names and suffixes do not matter.

    SetupError: [log] has keys that only a text log has, and the log is none.
    """
    if setup.log.of_text and opened.format not in ("", "zip"):
        keys = ", ".join(setup.log.of_text)
        raise SetupError(
            f"[log] {keys}: the log is {opened.format}",
            allowed="allowed for a text log only",
            do="remove it, or give the log that it is for",
            file=setup.file or log,
        )
    source = opened.path or io.BufferedReader(stream, 1 << 20)
    again = Path(log) if opened.path is None and is_file(log) else None
    more = (again,) if opened.made == "MCAP" else ()
    reader: LogReader = resolve_name(_READERS.get(opened.made, _TEXT))(source, setup, log, *more)
    if opened.converted is not None:
        reader.report.format = "matlab 5" if opened.format == "MATLAB" else opened.format.lower()
        reader.report.losses += opened.converted.losses
        reader.report.remarks += opened.converted.remarks
        reader.report.start = reader.report.start or opened.converted.start
    return reader


@contextmanager
def opened_log(log: str, head: bytes, stream: LogStream, name: str = "") -> Iterator[OpenedLog]:
    """The log's format, and the log as a file if its format needs one to seek in.

    What is no file is copied to a temporary one; those of FORMATS are converted.
    `name` is the log's in messages, if that is not its path.
    """
    format = name_of(head)
    if not format:
        refuse_foreign(head, name or log)
    converts = format in FORMATS
    if format != "HDF5" and not converts:
        yield OpenedLog(format, format)
        return
    with temporary_folder() as folder:
        path = local_file(stream, log, folder)
        if converts:
            made, converted = resolve_name(_BY_LIBRARY)(format, path, folder, name or log)
            yield OpenedLog(format, FORMATS[format].made, made, converted)
        else:
            yield OpenedLog(format, format, path)


def local_file(stream: io.RawIOBase | BinaryIO, log: str, folder: Path) -> Path:
    """The log as a file: itself, or its bytes copied into `folder`.

    ReadError: it cannot be read on.
    """
    if is_file(log):
        return Path(log)
    path = folder / "log"
    part: bytes | None = b""
    with failed_writes(path), path.open("wb") as copy:
        while part is not None:
            copy.write(part)
            with failed_reads(log):
                part = stream.read(1 << 20) or None
    return path


def ingest(
    log: str,
    setup: Setup | None,
    folder: Path,
    *,
    blocks: int | None = None,
    hashed: bool = False,
) -> tuple[IngestSummary, Run]:
    """The run of `log` ('-' for standard input), of flat files in `folder`.

    In one pass over its blocks (or the first `blocks` of them). With `hashed` its sha256 is in the
    provenance, which for a text log takes as long as reading it: for who keeps or prints it. What
    the system raises if nothing can be written is left to the caller, who knows what it is for.
    ReadError: nothing could be read. SetupError: no setup, or it does not fit. What was lost,
    though the rest could be read, is in the summary's `losses` and in the run.
    """
    summary = IngestSummary(shown(log))
    with open_log_bytes(
        log
    ) as raw:  # before its setup: a log that is not there is no log without a setup
        setup = _setup_for(log, setup)
        head = read_head(raw, log)
        stream = LogStream(head, raw, hashed)
        with opened_log(log, head, stream) as opened:
            if opened.format == "HDF5" and opened.path is not None and is_run(opened.path):
                raise UsageError(
                    "is a run already",
                    allowed="ingest takes a log",
                    do="give the run's path to the other commands",
                    file=log,
                )
            with failed_reads(log):
                reader = reader_of(stream, opened, setup, log)
            run = _write(
                RunWriter(folder, reader.setup, reader.groups), reader, summary, stream, blocks
            )
    return summary, run


def read_head(raw: BinaryIO, log: str) -> bytes:
    """The first bytes, also of a pipe that hands out less than it is asked for.

    ReadError: there are none.
    """
    head = b""
    with failed_reads(log):
        while len(head) < HEAD_BYTES and (part := raw.read(HEAD_BYTES - len(head))):
            head += part
    if not head:
        raise ReadError(
            "is empty",
            allowed="a log has at least a header and samples",
            do="record it again",
            file=log,
        )
    return head


def _blocks(reader: LogReader, summary: IngestSummary) -> Iterator[RawBlock]:
    """The reader's blocks, until the system gives no more of the log, which is a loss.

    ReadError: not even the first.
    """
    blocks = reader.blocks()
    with failed_reads(summary.log):
        block = next(blocks, None)
    try:
        while block is not None:
            yield block
            block = next(blocks, None)
    except OSError as problem:
        what = problem.strerror or problem
        summary.losses.append(
            f"cannot be read to its end ({what}); what follows is lost; copy it again"
        )


def _write(
    writer: RunWriter,
    reader: LogReader,
    summary: IngestSummary,
    stream: LogStream,
    blocks: int | None,
) -> Run:
    """Blocks through the clocks and into the run; then what only the end of the log tells."""
    clocks = {group.name: clock_of(group, writer.setup) for group in reader.groups}
    whole = True
    for number, block in enumerate(_blocks(reader, summary)):
        if number == blocks:
            whole = False
            summary.remarks.append(
                f"only the first {sum(summary.samples.values())} samples were looked at"
            )
            break
        rows = writer.append(block)
        clocks[block.group].add(block.stamps_s, block.number, rows)
        summary.samples[block.group] = summary.samples.get(block.group, 0) + rows
    if not any(summary.samples.values()):
        raise ReadError(
            "holds no samples",
            allowed="a log has rows under its header",
            do="record it again",
            file=summary.log,
        )
    read = summary.samples
    sizes = {name: read.get(group.name, 0) for group in reader.groups for name in group.channels}
    lost = {name: n for name, n in writer.lost.items() if sizes[name]}
    report = reader.report
    summary.format, summary.start = report.format, report.start
    summary.counts = report.counts | {f"lost_samples {name}": n for name, n in lost.items()}
    summary.losses += report.losses
    summary.remarks += report.remarks
    for name, n in lost.items():
        if n == sizes[name]:
            summary.remarks.append(f"channel {name} has no reading at all")
    axes, flags = {}, {}
    for name, clock in clocks.items():
        try:
            axes[name] = clock.axis
        except (ReadError, SetupError) as problem:
            if report.damage:
                raise of_damaged(report.damage, problem, summary.log) from None
            raise problem.at(summary.log) from None
        flags[name] = clock.flags
        summary.repairs[name] = dict(clock.repairs)
        summary.remarks += clock.remarks
    alone = [
        name
        for name, channel in writer.setup.channels.items()
        if name in lost and channel.kind == "fbg_strain" and channel.temperature_channel not in lost
    ]
    if alone:
        said = f"{', '.join(alone)}: no twin grating, so temperature stays in the strain"
        summary.remarks.append(said)
    if whole:
        summary.sha256, summary.bytes = stream.finish(), stream.size
    provenance = {**vars(summary), "version": __version__, "setup_file": writer.setup.file}
    return writer.finish(axes, flags, provenance)


def clock_of(group: Group, setup: Setup) -> ClockFit:
    """The clock of a group, with the rate that the setup declares.

    For one of its channels or for the log.
    """
    own = [setup.channels[name].sampling_rate_Hz for name in group.channels]
    declared = next((rate for rate in own if rate is not None), setup.log.sampling_rate_Hz)
    return ClockFit(
        file_rate_Hz=group.rate_Hz,
        setup_rate_Hz=declared,
        resolution_s=group.stamp_resolution_s,
        start_s=group.start_s,
        time_example=group.time_example,
        counted=group.counted,
        edges=group.edges,
    )


@contextmanager
def open_recording(
    log: str,
    setup: Setup | None = None,
    *,
    blocks: int | None = None,
    hashed: bool = False,
    check: bool = True,
) -> Iterator[Recording]:
    """`log` (a run, a log, or '-') as a Recording, open as long as the context is.

    Of a log only the first `blocks` if given. A run has its log's sha256 in its provenance, a log
    only if `hashed`. Without `check` it is not asked whether its channels can be a tire's.

    ReadError: nothing could be read. SetupError: no setup for it, or one that does not fit
    (`plausibility`).
    """
    if is_file(log) and is_run(log):
        with open_run(log, shown(log), setup) as recording:
            yield check_recording(recording) if check else recording
        return
    with temporary_folder() as folder:
        with failed_writes(folder / "run"):
            _, run = ingest(log, setup, folder, blocks=blocks, hashed=hashed)
        recording = recording_of(run, shown(log), setup)
        yield check_recording(recording) if check else recording


def write_run(log: str, setup: Setup | None, output: Path) -> IngestSummary:
    """`ingest -o`: the run of `log`, compressed, whole under the name `output` or not at all."""
    with whole_file(output) as part, temporary_folder() as folder:
        summary, run = ingest(log, setup, folder, hashed=True)
        checked = check_recording(recording_of(run, log, setup))
        write_file(run, part)
        summary.remarks += [remark for remark in checked.remarks if remark not in summary.remarks]
        return summary


# ---- What is in a recording, from its metadata alone: one row per channel.


def channel_rows(recording: Recording) -> dict[str, Any]:
    """What is in a recording, one row per channel, from its metadata alone."""
    channels = list(recording.channels.values())
    counts = recording.provenance.get("counts", {})
    return {
        "log": np.array([recording.log] * len(channels), dtype=object),
        "channel": np.array([c.name for c in channels], dtype=object),
        "kind": np.array([c.kind for c in channels], dtype=object),
        "unit": np.array([c.unit or "1" for c in channels], dtype=object),
        "rate_Hz": np.array([c.axis.rate_Hz for c in channels]),
        "samples": np.array([c.size for c in channels]),
        "duration_s": np.array([c.axis.duration_s for c in channels]),
        "gaps": np.array([len(c.axis.gaps()) if c.axis.explicit is None else 0 for c in channels]),
        "lost_samples": np.array([counts.get(f"lost_samples {c.name}", 0) for c in channels]),
        "flagged_ranges": np.array([len(c.flags) for c in channels]),
    }
