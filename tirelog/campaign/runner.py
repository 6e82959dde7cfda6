"""A campaign carried out.

All open tasks are done, on processes of this machine, and the outcome is added up.

Tasks do not depend on one another, and each writes its own files. So neither order nor place of
work changes a byte of the result.
"""

from __future__ import annotations

import csv
import io
import os
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, closing
from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.campaign.ledger import HIDDEN, Entry, Folder, Ledger, key_of, log_of, pieces_bytes
from tirelog.campaign.manifest import Campaign, LogTask
from tirelog.data.recording import Recording
from tirelog.errors import (
    OutputError,
    TirelogError,
    UsageError,
    is_outside_log,
)
from tirelog.process_pool import ending_pool
from tirelog.products import OF_A_DRIVE, tables_of
from tirelog.runs.ingest import open_recording
from tirelog.runtime import end_with_parent, one_heap, one_thread
from tirelog.storage.whole import whole_file
from tirelog.tables.writer import TableWriter
from tirelog.version import __version__

# ---- One log's task, carried out in a worker.
#
# It opens the log once, writes all its tables and what models need of it, and says how it went.
#
# The worker's memory is that of one command on one log, which streams: blocks of a fixed size,
# whatever the log's length. What models need are the means of similar revolutions
# (`inference.cells.pieces`, 25 kB each); the revolutions that they are made of (8 kB each, one
# channel) are in memory only here, and only while they are averaged.


def make_tables(task: LogTask) -> Entry:
    """Write the log's tables and its pieces; a failure is in the entry, never raised.

    The tables go to `output/table=NAME/log=NAME/part.parquet`.
    """
    entry = Entry(task.log, task.name, task.key)
    begun, folder_before = time.perf_counter(), tempfile.tempdir
    try:
        if task.problem:
            raise UsageError(task.problem, file=task.log)
        temporary = Folder(task.output).temporary
        tempfile.tempdir = str(temporary) if temporary.is_dir() else None
        with open_recording(task.log, task.setup) as recording:
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
    # one log's failure, also a defect of our own, must not stop the campaign
    except Exception as problem:
        outside = is_outside_log(problem)
        entry.fault = "machine" if outside else "log"
        if isinstance(problem, OutputError):
            entry.fault = "output"
        if isinstance(problem, TirelogError):
            # a shared setup that does not fit this log names itself alone
            entry.error = f"{'' if task.log in str(problem.file) else f'{task.log}: '}{problem}"
        else:
            whose = "the machine refuses" if outside else "a defect of tirelog's own"
            entry.error = f"{task.log}: {whose} ({type(problem).__name__}: {problem})"
    finally:
        # the next log's folder may be another, or gone
        tempfile.tempdir = folder_before
    entry.seconds = round(time.perf_counter() - begun, 3)
    entry.peak_memory_MB = round(_peak_memory_MB(), 1)
    return entry


def _peak_memory_MB() -> float:
    """The largest resident memory of this process [MB]; NaN where the system does not say it."""
    try:
        status = Path("/proc/self/status").read_text("ascii")
        return int(status.split("VmHWM:")[1].split()[0]) / 1024
    except (OSError, IndexError, ValueError):
        return float("nan")


def table_part_name(table: str, log: str) -> str:
    """Where a log's rows of a table stand in the output folder."""
    return f"table={table}/log={log}/part.parquet"


def pieces_name(observable: str, log: str) -> str:
    """Where a log's pieces stand in the output folder.

    The folder's name changes with what is in them.
    """
    return f"{HIDDEN}/means/{observable}/{log}.npz"


def _make(
    wanted: Mapping[str, Mapping[str, Any]], recording: Recording, task: LogTask, entry: Entry
) -> None:
    """The tables of one log.

    The column `log` is the partition, so that readers of the dataset get it from the folder's name.
    """
    metadata = {"key": task.key, "log": task.log, "version": __version__}
    folder = Folder(task.output)
    with ExitStack() as open_tables:
        writers: dict[str, TableWriter] = {}
        for name in wanted:
            path = str(folder.place(table_part_name(name, task.name)))
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
    from tirelog.inference.cells.pieces import pieces_of_all
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
        with whole_file(Folder(task.output).place(pieces_name(observable, task.name))) as part:
            part.write_bytes(pieces_bytes(pieces))
        entry.pieces[observable] = ""


