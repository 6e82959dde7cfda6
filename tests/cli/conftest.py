"""A small log with known pulses, its setup, and the command line in this process."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest

from tirelog.cli import run
from tirelog.cli.app import command

SETUP = """[tire]
name = "test"
unloaded_radius_m = 0.3126
rolling_radius_m = 0.305
[channels.strain_1]
kind = "fbg_strain"
source = "CH1"
unit = "nm"
reference_wavelength_nm = 1550.0
temperature_channel = "temp_1"
[channels.temp_1]
kind = "fbg_temperature"
source = "CH2"
reference_wavelength_nm = 1542.0
[log]
time = "time_s"
"""
RATE_HZ = 2500.0


class Outcome(NamedTuple):
    status: int
    out: str
    err: str

    def ended(self, status: int, *said: str) -> Outcome:
        """Itself; AssertionError unless it ended with this status and these words in its error."""
        assert self.status == status, self.err
        assert [words for words in said if words not in self.err] == [], self.err
        assert "Traceback" not in self.err
        return self

    def refused(self, *said: str, status: int = 2) -> None:
        """AssertionError unless it ended with this status and these words in its error."""
        self.ended(status, *said)


Command = Callable[..., Outcome]


def pulse_rows(seconds: float = 4.0, speed_m_s: float = 12.0) -> list[str]:
    """Rows of a log at constant speed: time, strain grating with pulses, temperature twin."""
    return list(_rows(seconds, speed_m_s))


@cache
def _rows(seconds: float, speed_m_s: float) -> tuple[str, ...]:
    t = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    x = (np.mod(speed_m_s * t / 0.305, 2 * np.pi) - np.pi) * 0.305
    strain = 1e-3 * (
        0.35 * np.exp(-(((np.abs(x) - 0.09) / 0.04) ** 2)) - np.exp(-((x / 0.035) ** 2))
    )
    wavelength = 1550 * (1 + strain / 1.27) + 0.0008 * np.random.default_rng(4).standard_normal(
        t.size
    )
    return tuple(f"{a:.4f},{b:.4f},1542.0000" for a, b in zip(t, wavelength, strict=True))


def commands(parsed: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """(path, command) of every command that does something."""
    below = getattr(parsed, "commands", None)
    if below is None:
        yield path, parsed
    for name, one in (below or {}).items():
        yield from commands(one, f"{path} {name}".strip())


#: the command line whole, which takes a tenth of a second to make
_parser = cache(command)


def command_of(words: list[str]) -> tuple[Any, list[str]]:
    """The command, or group of commands, that words begin with, and the words behind its name."""
    one, rest = _parser(), words
    while rest and rest[0] in getattr(one, "commands", {}):
        one, rest = one.commands[rest[0]], rest[1:]
    return one, rest


def refuse_other_options(one: Any, words: str) -> None:
    """AssertionError: an option among the words is none of the command's."""
    known = {option for p in one.params for option in (*p.opts, *p.secondary_opts)}
    used = re.findall(r"(?<![\w-])--?[a-z][\w-]*", words)
    assert [option for option in used if option not in known] == [], words


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with log.csv and its setup, made the working folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log.csv").write_text("time_s,CH1,CH2\n" + "\n".join(pulse_rows()) + "\n")
    (tmp_path / "log.toml").write_text(SETUP)
    return tmp_path


@pytest.fixture
def tirelog(capfdbinary):
    """Run a command line, as it is typed or by its words; status, standard output, and error."""

    def call(*arguments: object) -> Outcome:
        capfdbinary.readouterr()
        words = shlex.split(str(arguments[0])) if len(arguments) == 1 else map(str, arguments)
        status = run(list(words))
        out, err = capfdbinary.readouterr()
        return Outcome(status, out.decode(), err.decode())

    return call


@pytest.fixture
def model(folder, tirelog):
    """The file of a new beam model, in the folder of the log."""
    assert tirelog("model new --carcass beam --setup log.toml -o beam.toml").status == 0
    return folder / "beam.toml"
