"""The same tasks on a Dask cluster (extra `cluster`).

Another worker takes over if one dies, with the same results.
"""

from __future__ import annotations

from collections.abc import Generator

from tirelog.campaign.ledger import Entry
from tirelog.campaign.work import LogTask, make_tables
from tirelog.errors import ExitStatus, UsageError

_TIMEOUT_S = 8
_RETRIES = 3


def on_cluster(tasks: list[LogTask], scheduler: str) -> Generator[Entry, None, None]:
    """Entries as they come.

    UsageError: dask.distributed is missing, or the scheduler does not answer.
    """
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise UsageError(
            "--scheduler needs dask.distributed; it comes with the extra: "
            "pip install 'tirelog[cluster]'"
        ) from None
    try:
        client = Client(scheduler, timeout=_TIMEOUT_S)
    except (OSError, ValueError, TypeError) as problem:
        raise UsageError(
            f"--scheduler {scheduler} does not answer ({type(problem).__name__}); "
            "allowed is tcp://HOST:PORT; start it first"
        ) from None
    with client:
        futures = {
            client.submit(
                make_tables,
                task,
                key=f"tirelog-{task.key}-{task.name}",
                retries=_RETRIES,
                pure=False,
            ): task
            for task in tasks
        }
        for future in as_completed(list(futures)):
            task = futures[future]
            if future.status == "finished":
                yield future.result()
            else:
                error = (
                    f"{task.log}: no worker of the cluster finished it ({future.exception()}); "
                    "look at the cluster's own log"
                )
                yield Entry(
                    task.log, task.name, task.key, error=error, exit_status=int(ExitStatus.DEFECT)
                )
