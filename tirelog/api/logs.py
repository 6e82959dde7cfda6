"""Logs: opened by path, or given open; their setups: drafted and checked; logs of known truth."""

from __future__ import annotations

import os
import warnings
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path as File
from typing import TYPE_CHECKING, Any, TypeVar

from tirelog.data import setup as setups
from tirelog.data.recording import Recording
from tirelog.data.setup import Setup, setup_beside
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
from tirelog.errors import UsageError
from tirelog.inference.shared_samples import fingerprint
from tirelog.runs.ingest import IngestSummary, is_file, open_recording, write_run
from tirelog.runs.ingest import channel_rows as channels
from tirelog.runs.store import is_run, open_run
from tirelog.storage.whole import refuse_inputs, whole_file

if TYPE_CHECKING:
    from tirelog.simulation import Scenario

__all__ = [
    "Contents", "FoundSeries", "Logs", "OpenLog", "Path", "SetupCheck", "SetupLike", "as_logs",
    "as_read", "as_setup", "channels", "check_setup", "contents", "contents_rows",
    "described", "draft_setup", "drafted", "each_log", "ingest", "load_setup", "open_log",
    "open_recording", "opened_run", "samples_hash", "simulate", "simulated_log",
]  # fmt: skip

Path = str | os.PathLike[str]
#: a setup by path, read, or as a dict of the file's tables
SetupLike = Path | Setup | Mapping[str, Any]
#: a Setup or a Model
Read = TypeVar("Read")
#: a log by path or open, or several of them
Logs = Path | Recording | Iterable[Path | Recording]


class OpenLog(Recording, AbstractContextManager["OpenLog"]):
    """A Recording that closes what it reads from when it is left, closed or forgotten."""

    _closing: weakref.finalize[..., OpenLog] | None = None

    def close(self) -> None:
        """Let go of the log and of the temporary file that its samples are in."""
        if self._closing is not None:
            self._closing()

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"{self.log}: {', '.join(self.channels)}"

    def _repr_html_(self) -> str:
        """The channels, for a notebook."""
        from tirelog.tables.writer import document, table

        rows = {name: column for name, column in channels(self).items() if name != "log"}
        return document(self.log, [table(list(rows), zip(*rows.values()))], self.remarks)


def open_log(path: Path, setup: SetupLike | None = None) -> OpenLog:
    """A log, opened: its channels in SI on exact time axes.

    Parameters
    ----------
    path : str or os.PathLike
        A log (text, MCAP, HDF5) or a run; ``"-"`` is standard input.
    setup : str, os.PathLike, Setup or dict, optional
        The setup, which describes the channels: its file, itself, or the file's tables. Without it
        the file of the log's name with the suffix ``.toml`` beside it.

    Returns
    -------
    Recording
        ``channels`` by name, ``channels[name].read()`` their samples [SI], shape (n,), NaN if
        lost, ``channels[name].axis.time()`` their times [s], shape (n,). To be used in a ``with``
        statement, or closed by ``close()``: a log other than a run is kept in a temporary file
        meanwhile.

    Raises
    ------
    ReadError
        Nothing of the log could be read.
    SetupError
        There is no setup, or it does not fit the log.

    Examples
    --------
    >>> import tirelog
    >>> with tirelog.open_log("sample_data/drive.csv.gz") as log:
    ...     print(log.channels["strain_1"].axis.rate_Hz)
    2500.0
    """
    with ExitStack() as resources:
        opened = resources.enter_context(open_recording(os.fspath(path), as_setup(setup)))
        log = OpenLog(**vars(opened))
        closing = weakref.finalize(log, resources.pop_all().close)
        object.__setattr__(log, "_closing", closing)  # a Recording's own fields are frozen
    return log


def samples_hash(recording: Recording) -> str:
    """The hash of the samples of a recording's first channel: equal for copies in any packing."""
    first = next(iter(recording.channels.values()), None)
    return "" if first is None else fingerprint(first)[0]


def opened_run(run: Path, log: Path) -> AbstractContextManager[Recording]:
    """The run that was just made of a log, while it is open; it is named as the log was."""
    return open_run(File(run), os.fspath(log))


def described(log: str) -> bool:
    """True for a log with a setup beside it, and for a run, which has its own."""
    if log == "-":
        return False
    return setup_beside(log) is not None or (is_file(log) and is_run(log))


def drafted(log: str) -> Setup | None:
    """The draft of a log's setup, to look at its signals; None of standard input, read once."""
    return None if log == "-" else setups.parse_setup(draft(log).text)


def ingest(log: Path, output: Path, setup: SetupLike | None = None) -> IngestSummary:
    """A log written as a run: channels on exact time axes, with setup and provenance.

    Parameters
    ----------
    log : str or os.PathLike
        A log; ``"-"`` is standard input.
    output : str or os.PathLike
        The run to write (HDF5), which every function takes for the log.
    setup : str, os.PathLike, Setup or dict, optional
        As for `open_log`.

    Returns
    -------
    IngestSummary
        ``remarks``, ``losses``, ``repairs``, ``counts``, ``sha256`` of the log.

    Raises
    ------
    ReadError, SetupError
        As `open_log`.
    """
    return write_run(os.fspath(log), as_setup(setup), File(output))


