"""Property: a terminal shows what a command is working on, and nothing else shows it."""

import importlib
import io
import time
from contextlib import contextmanager

import pytest

from tirelog.cli import session
from tirelog.cli.session import working
from tirelog.errors import TirelogError


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def on_terminal(monkeypatch):
    """Makes standard error a terminal from now on (capturing sets it anew before the test)."""

    def begin():
        seen = Terminal()
        monkeypatch.setattr("sys.stderr", seen)
        return seen

    monkeypatch.setattr(session, "PATIENCE_S", 0.01)
    monkeypatch.setenv("TERM", "xterm")
    return begin


def until(seen, text, seconds=10.0):
    """Wait until it is there; AssertionError if it never is."""
    end = time.monotonic() + seconds
    while text not in seen.getvalue():
        assert time.monotonic() < end, seen.getvalue()
        time.sleep(0.01)


def test_a_line_says_what_is_worked_on_and_goes(on_terminal):
    terminal = on_terminal()
    with working(shown=True) as say:
        say("reading a.csv", 0, 2)
        until(terminal, "reading a.csv")
        say("reading b\x1b[31m.csv", 1, 2)
        until(terminal, "reading b")
    shown = terminal.getvalue()
    assert "\x1b[31m.csv" not in shown  # what a file's name holds is not sent to the terminal
    assert shown.endswith(("\x1b[2K", "\x1b[1A\x1b[2K"))  # the line is wiped


def test_what_is_quick_or_not_shown_leaves_nothing(on_terminal, monkeypatch):
    terminal = on_terminal()
    with working(shown=False) as say:
        say("reading a.csv")
        time.sleep(0.05)
    monkeypatch.setattr(session, "PATIENCE_S", 60.0)
    with working(shown=True) as say:
        say("reading a.csv")
    assert terminal.getvalue() == ""


def test_a_table_ends_with_its_summary_in_a_terminal_only(tirelog, folder, on_terminal):
    out = folder / "speed.csv"
    log = str(next(folder.glob("*.csv")))
    tirelog("speed", log, "-o", str(out))
    rows = len(out.read_text().splitlines()) - 1
    piped = tirelog("speed", log, "-o", str(out)).err
    assert "row" not in piped
    terminal = on_terminal()
    session.summary(out, rows, 1, time.monotonic())
    assert f"speed.csv: {rows} rows, 0.0 s" in terminal.getvalue()
    session.summary(out, 1, 2, time.monotonic())
    assert "speed.csv: 1 row of 2 logs" in terminal.getvalue()


class Begun(TirelogError):
    """What stands in for the work of a command: it has come so far."""


@pytest.mark.parametrize(
    ("work", "words"),
    [
        ("tirelog.api.answers.propose", "propose log.csv --model m.toml"),
        ("tirelog.api.answers.diagnose", "diagnose log.csv --model m.toml"),
        ("tirelog.api.answers.ladder", "ladder log.csv --model m.toml"),
        ("tirelog.api.answers.compare", "compare log.csv --model m.toml"),
        ("tirelog.api.answers.fit", "model fit log.csv --model m.toml -o n.toml"),
        ("tirelog.report.build.build", "report log.csv -o r.html"),
        ("tirelog.api.logs.simulated_log", "simulate s.toml -o s.csv"),
        ("tirelog.api.logs.write_run", "ingest log.csv -o r.h5"),
        ("tirelog.physics.moving.ring.modes_of_model", "model modes m.toml"),
        ("tirelog.campaign.models.run_models", "campaign run c.toml"),
    ],
)
def test_what_takes_long_is_said_in_a_terminal(tirelog, folder, monkeypatch, work, words):
    (folder / "c.toml").write_text(
        '[campaign]\nname = "c"\noutput = "made"\n[[logs]]\nglob = "log.csv"\n'
        '[tables.speed]\n[[models]]\nfile = "m.toml"\n'
    )
    assert tirelog("model", "new", "-o", "m.toml", "--quiet").status == 0
    said, open_lines = [], []

    @contextmanager
    def line(*, shown):
        open_lines.append(shown)
        yield lambda text, *more: said.append(text)
        open_lines.pop()

    def begun(*given, **more):
        assert open_lines
        assert said[-1]
        raise Begun("so far")

    monkeypatch.setattr(session, "working", line)
    module, name = work.rsplit(".", 1)
    monkeypatch.setattr(importlib.import_module(module), name, begun)
    assert "so far" in tirelog(*words.split()).err
