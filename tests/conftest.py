"""For all tests: signals end processes under `nohup` too; tests share what is dear."""

from __future__ import annotations

import re
import signal
import threading
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tirelog.runtime import one_thread

one_thread()  # before a test imports numpy: numbers and times are then those of a command

if threading.current_thread() is threading.main_thread():
    for number, usual in (
        (signal.SIGINT, signal.default_int_handler),
        (signal.SIGHUP, signal.SIG_DFL),
    ):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, usual)


@pytest.fixture(autouse=True, scope="session")
def no_list_of_the_user_s(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What tests let run is not remembered in the user's home."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@cache
def group_of(path: Path) -> str:
    """The group that a file of tests is marked with as a whole, '' if with none."""
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    found = re.search(r'^pytestmark = pytest\.mark\.xdist_group\("([^"]+)"\)', text, re.MULTILINE)
    return found[1] if found else ""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Tests of one group go to one worker: they share what takes half a minute to make.

    xdist's own way writes the group into a test's name, which newer ones of pytest do not let it.
    """
    if config.getoption("dist") not in ("load", "loadgroup"):
        return None
    from xdist.scheduler import LoadScopeScheduling

    class Grouped(LoadScopeScheduling):  # type: ignore[misc]  # xdist has no types
        def _split_scope(self, nodeid: str) -> str:
            return group_of(config.rootpath / nodeid.split("::")[0]) or nodeid

    return Grouped(config, log)
