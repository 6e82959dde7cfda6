"""The tables by name, from one open recording.

For whoever makes several of them: `tables`, campaigns and the report.

    recording, {name: options} --tables_of--> (name, columns, remarks), channel by channel

The functions are the commands' own, with the commands' options under the same names. Tables of
strain channels share what they are made of: a channel is read once and its passages are found once,
whatever the number of tables, and several channels are worked on at a time.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from threading import Condition
from typing import TYPE_CHECKING, Any

from tirelog.data.recording import Channel, Recording
from tirelog.vocabulary.kinds import STRAIN_KINDS

if TYPE_CHECKING:
    from tirelog.strain.footprint.learn import Learnt
    from tirelog.strain.passages.find import Passages

Rows = Iterator[tuple[Mapping[str, Any], Sequence[str]]]
Options = Mapping[str, Any]
Part = tuple[str, Mapping[str, Any], Sequence[str]]


@dataclass(frozen=True)
class Maker:
    """The kinds of channel that a table needs, its options, and how it is made from a whole
    recording; None: channel by channel.
    """

    kinds: tuple[str, ...]
    options: tuple[str, ...] = ()
    whole: Callable[[Recording, Options], Rows] | None = None

    def suits(self, recording: Recording) -> bool:
        """True where the recording has the channels that the table is made of."""
        return bool(recording.of_kind(*self.kinds))


def _speed(recording: Recording, options: Options) -> Rows:
    from tirelog.strain.speed import speed_tables

    tables, remarks = speed_tables(recording, bool(options.get("calibrate_radius", False)))
    said = 0
    for columns in tables:  # a channel's remarks come with its columns
        yield columns, remarks[said:]
        said = len(remarks)


def _phase_shift(recording: Recording, options: Options) -> Rows:
    from tirelog.wheel.calibration_file import read_calibration
    from tirelog.wheel.table import measure_with, table

    calibration = (
        read_calibration(Path(options["calibration"])) if "calibration" in options else None
    )
    for passages in measure_with(calibration, recording, str(options.get("zero", "auto"))):
        yield table(passages, calibration), passages.said


MAKERS: dict[str, Maker] = {
    "speed": Maker(
        (*STRAIN_KINDS, "wheel_encoder", "radial_acceleration"), ("calibrate_radius",), _speed
    ),
    "footprint": Maker(STRAIN_KINDS, ("cutoff",)),
    "dissipation": Maker(STRAIN_KINDS, ("steady_step", "average")),
    "phase-shift": Maker(("wheel_encoder",), ("calibration", "zero"), _phase_shift),
}


def tables_of(
    recording: Recording, wanted: Mapping[str, Options], workers: int = 1
) -> Iterator[Part]:
    """(name, columns, remarks) of the `wanted` tables (keys of MAKERS, with their options), part by
    part; a table's parts are in the order of the channels, whatever the number of `workers`
    (threads), and the same to the bit.

    UsageError: the recording lacks what a table is made of, or an option is none.
    """
    strain = {
        name: options for name, options in wanted.items() if _is_of_strain(recording, name, options)
    }
    if strain:
        yield from _strain_tables(recording, strain, workers)
    for name, options in wanted.items():
        whole = MAKERS[name].whole
        if name not in strain and whole is not None:
            for columns, remarks in whole(recording, options):
                yield name, columns, remarks


def _is_of_strain(recording: Recording, name: str, options: Options) -> bool:
    """True for a table that is made channel by channel from passages of strain; a calibrated radius
    needs all channels at once.
    """
    if name == "speed":
        return bool(recording.of_kind(*STRAIN_KINDS)) and not options.get("calibrate_radius", False)
    return MAKERS[name].whole is None


def _strain_tables(
    recording: Recording, wanted: Mapping[str, Options], workers: int
) -> Iterator[Part]:
    """The tables of the strain channels, each channel's passages found once."""
    from tirelog.strain.channels import not_turning, strain_channels
    from tirelog.strain.speed import radius_remarks

    turned = False
    told: set[tuple[str, str]] = set()
    forms = _Forms()
    channels = deque(enumerate(strain_channels(recording)))
    with ThreadPoolExecutor(workers) as pool:
        ahead: deque[Future[_Made]] = deque()

        def fill() -> None:
            while channels and len(ahead) < workers:
                ahead.append(pool.submit(_make, recording, *channels.popleft(), wanted, forms))

        fill()
        while ahead:
            made = ahead.popleft().result()
            fill()  # the next one is at work while this one's rows are written
            turned |= made.turns
            for name, columns, remarks in made.parts:
                fresh = [
                    remark
                    for remark in [*radius_remarks(recording), *remarks]
                    if (name, remark) not in told
                ]
                told |= {(name, remark) for remark in fresh}
                yield name, columns, fresh
    if not turned and set(wanted) != {"speed"}:
        raise not_turning(recording)