def plan_tasks(campaign: Campaign, ledger: Ledger, *, only: str | None = None) -> list[LogTask]:
    """One task per log, each with its key.  UsageError: `only` matches none."""
    logs = [
        log
        for log in campaign.logs
        if only is None or fnmatch(log.log, only) or fnmatch(Path(log.log).name, only)
    ]
    if not logs:
        raise UsageError(
            f"--only {only!r} matches none of the campaign's {len(campaign.logs)} logs",
            do="correct the pattern",
            file=campaign.file,
        )
    observables = tuple(dict.fromkeys(model.observable for model in campaign.models))
    return [_task(campaign, log, ledger, observables) for log in logs]


def _task(
    campaign: Campaign, log: LogTask, ledger: Ledger, observables: tuple[str, ...]
) -> LogTask:
    text = log.setup.text if log.setup else ""
    digest, problem, unreached = "", log.problem, False
    try:
        digest = ledger.sha256(log.log)
    except OSError as error:
        problem, unreached = f"cannot be read ({error.strerror})", is_outside_log(error)
    tables = {name: dict(options) for name, options in campaign.tables.items()}
    key = key_of(digest, text + problem, _with_contents(tables, ledger), __version__)
    return replace(
        log,
        problem=problem,
        key=key,
        tables=tables,
        output=ledger.folder.root,
        observables=observables,
        unreached=unreached,
    )


def _with_contents(tables: Mapping[str, Mapping[str, Any]], ledger: Ledger) -> dict[str, Any]:
    """The options, each file among them by what is in it and not by where it is."""
    files = {
        name: {option.name for option in OF_A_DRIVE[name].table.options if option.kind is Path}
        for name in tables
    }
    return {
        name: {
            option: ledger.sha256(str(value)) if option in files[name] else value
            for option, value in options.items()
        }
        for name, options in tables.items()
    }


def to_do(tasks: Iterable[LogTask], ledger: Ledger, *, retry_failed: bool = False) -> list[LogTask]:
    """The tasks that are left.

    Those that the ledger does not have under their key, or whose parts are gone, or pieces that a
    model asks for; with `retry_failed` the failed ones as well.
    """
    there = ledger.folder.names()

    def is_left(task: LogTask) -> bool:
        entry = ledger.entries.get(task.name)
        if entry is None or entry.key != task.key:
            return True
        if entry.error:
            return retry_failed
        made = {table_part_name(table, task.name) for table in entry.rows}
        made |= {pieces_name(name, task.name) for name, why in entry.pieces.items() if not why}
        return not made <= there or not entry.pieces.keys() >= set(task.observables)

    return list(filter(is_left, tasks))


def run_tasks(
    campaign: Campaign,
    ledger: Ledger,
    tasks: list[LogTask],
    *,
    workers: int,
    report: Callable[[Entry, int, int], None],
) -> list[str]:
    """Sentences on the logs that stay open after the `tasks`, since not the log was at fault.

    `report(entry, number, of)` is called after each. An open log is not recorded. A log that fails
    leaves no part of an older outcome behind; one that cannot be reached keeps it.

    OutputError: the output cannot be written (a full disk); finished logs are kept, and the others
    stay open.
    """
    by_name = {task.name: task for task in tasks if not task.unreached}
    left_open = [f"{task.log}: {task.problem}" for task in tasks if task.unreached]
    if not by_name:
        return left_open
    ledger.forget(set(by_name))
    tasks = list(by_name.values())
    with closing(
        _on_processes(tasks, workers)
    ) as finished:  # at once, also when what follows fails: nobody works on after this
        for number, entry in enumerate(finished, 1):
            if entry.fault == "output":
                raise OutputError(entry.error)
            is_open = bool(entry.error) and entry.fault == "machine"
            if entry.error:
                parts = [table_part_name(table, entry.name) for table in campaign.tables]
                ledger.folder.remove(parts)
            if is_open:
                left_open.append(entry.error)
            else:
                ledger.record(entry)
            report(entry, number, len(tasks))
    return left_open


