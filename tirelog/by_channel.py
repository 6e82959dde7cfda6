"""Tables of strain channels, several at work at a time.

    channels --threads, or processes of their own--> ChannelProduct (Parts), channel by channel
    one long channel --the form; the other tables; stretches of passages: by processes--> Made

A channel's rows are the same to the bit whoever makes them. How a table is made of a channel is
told by the `ChannelWorker` that they are asked with.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from threading import Condition
from typing import TYPE_CHECKING, Any

from tirelog.data.recording import Channel, Recording, Scaled
from tirelog.process_pool import POSSIBLE, in_processes

if TYPE_CHECKING:
    from tirelog.dsp.filters import Cutoff
    from tirelog.process_pool import LocalLink, PipeLink
    from tirelog.strain.footprint.footprint import FormChoice
    from tirelog.strain.passages.find import Passages
    from tirelog.vocabulary.arrays import IntArray, Records

Options = Mapping[str, Any]

#: what the tables of strain channels are made with, beside what is loaded already
_OF_CHANNELS = (
    "tirelog.runs.in_memory",
    "tirelog.runs.in_memory",
    "tirelog.strain.dissipation_table",
    "tirelog.strain.footprint.footprint",
    "tirelog.strain.passages.find",
    "tirelog.strain.speed",
)
#: a channel of fewer samples is not worth a second process: an hour at 10 kHz takes a fifth less
#: time at the same cost, ten minutes take as long and cost a seventh more (23 November 2026, two
#: cores, Python 3.11); half as many may be no quicker
_LONG = 10_000_000
#: stretches of its passages that are measured at a time, so that no process waits long for the
#: other; with twice as many each is begun anew twice as often
_STRETCHES = 6


@dataclass(frozen=True)
class Part:
    """Rows of one table, as a rule those of one channel.

    columns  by name, arrays of one length (or scalars, repeated)
    remarks  sentences on the channel or the log that were not in a part before
    found    what the rows were made of, for pictures and further tables: Passages of a grating
             (speed), PhaseShiftFound, FootprintOfChannel, DissipationOfChannel,
             InflationOfChannel
    """

    table: str
    columns: Mapping[str, Any]
    remarks: Sequence[str] = ()
    found: Any = None


@dataclass(frozen=True)
class Work:
    """A strain channel with what all its tables are made of.

    `measured`: of stretches of its passages, None if that is to be done.
    """

    recording: Recording
    channel: Channel
    passages: Passages
    settled: FormChoice | None
    measured: Iterable[tuple[IntArray, Records]] | None = None


@dataclass(frozen=True)
class ChannelWorker:
    """The `wanted` tables of the channels of a recording, and how they are made.

    `part` gives the rows of one of them, by its name, with its options; None if no channel alone
    has any.
    """

    recording: Recording
    wanted: Mapping[str, Options]
    part: Callable[[str, Work, Options], Part | None]

    def parts(self, names: Iterable[str], work: Work) -> dict[str, Part]:
        """Those of `names` that can be made of a channel."""
        made = {name: self.part(name, work, self.wanted[name]) for name in names}
        return {name: part for name, part in made.items() if part is not None}

    def bare_parts(self, names: Iterable[str], work: Work) -> dict[str, Part]:
        """As `parts`, without what they were found in, which no pipe carries."""
        return {name: replace(part, found=None) for name, part in self.parts(names, work).items()}

    @property
    def others(self) -> list[str]:
        """The wanted tables that need no form."""
        return [name for name in self.wanted if name != "footprint"]

    def made(self, parts: Mapping[str, Part], passages: Passages) -> ChannelProduct:
        """The parts in the order in which they are wanted."""
        return ChannelProduct(
            [parts[name] for name in self.wanted if name in parts], len(passages) > 0
        )


@dataclass(frozen=True)
class ChannelProduct:
    """One channel's tables."""

    parts: list[Part]
    turns: bool


def by_channel(
    making: ChannelWorker,
    channels: Sequence[tuple[Channel, Passages | None]],
    workers: int,
    processes: bool,
) -> Generator[ChannelProduct]:
    """The tables of each channel, in their order; `channels` with their passages, if known.

    With `processes` the workers are processes where they can be, and parts come without what they
    were `found` in.
    """
    stored = [channel for channel, _ in channels]
    enough = len(stored) > 1 or any(channel.size >= _LONG for channel in stored)
    if not (processes and enough and workers > 1 and POSSIBLE and _at_hand(stored)):
        return _by_threads(making, channels, workers)
    for module in _OF_CHANNELS:  # loaded once, before the processes part
        import_module(module)
    if len(channels) == 1:
        return _by_stretches(making, *channels[0], workers)
    return _by_processes(making, channels, workers)


def cutoff_in(options: Options) -> Cutoff:
    """The low-pass of the footprint's plain lengths.  UsageError: none is called that."""
    from tirelog.dsp.filters import Cutoff

    return Cutoff.parse(str(options.get("cutoff", "auto")))


def _at_hand(channels: Iterable[Channel]) -> bool:
    """True if processes can read the channels side by side: no library holds their file's place."""
    return all(isinstance(one.samples, Scaled) and one.samples.at_hand for one in channels)


