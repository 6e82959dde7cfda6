"""What the user asked a report for: paths and options, and the commands that repeat its numbers."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path

from tirelog.storage.remote import shown


@dataclass(frozen=True)
class Asked:
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
        words = ["tirelog", name, *(self._logs() or ["LOG"]), *more]
        words += ["--setup", str(self.setup)] if self.setup else []
        if model:
            words += ["--model", str(self.model or "M")]
            words += ["--channel", self.channel] if self.channel else []
            words += ["--effects", str(self.effects)] if self.effects else []
        return shlex.join(words)

    def make_model(self) -> str:
        """The command line that makes a first model of these logs."""
        setup = self.setup or (
            Path(self.logs[0]).name.split(".")[0] + ".toml"
            if self.logs and self.logs[0] != "-"
            else "SETUP.toml"
        )
        words = ["tirelog", "model", "new", "--carcass", "beam", "--setup", str(setup)]
        return shlex.join([*words, "-o", "M.toml"])

    def with_options(self, line: str) -> str:
        """A command line on these logs with the options that were given for them."""
        given = {
            "--setup": self.setup,
            "--channel": self.channel,
            "--effects": self.effects,
        }
        more = [w for option, v in given.items() if v is not None for w in (option, str(v))]
        return f"{line} {shlex.join(more)}" if more else line

    def _logs(self) -> list[str]:
        return [shown(log) for log in self.logs]

    def report_command(self) -> str:
        """The page's own command line."""
        words = ["tirelog", "report", *self._logs()]
        single = {
            "--setup": self.setup,
            "--model": self.model,
            "--ladder": self.ladder,
            "--campaign": self.campaign,
            "--channel": self.channel,
            "--effects": self.effects,
        }
        words += [
            word
            for option, value in single.items()
            if value is not None
            for word in (option, str(value))
        ]
        words += [word for path in self.tables for word in ("--table", str(path))]
        words += ["--propose"] if self.propose else []
        return shlex.join([*words, "-o", "report.html"])