def strangers(campaign: Campaign, ledger: Ledger) -> list[str]:
    """Logs with parts in the dataset that the manifest does not have (any more).

    A reader of the dataset reads them too.
    """
    return sorted(
        {log_of(name) for name in ledger.folder.names()}
        - {log.name for log in campaign.logs}
        - {""}
    )


def _on_processes(tasks: list[LogTask], workers: int) -> Generator[Entry, None, None]:
    """The entries of tasks on processes of this machine, as they are finished.

    A worker that dies takes the pool with it. Whoever was at work then is a suspect, and is tried
    alone, so that no death is held against a neighbour; then a new pool goes on.
    """
    waiting, suspects = {task.name: task for task in tasks}, set[str]()
    one_thread()  # inherited: a worker's share is one core
    # nor do they hear, by multiprocessing's tracker, of what a killed one has left
    warned = os.environ.get("PYTHONWARNINGS", "")
    if "ignore:resource_tracker" not in warned:
        os.environ["PYTHONWARNINGS"] = ",".join(filter(None, (warned, "ignore:resource_tracker")))
    while waiting:
        suspect = next((task for task in waiting.values() if task.name in suspects), None)
        at_work: dict[str, LogTask] = {}
        queue = [suspect] if suspect else list(waiting.values())
        try:
            for entry in _by_pool(queue, 1 if suspect else workers, at_work):
                del waiting[entry.name]
                yield entry
        except BrokenProcessPool:
            if suspect is None:
                suspects |= set(at_work)
                continue
            del waiting[suspect.name]
            yield Entry(
                suspect.log,
                suspect.name,
                suspect.key,
                f"{suspect.log}: its worker died twice (out of memory, or killed); free memory or "
                "use fewer workers",
                fault="machine",
            )


def _by_pool(
    queue: list[LogTask], workers: int, at_work: dict[str, LogTask]
) -> Generator[Entry, None, None]:
    """The entries of tasks, as one pool finishes them; `at_work` are those it has now, by name.

    BrokenProcessPool: a worker died; it was at work on one of these.
    """
    with ending_pool(workers, "spawn", _begin) as pool:
        left = deque(queue)
        running: dict[Future[Entry], LogTask] = {}
        while left or running:
            while left and len(running) < workers:  # no more: whoever dies names the suspects
                task = left.popleft()
                at_work[task.name] = task
                running[pool.submit(make_tables, task)] = task
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                entry = future.result()
                del at_work[running.pop(future).name]
                yield entry


def _begin(parent: int) -> None:
    """Prepare a worker process, before anything else in it."""
    end_with_parent(parent)
    one_heap()
    # HDF5 objects that are forgotten on a full disk print a traceback each, behind the error that
    # the entry carries
    sys.excepthook = lambda *_: None
    sys.unraisablehook = lambda _: None


def write_summary(campaign: Campaign, ledger: Ledger) -> str:
    """summary.csv beside the tables: a row per log of the manifest, with its tags."""
    tags = sorted({tag for log in campaign.logs for tag in log.tags})
    stream = io.StringIO(newline="")
    writer = csv.writer(stream)
    about = ("log", "name", "status", "error", "rows", "quality", "losses", "seconds")
    writer.writerow([*about, "peak_memory_MB", *tags])
    order = [*campaign.tables]
    for log in campaign.logs:
        entry, row = ledger.entries.get(log.name), ["open", "", "", "", "", "", ""]
        if entry is not None:
            # tables in the manifest's order, others behind, their quality words in the alphabet's
            made = [table for table in order if table in entry.rows]
            made += sorted(entry.rows.keys() - order)
            quality = (
                f"{table}.{word.replace(';', '+')}={n}"
                for table in made
                for word, n in sorted(entry.quality.get(table, {}).items())
            )
            row = [
                "failed" if entry.error else "lost input" if entry.losses else "done",
                entry.error,
                ";".join(f"{table}={entry.rows[table]}" for table in made),
                ";".join(quality),
                str(len(entry.losses)),
                str(entry.seconds),
                str(entry.peak_memory_MB),
            ]
        writer.writerow([log.log, log.name, *row, *(log.tags.get(tag, "") for tag in tags)])
    ledger.folder.write("summary.csv", stream.getvalue().encode())
    return f"{ledger.folder.root}/summary.csv"
