"""The tables by name, for whoever makes several of them from one open recording: `tables`, campaigns and the report.

    recording, {name: options} --tables_of--> (name, columns, remarks), channel by channel

The functions are the commands' own, with the commands' options under the same names.  Tables of strain channels share what they are made
of: a channel is read once and its passages are found once, whatever the number of tables, and several channels are worked on at a time.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tirelog.recording import Channel, Recording

if TYPE_CHECKING:
    from tirelog.estimators.footprint_learn import Learnt
    from tirelog.estimators.passages import Passages

Rows = Iterator[tuple[Mapping[str, Any], Sequence[str]]]
Options = Mapping[str, Any]
Part = tuple[str, Mapping[str, Any], Sequence[str]]


@dataclass(frozen=True)
class Maker:
    """The kinds of channel that a table needs, its options, and how it is made from a whole recording; None: channel by channel."""

    kinds: tuple[str, ...]
    options: tuple[str, ...] = ()
    whole: Callable[[Recording, Options], Rows] | None = None

    def suits(self, recording: Recording) -> bool:
        """True where the recording has the channels that the table is made of."""
        return bool(recording.of_kind(*self.kinds))


def _speed(recording: Recording, options: Options) -> Rows:
    from tirelog.estimators.speed import speed_tables

    tables, remarks = speed_tables(recording, bool(options.get("calibrate_radius", False)))
    for columns in tables:
        yield columns, remarks
        remarks = []


def _phase_shift(recording: Recording, options: Options) -> Rows:
    from tirelog.estimators.calibration_file import read_calibration
    from tirelog.estimators.calibration_table import measure_with, table

    calibration = read_calibration(Path(options["calibration"])) if "calibration" in options else None
    for passages in measure_with(calibration, recording, str(options.get("zero", "auto"))):
        yield table(passages, calibration), passages.said


_STRAIN = ("fbg_strain", "strain")
MAKERS: dict[str, Maker] = {
    "speed": Maker((*_STRAIN, "wheel_encoder", "radial_acceleration"), ("calibrate_radius",), _speed),
    "footprint": Maker(_STRAIN, ("cutoff",)),
    "dissipation": Maker(_STRAIN, ("steady_step", "average")),
    "phase-shift": Maker(("wheel_encoder",), ("calibration", "zero"), _phase_shift),
}


def tables_of(recording: Recording, wanted: Mapping[str, Options], workers: int = 1) -> Iterator[Part]:
    """(name, columns, remarks) of the `wanted` tables (keys of MAKERS, with their options), part by part; a table's parts are in the order
    of the channels, whatever the number of `workers` (threads), and the same to the bit.

    UsageError: the recording lacks what a table is made of, or an option is none.
    """
    strain = {name: options for name, options in wanted.items() if _is_of_strain(recording, name, options)}
    if strain:
        yield from _strain_tables(recording, strain, workers)
    for name, options in wanted.items():
        whole = MAKERS[name].whole
        if name not in strain and whole is not None:
            for columns, remarks in whole(recording, options):
                yield name, columns, remarks


def _is_of_strain(recording: Recording, name: str, options: Options) -> bool:
    """True for a table that is made channel by channel from passages of strain; a calibrated radius needs all channels at once."""
    if name == "speed":
        return bool(recording.of_kind(*_STRAIN)) and not options.get("calibrate_radius", False)
    return MAKERS[name].whole is None


def _strain_tables(recording: Recording, wanted: Mapping[str, Options], workers: int) -> Iterator[Part]:
    """The tables of the strain channels, each channel's passages found once."""
    from tirelog.estimators.speed import radius_remarks
    from tirelog.estimators.strain_channels import not_turning, strain_channels

    turned, like = False, None
    told: set[tuple[str, str]] = set()
    channels = deque(strain_channels(recording))
    with ThreadPoolExecutor(workers) as pool:
        ahead: deque[Future[_Made]] = deque()
        while channels or ahead:
            # the first form that is learnt is where all others start from, so nothing runs ahead of it
            while channels and len(ahead) < (workers if like is not None or "footprint" not in wanted else 1):
                ahead.append(pool.submit(_make, recording, channels.popleft(), wanted, like))
            made = ahead.popleft().result()
            turned |= made.turns
            like = like or made.learnt
            for name, columns, remarks in made.parts:
                fresh = [remark for remark in [*radius_remarks(recording), *remarks] if (name, remark) not in told]
                told |= {(name, remark) for remark in fresh}
                yield name, columns, fresh
    if not turned and set(wanted) != {"speed"}:
        raise not_turning(recording)


@dataclass(frozen=True)
class _Made:
    """One channel's tables."""

    parts: list[Part]
    turns: bool
    learnt: Learnt | None


def _make(recording: Recording, stored: Channel, wanted: Mapping[str, Options], like: Learnt | None) -> _Made:
    """The tables of one channel."""
    from tirelog.estimators.held import held
    from tirelog.estimators.passages import find_passages

    channel = held(stored)
    passages = find_passages(channel, recording.setup.tire.radius_m)
    parts: list[Part] = []
    learnt = None
    for name, options in wanted.items():
        columns, remarks, form = _OF_CHANNEL[name](recording, channel, passages, options, like)
        parts.append((name, columns, remarks))
        learnt = form or learnt
    return _Made(parts, len(passages) > 0, learnt)


_Table = tuple[Mapping[str, Any], Sequence[str], "Learnt | None"]


def _speed_of(recording: Recording, channel: Channel, passages: Passages, options: Options, like: Learnt | None) -> _Table:
    from tirelog.estimators.speed import speed_columns

    return speed_columns(recording.log, passages), (), None


def _footprint_of(recording: Recording, channel: Channel, passages: Passages, options: Options, like: Learnt | None) -> _Table:
    from tirelog.dsp.lowpass import Cutoff
    from tirelog.estimators.footprint_table import footprint_of_channel

    found = footprint_of_channel(recording, channel, passages, Cutoff.parse(str(options.get("cutoff", "auto"))), like)
    return found.columns, found.remarks, found.footprint.learnt


def _dissipation_of(recording: Recording, channel: Channel, passages: Passages, options: Options, like: Learnt | None) -> _Table:
    from tirelog.estimators.dissipation import AVERAGED, STEADY_STEP_M_S
    from tirelog.estimators.dissipation_table import dissipation_of_channel

    step, average = float(options.get("steady_step", STEADY_STEP_M_S)), int(options.get("average", AVERAGED))
    found = dissipation_of_channel(recording, channel, passages, step, average)
    return found.columns, found.remarks, None


_OF_CHANNEL: Mapping[str, Callable[[Recording, Channel, Passages, Options, Learnt | None], _Table]] = {
    "speed": _speed_of,
    "footprint": _footprint_of,
    "dissipation": _dissipation_of,
}
