"""For all tests: signals that end a process do so, also where the tests were started by `nohup` or
in the background; and tests that share something dear share it.
"""

from __future__ import annotations

import signal
import threading
from typing import Any

import pytest

if threading.current_thread() is threading.main_thread():
    for number, usual in (
        (signal.SIGINT, signal.default_int_handler),
        (signal.SIGHUP, signal.SIG_DFL),
    ):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, usual)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: Any, log: Any) -> Any:
    """Tests of one group on one worker, also without `--dist loadgroup`.

    They share what takes half a minute to make.
    """
    from xdist.scheduler import LoadGroupScheduling

    return LoadGroupScheduling(config, log) if config.getoption("dist") == "load" else None