def _by_threads(
    making: ChannelWorker, channels: Sequence[tuple[Channel, Passages | None]], workers: int
) -> Generator[ChannelProduct]:
    """The tables of each channel, in their order, several at a time."""
    forms, left = _Forms(), deque(enumerate(channels))

    def made(number: int, channel: Channel, passages: Passages | None) -> ChannelProduct:
        try:
            return _make(making, number, channel, passages, forms)
        finally:  # nobody waits for a form that does not come
            forms.tell(number, None)

    with ThreadPoolExecutor(workers) as pool:
        ahead: deque[Future[ChannelProduct]] = deque()

        def fill() -> None:
            while left and len(ahead) < workers:
                number, (channel, passages) = left.popleft()
                ahead.append(pool.submit(made, number, channel, passages))

        fill()
        while ahead:
            made_of = ahead.popleft().result()
            fill()  # the next one is at work while this one's rows are written
            yield made_of


def _by_processes(
    making: ChannelWorker, channels: Sequence[tuple[Channel, Passages | None]], workers: int
) -> Generator[ChannelProduct]:
    """As `_by_threads`, without what the rows were found in."""

    def make(number: int, wire: PipeLink | LocalLink) -> ChannelProduct:
        made = _make(making, number, *channels[number], _FormsApart(wire))
        return replace(made, parts=[replace(part, found=None) for part in made.parts])

    return in_processes(len(channels), workers, make)


def _by_stretches(
    making: ChannelWorker, stored: Channel, found: Passages | None, workers: int
) -> Generator[ChannelProduct]:
    """The tables of the only channel, without what its rows were found in.

    One process learns the form while another makes the tables that need none; then both measure
    stretches of passages.
    """
    from tirelog.runs.in_memory import without_spikes
    from tirelog.strain.footprint.footprint import Measuring, choose_form, refuse_cutoff
    from tirelog.strain.passages.find import passages_of

    channel = without_spikes(stored)
    passages = passages_of(making.recording, channel) if found is None else found
    if "footprint" not in making.wanted or passages.doubt:
        yield _make(making, 0, channel, passages, _Forms())
        return
    work = Work(making.recording, channel, passages, None)
    cutoff = cutoff_in(making.wanted["footprint"])
    refuse_cutoff(making.recording, channel, cutoff)
    at_work: list[Measuring] = []  # of each process its own

    def make(number: int, wire: PipeLink | LocalLink) -> tuple[Any]:
        if number == 0:
            settled = choose_form(channel, passages)
            wire.tell(settled and settled.light)
            return (settled and settled.light,)
        if number == 1:
            return (making.bare_parts(making.others, work),)
        if not at_work:
            if (settled := wire.ask()) is None:
                return (None,)
            at_work.append(Measuring.of(channel, passages, settled, cutoff))
        rows = at_work[0].measure(number - 2, _STRETCHES)
        return ((rows, at_work[0].work[rows]),)

    (settled,), (parts,), *stretches = in_processes(2 + _STRETCHES, workers, make)
    measured = [stretch for (stretch,) in stretches] if settled else None
    work = replace(work, settled=settled, measured=measured)
    yield making.made(parts | making.bare_parts(["footprint"], work), passages)


class _Forms:
    """The forms of the channels' passages, by the channels' ordinals.

    The first that could be learnt is where all later ones start from.

    A channel that asks waits for those before it, which are at work or done already, so that its
    rows do not depend on who is quicker.
    """

    def __init__(self) -> None:
        self._settled: dict[int, FormChoice | None] = {}
        self._news = Condition()

    def settle(self, number: int, channel: Channel, passages: Passages) -> FormChoice | None:
        """The form of the passages of `channel`, the `number`-th."""
        from tirelog.strain.footprint.footprint import choose_form

        settled = choose_form(channel, passages, like=self._first_before(number))
        self.tell(number, settled and settled.light)
        return settled

    def tell(self, number: int, settled: FormChoice | None) -> None:
        """What was learnt from a channel, or that nothing more will be."""
        with self._news:
            self._settled.setdefault(number, settled)
            self._news.notify_all()

    def _first_before(self, number: int) -> FormChoice | None:
        for before in range(number):
            with self._news:
                self._news.wait_for(partial(self._settled.__contains__, before))
                settled = self._settled[before]
            if settled is not None:
                return settled
        return None


class _FormsApart:
    """The forms of the channels' passages, as `_Forms`, by way of the other process."""

    def __init__(self, wire: PipeLink | LocalLink) -> None:
        self._wire = wire

    def settle(self, number: int, channel: Channel, passages: Passages) -> FormChoice | None:
        """The form of the passages of `channel`, the `number`-th."""
        from tirelog.strain.footprint.footprint import choose_form

        settled = choose_form(channel, passages, like=self._wire.ask())
        self.tell(number, settled and settled.light)
        return settled

    def tell(self, number: int, settled: FormChoice | None) -> None:
        """What was learnt from a channel, or that nothing more will be."""
        self._wire.tell(settled)


def _make(
    making: ChannelWorker,
    number: int,
    stored: Channel,
    found: Passages | None,
    forms: _Forms | _FormsApart,
) -> ChannelProduct:
    """The tables of one channel, the `number`-th, whose passages are `found` already or not."""
    from tirelog.runs.in_memory import without_spikes
    from tirelog.strain.passages.find import passages_of

    footprint = [name for name in making.wanted if name == "footprint"]
    only_passages = found is not None and set(making.wanted) == {"speed"}
    channel = stored if only_passages else without_spikes(stored)
    passages = passages_of(making.recording, channel) if found is None else found
    work = Work(making.recording, channel, passages, None)
    # before a form is asked for, which may take others' time
    parts = making.parts(making.others, work)
    if footprint and not passages.doubt:
        work = replace(work, settled=forms.settle(number, channel, passages))
    return making.made(parts | making.parts(footprint, work), passages)