class _Forms:
    """The forms of the channels' passages, by the channels' ordinals: the first that could be
    learnt is where all later ones start from.

    A channel that asks waits for those before it, which are at work or done already, so that its
    rows do not depend on who is quicker.
    """

    def __init__(self) -> None:
        self._learnt: dict[int, Learnt | None] = {}
        self._news = Condition()

    def learn(self, number: int, channel: Channel, passages: Passages) -> Learnt | None:
        """The form of the passages of `channel`, the `number`-th."""
        from tirelog.strain.footprint.learn import learn_reference

        learnt = learn_reference(channel, passages, like=self._first_before(number))
        self.tell(number, learnt)
        return learnt

    def tell(self, number: int, learnt: Learnt | None) -> None:
        """What was learnt from a channel, or that nothing more will be."""
        with self._news:
            self._learnt.setdefault(number, learnt)
            self._news.notify_all()

    def _first_before(self, number: int) -> Learnt | None:
        for before in range(number):
            with self._news:
                while before not in self._learnt:
                    self._news.wait()
                learnt = self._learnt[before]
            if learnt is not None:
                return learnt
        return None


@dataclass(frozen=True)
class _Made:
    """One channel's tables."""

    parts: list[Part]
    turns: bool


def _make(
    recording: Recording, number: int, stored: Channel, wanted: Mapping[str, Options], forms: _Forms
) -> _Made:
    """The tables of one channel, the `number`-th."""
    from tirelog.runs.in_memory import held
    from tirelog.strain.passages.surface import passages_of

    try:
        channel = held(stored)
        passages = passages_of(recording, channel)
        learnt = (
            forms.learn(number, channel, passages)
            if "footprint" in wanted and not passages.doubt
            else None
        )
    finally:
        forms.tell(number, None)
    parts = [
        (name, *_OF_CHANNEL[name](recording, channel, passages, options, learnt))
        for name, options in wanted.items()
    ]
    return _Made(parts, len(passages) > 0)


_Table = tuple[Mapping[str, Any], Sequence[str]]


def _speed_of(
    recording: Recording,
    channel: Channel,
    passages: Passages,
    options: Options,
    learnt: Learnt | None,
) -> _Table:
    from tirelog.strain.speed import speed_columns, speed_doubts

    return speed_columns(recording.log, passages), speed_doubts(passages)


def _footprint_of(
    recording: Recording,
    channel: Channel,
    passages: Passages,
    options: Options,
    learnt: Learnt | None,
) -> _Table:
    from tirelog.dsp.lowpass import Cutoff
    from tirelog.strain.footprint.table import footprint_of_channel

    found = footprint_of_channel(
        recording, channel, passages, Cutoff.parse(str(options.get("cutoff", "auto"))), learnt
    )
    return found.columns, found.remarks


def _dissipation_of(
    recording: Recording,
    channel: Channel,
    passages: Passages,
    options: Options,
    learnt: Learnt | None,
) -> _Table:
    from tirelog.strain.dissipation import AVERAGED, STEADY_STEP_M_S
    from tirelog.strain.dissipation_table import dissipation_of_channel

    step, average = (
        float(options.get("steady_step", STEADY_STEP_M_S)),
        int(options.get("average", AVERAGED)),
    )
    found = dissipation_of_channel(recording, channel, passages, step, average)
    return found.columns, found.remarks


_OF_CHANNEL: Mapping[
    str, Callable[[Recording, Channel, Passages, Options, Learnt | None], _Table]
] = {
    "speed": _speed_of,
    "footprint": _footprint_of,
    "dissipation": _dissipation_of,
}
