"""Property: what processes make is what one makes, in order, whatever becomes of them."""

import os
import signal
import time

import pytest

from tirelog.apart import POSSIBLE, Wire, apart

pytestmark = pytest.mark.skipif(not POSSIBLE, reason="no process is forked here")


def again(number, before):
    return number, before, os.getpid()


def by_hand(count, first):
    """(number, what was told before it), if those from `first` on tell their own."""
    return [(number, first if number > first else None) for number in range(count)]


@pytest.mark.parametrize("processes", [1, 2, 3, 9])
@pytest.mark.parametrize("first", [0, 2])
def test_in_order_and_from_the_first_that_was_told(processes, first):
    def make(number: int, line: Wire):
        time.sleep(0.02 * (number % 3))
        before = line.ask()
        line.tell(number if number >= first else None)
        line.tell("a second time does not count")
        return number, before, os.getpid()

    made = list(apart(7, processes, make, again))
    assert [one[:2] for one in made] == by_hand(7, first)
    pids = {one[2] for one in made}
    assert os.getpid() not in pids
    assert 1 <= len(pids) <= processes


def test_what_tells_nothing_keeps_nobody_waiting():
    made = apart(6, 2, lambda number, line: (number, line.ask() if number % 2 else None), again)
    assert list(made) == [(number, None) for number in range(6)]


def test_what_was_stopped_or_failed_is_made_here():
    def make(number: int, line: Wire):
        before = line.ask()
        if number == 2:
            os.kill(os.getpid(), signal.SIGKILL)
        if number == 3:
            raise ValueError("said by whoever does it again")
        line.tell(number)
        return number, before, os.getpid()

    made = list(apart(6, 2, make, again))
    assert [one[0] for one in made] == list(range(6))
    assert [one[2] == os.getpid() for one in made] == [number in (2, 3) for number in range(6)]
    assert [one[1] for one in made] == [None, 0, 0, 0, 0, 0]


def test_all_of_them_stopped():
    def make(number: int, line: Wire):
        os.kill(os.getpid(), signal.SIGKILL)

    assert [one[:2] for one in apart(5, 2, make, again)] == [(number, None) for number in range(5)]


def test_an_error_is_that_of_one_process():
    def make(number: int, line: Wire):
        raise OSError

    def fails(number: int, before: object):
        raise KeyError(number)

    with pytest.raises(KeyError, match="0"):
        next(iter(apart(3, 2, make, fails)))


def test_none_is_left_behind(tmp_path):
    def make(number: int, line: Wire):
        (tmp_path / str(os.getpid())).touch()
        time.sleep(0.0 if number == 0 else 60.0)
        return number

    made = apart(4, 2, make, again)
    assert next(made) == 0
    while len(list(tmp_path.iterdir())) < 2:
        time.sleep(0.01)
    made.close()
    for path in tmp_path.iterdir():
        with pytest.raises(ProcessLookupError):
            os.kill(int(path.name), 0)