def load_setup(path: Path) -> Setup:
    """The setup in a file.

    Parameters
    ----------
    path : str or os.PathLike
        A setup file (``tirelog setup new`` drafts one).

    Returns
    -------
    Setup
        ``tire``, ``conditions``, ``channels`` by name, ``log``; immutable.

    Raises
    ------
    SetupError
        The file is no setup; file and line are named.
    """
    return setups.load_setup(os.fspath(path))


def as_setup(setup: SetupLike | None) -> Setup | None:
    """The setup, read from its file or made of a dict if needed.  UsageError: it is none."""
    return None if setup is None else as_read(setup, Setup, setups.load_setup, setups.parse_setup)


def as_read(
    given: Any, kind: type[Read], load: Callable[[Any], Read], parse: Callable[[str], Read]
) -> Read:
    """A value of a `kind`, loaded from its file or parsed from a dict of the tables if needed.

    UsageError: it is none of these, or a dict that no TOML file holds.
    """
    if isinstance(given, kind):
        return given
    if isinstance(given, str | os.PathLike):
        return load(os.fspath(given))
    with suppress(ValueError, TypeError):  # what tomlkit says of a value that it does not know
        import tomlkit  # 40 ms, for a dict alone

        return parse(tomlkit.dumps(given))
    name = kind.__name__
    raise UsageError(
        f"this {type(given).__name__} is no {name.lower()}",
        allowed=f"allowed are a path, a {name} and a dict of the file's tables in plain values",
        do=f"give one, such as tirelog.load_{name.lower()}(path)",
    )


def each_log(logs: Logs, setup: SetupLike | None = None) -> Iterator[Recording]:
    """The logs as open recordings, one after the other; what is given by path is closed again.

    A warning names what was lost of a log, once it has been read. UsageError: something among them
    is no log.
    """
    for log in as_logs(logs):
        if isinstance(log, Recording):
            yield log
            if isinstance(log, OpenLog):  # else whoever opened it tells
                _warn_of_losses(log)
        else:
            with open_log(log, setup) as opened:
                yield opened
                _warn_of_losses(opened)


def as_logs(logs: Logs) -> Iterator[Path | Recording]:
    """The logs one after the other.  UsageError: something among them is no log."""
    several: Iterable[Any] = (
        [logs]
        if isinstance(logs, str | os.PathLike | Recording) or not isinstance(logs, Iterable)
        else logs
    )
    for log in several:
        if not isinstance(log, str | os.PathLike | Recording):
            raise UsageError(
                f"{type(log).__name__} is no log",
                allowed="allowed are paths, open logs and lists of them",
                do="give one, such as tirelog.open_log(path)",
            )
        yield log


def _warn_of_losses(log: Recording) -> None:
    for loss in log.losses:
        warnings.warn(f"{log.log}: {loss}", UserWarning, stacklevel=4)


# ---- Setups: the content of a log without one, a first draft, and a check of it.


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
    """A first setup of a log, from its content; guesses are marked.

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


def check_setup(log: Path, setup: SetupLike | None = None) -> SetupCheck:
    """What is implausible, missing, unused or still guessed in the setup of a log.

    Parameters
    ----------
    log : str or os.PathLike
        The log.
    setup : str, os.PathLike, Setup or dict, optional
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


# ---- Logs with known truth.


def simulate(scenario: Path, output: Path, *, seed: int | None = None) -> tuple[File, ...]:
    """A log with known truth, by physics solved apart from the models.

    Parameters
    ----------
    scenario : str or os.PathLike
        TOML file: manoeuvres, tire, road, sensors, effects, seed (see sample_data/README.md).
    output : str or os.PathLike
        The log to write; its suffix decides: .csv, .txt, .mcap or .h5.
    seed : int, optional
        Another seed than the scenario's.

    Returns
    -------
    tuple of pathlib.Path
        The files written: the log, LOG.truth.json and its setup.

    Raises
    ------
    UsageError
        No such format, or the log's setup would take the scenario's place.
    """
    return simulated_log(scenario, output, seed=seed)[1]


def simulated_log(
    scenario: Path, output: Path, *, seed: int | None = None
) -> tuple[Scenario, tuple[File, ...]]:
    """(what was driven, the files written) of `simulate`."""
    from tirelog.simulation import load_scenario, write_log
    from tirelog.simulation import simulate as drive
    from tirelog.simulation.simulate import setup_of, suffix_of, truth_of

    source, log = File(scenario), File(output)
    suffix_of(log)
    for path, what in (
        (log, "is the scenario itself"),
        (setup_of(log), "its setup would take the scenario's place"),
    ):
        if path.resolve() == source.resolve():
            named = "allowed is a log of another name"
            raise UsageError(what, allowed=named, do="change -o", file=log)
    refuse_inputs(truth_of(log), setup_of(log))
    described = load_scenario(source)
    files = write_log(drive(described if seed is None else replace(described, seed=seed)), log)
    return described, tuple(files)
