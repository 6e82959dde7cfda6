"""One log's task, carried out in a worker.

It opens the log once, writes all its tables and what models need of it, and says how it went.

The worker's memory is that of one command on one log, which streams: blocks of a fixed size,
whatever the log's length. What models need are the means of like revolutions
(`inference.cells.pieces`, 25 kB each); the revolutions that they are made of (8 kB each, one
channel) are in memory only here, and only while they are averaged.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.campaign.folder import moved_into
from tirelog.campaign.ledger import Entry
from tirelog.campaign.names import HIDDEN
from tirelog.data.recording import Recording
from tirelog.data.setup import parse_setup
from tirelog.errors import ExitStatus, OutputError, TirelogError, UsageError, is_outside_log
from tirelog.products import OF_A_DRIVE, tables_of
from tirelog.runs.ingest import open_recording
from tirelog.storage.remote import address
from tirelog.storage.whole import whole_file
from tirelog.tables.writer import TableWriter
from tirelog.version import __version__


@dataclass(frozen=True)
class LogTask:
    """What a worker is sent: only text and numbers, so that it can travel to another machine.

    `observables`: whose pieces are kept. `unreached`: `problem` is not the log's own.
    """

    log: str
    name: str
    key: str
    setup_text: str
    setup_file: str
    tables: Mapping[str, Mapping[str, Any]]
    output: str
    temporary: str
    problem: str = ""
    observables: tuple[str, ...] = ()
    unreached: bool = False


def make_tables(task: LogTask) -> Entry:
    """Write the log's tables and its pieces; a failure is in the entry, never raised.

    The tables go to `output/table=NAME/log=NAME/part.parquet`.
    """
    entry = Entry(task.log, task.name, task.key)
    begun, folder_before = time.perf_counter(), tempfile.tempdir
    try:
        if task.problem:
            raise UsageError(task.problem, file=task.log)
        tempfile.tempdir = task.temporary if Path(task.temporary).is_dir() else None
        with open_recording(task.log, parse_setup(task.setup_text, task.setup_file)) as recording:
            entry.remarks += recording.remarks
            suited = {
                name: options
                for name, options in task.tables.items()
                if OF_A_DRIVE[name].suits(recording)
            }
            if task.tables and not suited:
                raise UsageError(
                    f"has no channel for {', '.join(task.tables)}",
                    allowed="see tirelog info",
                    do="narrow the glob",
                    file=task.log,
                )
            entry.remarks += [
                f"no channel for {name}" for name in task.tables if name not in suited
            ]
            _make(suited, recording, task, entry)
            _keep_pieces(recording, task, entry)
            entry.losses = list(recording.losses)
        entry.exit_status = int(ExitStatus.INPUT_LOST if entry.losses else ExitStatus.DONE)
    except TirelogError as problem:
        # a shared setup that does not fit this log names itself alone
        told = task.log in str(problem.file)
        entry.error, entry.exit_status = (
            str(problem) if told else f"{task.log}: {problem}",
            int(problem.exit_status),
        )
        entry.fault = (
            "output"
            if isinstance(problem, OutputError)
            else "machine"
            if is_outside_log(problem)
            else "log"
        )
    except (
        Exception
    ) as problem:  # one log's failure, also a defect of our own, must not stop the campaign
        what = f"({type(problem).__name__}: {problem})"
        entry.fault = "machine" if is_outside_log(problem) else "log"
        whose = "the machine refuses" if entry.fault == "machine" else "a defect of tirelog's own"
        entry.error, entry.exit_status = f"{task.log}: {whose} {what}", int(ExitStatus.DEFECT)
    finally:
        # the next log's folder may be another, or gone
        tempfile.tempdir = folder_before
    entry.seconds = round(time.perf_counter() - begun, 3)
    entry.peak_memory_MB = round(_peak_memory_MB(), 1)
    return entry


def _peak_memory_MB() -> float:
    """The largest resident memory of this process [MB].

    `ru_maxrss` begins at that of the process that started it.
    """
    try:
        status = Path("/proc/self/status").read_text("ascii")
        return int(status.split("VmHWM:")[1].split()[0]) / 1024
    except (OSError, IndexError, ValueError):
        if sys.platform == "win32":
            return float("nan")
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def table_part_name(table: str, log: str) -> str:
    """Where a log's rows of a table stand in the output folder."""
    return f"table={table}/log={log}/part.parquet"


def pieces_name(observable: str, log: str) -> str:
    """Where a log's pieces stand in the output folder.

    The folder's name changes with what is in them.
    """
    return f"{HIDDEN}/means/{observable}/{log}.npz"


@contextmanager
def _written(output: str, name: str) -> Iterator[str]:
    """Path or address to write a file of the output folder to.

    A path's file takes its place at the end.
    """
    if address(output) is not None:
        yield f"{output}/{name}"
    else:
        with moved_into(Path(output), name) as unmoved:
            yield str(unmoved)


def _make(
    wanted: Mapping[str, Mapping[str, Any]], recording: Recording, task: LogTask, entry: Entry
) -> None:
    """The tables of one log.

    The column `log` is the partition, so that readers of the dataset get it from the folder's name.
    """
    metadata = {"key": task.key, "log": task.log, "version": __version__}
    with ExitStack() as open_tables:
        writers: dict[str, TableWriter] = {}
        for name in wanted:
            path = open_tables.enter_context(
                _written(task.output, table_part_name(name, task.name))
            )
            writers[name] = open_tables.enter_context(
                TableWriter(name, path, "parquet", metadata=metadata)
            )
            entry.quality[name] = {}
        for part in tables_of(recording, wanted):
            entry.remarks += [remark for remark in part.remarks if remark not in entry.remarks]
            columns, words = part.columns, entry.quality[part.table]
            for word, n in zip(
                *np.unique(np.asarray(columns["quality"], dtype=str), return_counts=True),
                strict=True,
            ):
                words[str(word)] = words.get(str(word), 0) + int(n)
            writers[part.table].write(
                {key: value for key, value in columns.items() if key != "log"}
            )
        entry.rows |= {name: writer.rows for name, writer in writers.items()}


def _keep_pieces(recording: Recording, task: LogTask, entry: Entry) -> None:
    """The pieces of each observable that models of the campaign ask for.

    Why there are none is in the entry, and is no failure.
    """
    if not task.observables:
        return
    from tirelog.campaign.pieces_file import pieces_bytes
    from tirelog.inference.cells.gathering import pieces_of_all
    from tirelog.inference.measured import measured
    from tirelog.vocabulary.observables import OBSERVABLES

    for observable in task.observables:
        known = OBSERVABLES.get(observable)
        if known is None or not recording.of_kind(*known.kinds):
            entry.pieces[observable] = f"no channel for {observable}"
            continue
        try:
            pieces = pieces_of_all(measured([recording], observable).stacks)
        except TirelogError as problem:
            entry.pieces[observable] = problem.message
            continue
        with (
            _written(task.output, pieces_name(observable, task.name)) as place,
            whole_file(place) as part,
        ):
            part.write_bytes(pieces_bytes(pieces))
        entry.pieces[observable] = ""
