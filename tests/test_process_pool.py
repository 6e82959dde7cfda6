"""Property: what processes make is what one makes, in order, whatever becomes of them."""

import os
import signal
import time
from functools import partial

import pytest

from tirelog import runtime
from tirelog.process_pool import POSSIBLE, in_processes, made_apart

pytestmark = pytest.mark.skipif(not POSSIBLE, reason="no process is forked here")


@pytest.mark.parametrize("processes", [1, 2, 3, 9])
def test_answers_come_in_order(processes):
    def make(number: int) -> tuple[int, int]:
        time.sleep(0.02 * (number % 3))
        return number, os.getpid()

    made = list(in_processes(7, processes, make))
    assert [number for number, _ in made] == list(range(7))
    pids = {pid for _, pid in made}
    assert os.getpid() not in pids
    assert 1 <= len(pids) <= processes


@pytest.mark.parametrize("mortal", [{0, 2}, set(range(6))])
def test_what_was_stopped_or_failed_is_made_here(mortal):
    parent = os.getpid()

    def make(number: int) -> tuple[int, bool]:
        if os.getpid() != parent:
            if number in mortal:
                os.kill(os.getpid(), signal.SIGKILL)
            if number == 3:
                raise ValueError("no other process meets it")
        return number, os.getpid() == parent

    made = list(in_processes(6, 3, make))
    assert [number for number, _ in made] == list(range(6))
    assert all(here for number, here in made if number in {*mortal, 3})


def test_an_error_is_that_of_one_process():
    def make(number: int) -> None:
        raise KeyError(number)

    with pytest.raises(KeyError, match="0"):
        next(iter(in_processes(3, 2, make)))


def test_none_is_left_behind(tmp_path):
    def make(number: int) -> int:
        (tmp_path / str(os.getpid())).touch()
        time.sleep(0.0 if number == 0 else 60.0)
        return number

    made = in_processes(4, 2, make)
    assert next(made) == 0
    while len(list(tmp_path.iterdir())) < 2:
        time.sleep(0.01)
    made.close()
    for path in tmp_path.iterdir():
        with pytest.raises(ProcessLookupError):
            os.kill(int(path.name), 0)


@pytest.fixture
def shared(monkeypatch):
    """Two processes share work, however many cores there are."""
    monkeypatch.setattr(runtime, "_PROCESSES", [2])


@pytest.mark.usefixtures("shared")
def test_jobs_are_made_apart_and_come_in_order():
    def job(number: int):
        time.sleep(0.02 * (number % 3))
        return number, os.getpid(), runtime.processes()

    made = made_apart([partial(job, number) for number in range(7)])
    assert [number for number, _, _ in made] == list(range(7))
    assert os.getpid() not in {pid for _, pid, _ in made}
    assert {own for _, _, own in made} == {1}  # what shares work does not share it once more
    assert runtime.processes() == 2


@pytest.mark.usefixtures("shared")
def test_nothing_is_an_answer_too(tmp_path):
    def job(number: int) -> None:
        (tmp_path / f"{number} by {os.getpid()}").touch()

    assert made_apart([partial(job, number) for number in range(3)]) == [None] * 3
    assert len(list(tmp_path.iterdir())) == 3  # and nobody made it again


@pytest.mark.parametrize(("processes", "jobs"), [(1, 4), (2, 1), (2, 0)])
def test_what_cannot_be_shared_is_made_here(monkeypatch, processes, jobs):
    monkeypatch.setattr(runtime, "_PROCESSES", [processes])
    assert made_apart([os.getpid] * jobs) == [os.getpid()] * jobs


def test_work_is_shared_by_as_many_as_there_are_cores(monkeypatch):
    monkeypatch.setattr(runtime, "_PROCESSES", [1])
    for cores, processes in ((1, 1), (2, 2), (64, 2)):
        monkeypatch.setattr(os, "sched_getaffinity", lambda pid, cores=cores: set(range(cores)))
        runtime.share_work()
        assert runtime.processes() == processes
    runtime.share_work(False)
    assert runtime.processes() == 1
