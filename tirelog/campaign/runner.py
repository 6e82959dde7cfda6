"""Carrying out a campaign: what is not done is done, on processes of this machine or a Dask cluster, and the outcome is added up.

Tasks do not depend on one another, and each writes its own files, so neither order nor place of work changes a byte of the result.
"""

from __future__ import annotations

import csv
import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from fnmatch import fnmatch
from pathlib import Path

from tirelog import __version__
from tirelog.campaign.ledger import Entry, Ledger, key_of
from tirelog.campaign.manifest import Campaign, CampaignLog
from tirelog.campaign.work import Task, make_tables, part_path
from tirelog.errors import ExitStatus, UsageError
from tirelog.files import whole_file

#: a log whose worker died this often is failed
_ATTEMPTS = 3
SUMMARY = ("log", "name", "status", "error", "rows", "quality", "losses", "seconds", "peak_memory_MB")


def plan(campaign: Campaign, ledger: Ledger, *, only: str | None = None) -> list[Task]:
    """A task a log, each with its key.  UsageError: `only` matches none."""
    logs = [log for log in campaign.logs if only is None or fnmatch(log.path, only) or fnmatch(Path(log.path).name, only)]
    if not logs:
        raise UsageError(f"--only {only!r} matches none of the campaign's {len(campaign.logs)} logs; mend the pattern", file=campaign.file)
    tasks = [_task(campaign, log, ledger) for log in logs]
    ledger.save_hashes()
    return tasks


def _task(campaign: Campaign, log: CampaignLog, ledger: Ledger) -> Task:
    text = log.setup.text if log.setup else ""
    try:
        digest, problem = ledger.sha256(log.path), log.problem
    except OSError as error:
        digest, problem = "", f"cannot be read ({error.strerror})"
    tables = {name: dict(options) for name, options in campaign.tables.items()}
    key = key_of(digest, text + problem, tables, __version__)
    setup_file = (log.setup.file or "") if log.setup else ""
    return Task(log.path, log.name, key, text, setup_file, tables, str(campaign.output), str(ledger.temporary), problem)


def to_do(tasks: Iterable[Task], ledger: Ledger, *, retry_failed: bool = False) -> list[Task]:
    """The tasks that the ledger does not have under their key, or whose parts are gone; with `retry_failed` the failed ones as well."""
    return [task for task in tasks if not _done(task, ledger.entry(task.name), retry_failed)]


def _done(task: Task, entry: Entry | None, retry_failed: bool) -> bool:
    if entry is None or entry.key != task.key:
        return False
    if entry.error:
        return not retry_failed
    return all(part_path(task.output, table, task.name).is_file() for table in entry.rows)


def run(
    campaign: Campaign, ledger: Ledger, tasks: list[Task], *, workers: int, scheduler: str | None, said: Callable[[Entry, int, int], None]
) -> None:
    """Carry out `tasks`; `said(entry, finished, of)` after each.  A log that fails leaves no part of an older outcome behind."""
    for task in tasks:
        for table in [path.name.removeprefix("table=") for path in campaign.output.glob("table=*")]:
            part_path(task.output, table, task.name).unlink(missing_ok=True)
    if scheduler is not None:
        from tirelog.campaign.cluster import on_cluster

        finished = on_cluster(tasks, scheduler)
    else:
        finished = _on_processes(tasks, workers)
    for number, entry in enumerate(finished, 1):
        if entry.error:
            for table in campaign.tables:
                part_path(campaign.output, table, entry.name).unlink(missing_ok=True)
        ledger.record(entry)
        said(entry, number, len(tasks))


def _on_processes(tasks: list[Task], workers: int) -> Iterator[Entry]:
    """Entries as they come.  A worker that dies takes the pool with it: a new pool goes on with what was not finished."""
    waiting = {task.name: task for task in tasks}
    tried: dict[str, int] = dict.fromkeys(waiting, 0)
    context = multiprocessing.get_context("spawn")
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # inherited: a worker's share is one core, and its libraries start their threads on import
    while waiting:
        with ProcessPoolExecutor(workers, mp_context=context) as pool:
            queue = list(waiting.values())
            running: dict[Future[Entry], Task] = {}
            try:
                while queue or running:
                    while queue and len(running) < workers:  # no more than the workers: whoever dies names the suspects
                        task = queue.pop(0)
                        tried[task.name] += 1
                        running[pool.submit(make_tables, task)] = task
                    done, _ = wait(running, return_when=FIRST_COMPLETED)
                    for future in done:
                        entry = future.result()
                        task = running.pop(future)
                        del waiting[task.name]
                        yield entry
            except BrokenProcessPool:
                for task in [t for t in waiting.values() if tried[t.name] >= _ATTEMPTS]:
                    del waiting[task.name]
                    yield _died(task)


def _died(task: Task) -> Entry:
    error = f"{task.log}: its worker died {_ATTEMPTS} times (out of memory, or killed); free memory or use fewer workers"
    return Entry(task.log, task.name, task.key, error=error, exit_status=int(ExitStatus.DEFECT))


def write_summary(campaign: Campaign, ledger: Ledger) -> Path:
    """summary.csv beside the tables: a row a log of the manifest, with its tags."""
    tags = sorted({tag for log in campaign.logs for tag in log.tags})
    path = campaign.output / "summary.csv"
    with whole_file(path) as part, part.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow([*SUMMARY, *tags])
        for log in campaign.logs:
            entry = ledger.entry(log.name)
            writer.writerow([*_summary_row(log, entry), *(log.tags.get(tag, "") for tag in tags)])
    return path


def _summary_row(log: CampaignLog, entry: Entry | None) -> list[object]:
    if entry is None:
        return [log.path, log.name, "open", "", "", "", "", "", ""]
    rows = ";".join(f"{table}={n}" for table, n in entry.rows.items())
    quality = ";".join(f"{table}.{word.replace(';', '+')}={n}" for table, words in entry.quality.items() for word, n in words.items())
    status = "failed" if entry.error else "lost input" if entry.losses else "done"
    return [log.path, log.name, status, entry.error, rows, quality, len(entry.losses), entry.seconds, entry.peak_memory_MB]
