"""What the user asked a report for: paths and options, and the commands that repeat its numbers."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path

from tirelog.data.setup import setup_beside
from tirelog.storage.remote import shown


@dataclass(frozen=True)
class ReportRequest:
    """What the user gave, with paths as typed.

    So the commands on the page can be typed again, but for what an address keeps secret.
    """

    logs: tuple[str, ...] = ()
    setup: Path | None = None
    model: Path | None = None
    ladder: Path | None = None
    campaign: Path | None = None
    tables: tuple[Path, ...] = ()
    channel: str | None = None
    effects: Path | None = None
    propose: bool = False

    def command(self, name: str, *more: str, model: bool = False) -> str:
        """A command line on the same logs."""
        words = ["tirelog", name, *(self._logs() or ["LOG"]), *more, *self._given("setup")]
        if model:
            words += ["--model", str(self.model or "M"), *self._given("channel", "effects")]
        return shlex.join(words)

    def make_model(self) -> str:
        """The command line that makes a first model of these logs."""
        beside = setup_beside(self.logs[0]) if self.logs else None
        setup = str(self.setup or beside or "SETUP.toml")
        words = ["tirelog", "model", "new", "--carcass", "beam", "--setup", setup]
        return shlex.join([*words, "-o", "M.toml"])

    def with_options(self, line: str) -> str:
        """A command line on these logs with the options that were given for them and it lacks."""
        names = (n for n in ("setup", "channel", "effects") if f" --{n} " not in line)
        return f"{line} {shlex.join(self._given(*names))}".rstrip()

    def report_command(self) -> str:
        """The page's own command line."""
        words = ["tirelog", "report", *self._logs()]
        words += self._given("setup", "model", "ladder", "campaign", "channel", "effects")
        words += [word for path in self.tables for word in ("--table", str(path))]
        words += ["--propose"] if self.propose else []
        return shlex.join([*words, "-o", "report.html"])

    def _logs(self) -> list[str]:
        return [shown(log) for log in self.logs]

    def _given(self, *names: str) -> list[str]:
        """These options with their values, those that were given."""
        values = {name: getattr(self, name) for name in names}
        return [w for name, v in values.items() if v is not None for w in (f"--{name}", str(v))]
