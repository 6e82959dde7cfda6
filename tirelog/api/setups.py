"""Setups: what is in a log that nobody has described, a first draft, and what is left to do."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path as File

from tirelog.api.logs import Path, as_setup
from tirelog.data.setup import Setup
from tirelog.drafts.setup import (
    Contents,
    Finding,
    FoundSeries,
    SetupDraft,
    contents,
    draft,
    findings,
)
from tirelog.drafts.setup import rows as contents_rows
from tirelog.runs.ingest import open_recording
from tirelog.storage.whole import whole_file

__all__ = [
    "Contents", "FoundSeries", "SetupCheck", "check_setup", "contents", "contents_rows",
    "draft_setup",
]  # fmt: skip

#: a log is looked into as far as its first blocks; twice as many take twice as long
_BLOCKS = 48


@dataclass(frozen=True)
class SetupCheck:
    """What a setup makes of its log.

    channels   (name, kind, rate [Hz], duration [s]) of each
    findings   what is implausible, missing, unused or still guessed
    lost       is something of the log lost
    """

    channels: tuple[tuple[str, str, float, float], ...]
    findings: tuple[Finding, ...]
    lost: bool

    @property
    def implausible(self) -> bool:
        """True if the setup says of a channel what no tire can read."""
        return any(one.about == "implausible" for one in self.findings)


def draft_setup(log: Path, output: Path | None = None) -> SetupDraft:
    """A first setup of a log, from what it holds; what is guessed is marked.

    Parameters
    ----------
    log : str or os.PathLike
        A log without a setup.
    output : str or os.PathLike, optional
        The setup file to write.

    Returns
    -------
    SetupDraft
        ``text`` (TOML), the numbers of ``channels`` and of ``guesses``.

    Raises
    ------
    ReadError
        Nothing of the log could be read.
    """
    made = draft(os.fspath(log), None if output is None else os.fspath(output))
    if output is not None:
        with whole_file(File(output)) as part:
            part.write_text(made.text, encoding="utf-8")
    return made


def check_setup(log: Path, setup: Path | Setup | None = None) -> SetupCheck:
    """What is implausible, missing, unused or still guessed in the setup of a log.

    Parameters
    ----------
    log : str or os.PathLike
        The log.
    setup : str, os.PathLike or Setup, optional
        Its setup; without it the TOML file beside it.

    Returns
    -------
    SetupCheck
        ``findings``, sentences by what they are about; ``channels``; ``implausible``; ``lost``.

    Raises
    ------
    ReadError, SetupError
        The log cannot be read, or the setup is none.

    Examples
    --------
    >>> import tirelog
    >>> tirelog.check_setup("sample_data/drive.csv.gz").channels[0]
    ('strain_1', 'fbg_strain', 2500.0, 39.9996)
    """
    name = os.fspath(log)
    with open_recording(name, as_setup(setup), blocks=_BLOCKS, check=False) as recording:
        found = findings(recording, name)
        channels = tuple(
            (name, channel.kind, channel.axis.rate_Hz, channel.axis.duration_s)
            for name, channel in recording.channels.items()
        )
        return SetupCheck(channels, tuple(found), bool(recording.losses))
