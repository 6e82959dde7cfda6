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
from importlib import import_module
from typing import TYPE_CHECKING, Any

from tirelog.data.recording import Channel, Recording, Scaled
from tirelog.process_pool import POSSIBLE, in_processes

if TYPE_CHECKING:
    from tirelog.dsp.filters import Cutoff
    from tirelog.strain.footprint.form_choice import FormChoice
    from tirelog.strain.footprint.measure import Measured
    from tirelog.strain.passages.find import Passages
    from tirelog.vocabulary.arrays import IntArray

Options = Mapping[str, Any]

#: what the tables of strain channels are made with, beside what is loaded already
_OF_CHANNELS = (
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
    settled: FormChoice | None = None
    measured: Iterable[tuple[IntArray, Measured]] | None = None


@dataclass(frozen=True)
class ChannelWorker:
    """The `wanted` tables of the channels of a recording, and how they are made.

    `part` gives the rows of one of them, by its name, with its options; None if no channel alone
    has any.
    """

    recording: Recording
    wanted: Mapping[str, Options]
    part: Callable[[str, Work, Options], Part | None]

    def work(self, stored: Channel, passages: Passages | None) -> Work:
        """A channel with its passages, which may be known."""
        from tirelog.runs.in_memory import without_spikes
        from tirelog.strain.passages.find import passages_of

        only_passages = passages is not None and set(self.wanted) == {"speed"}
        channel = stored if only_passages else without_spikes(stored)
        if passages is None:
            passages = passages_of(self.recording, channel)
        return Work(self.recording, channel, passages)

    def with_form(self, work: Work, like: FormChoice | None = None) -> Work:
        """The channel with the form of its passages, if that is needed and can be learnt.

        `like`: that of another channel, to start from.
        """
        from tirelog.strain.footprint.form_choice import choose_form

        if "footprint" not in self.wanted or work.passages.doubt:
            return work
        return replace(work, settled=choose_form(work.channel, work.passages, like=like))

    def parts(self, work: Work, names: Iterable[str]) -> dict[str, Part]:
        """Those of the wanted tables that can be made of a channel, by their names."""
        made = {name: self.part(name, work, self.wanted[name]) for name in names}
        return {name: part for name, part in made.items() if part is not None}


def by_channel(
    making: ChannelWorker,
    channels: Sequence[tuple[Channel, Passages | None]],
    workers: int,
    processes: bool,
) -> Generator[tuple[list[Part], bool]]:
    """(tables, whether it has passages) of each channel, in order; with passages, if known.

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


def _maker(
    making: ChannelWorker, channels: Sequence[tuple[Channel, Passages | None]]
) -> Callable[[int], tuple[list[Part], bool]]:
    """What makes the tables of a channel by its number.

    The first form that can be learnt is learnt here: all later channels start from it, so that
    their rows do not depend on who is quicker.
    """
    first: dict[int, Work] = {}
    like: FormChoice | None = None
    if "footprint" in making.wanted:
        for number, channel in enumerate(channels):
            first[number] = making.with_form(making.work(*channel))
            if like := first[number].settled:
                break

    def make(number: int) -> tuple[list[Part], bool]:
        work = first.pop(number, None)
        if work is None:
            work = making.with_form(making.work(*channels[number]), like and like.light)
        return [*making.parts(work, making.wanted).values()], len(work.passages) > 0

    return make


def _by_threads(
    making: ChannelWorker, channels: Sequence[tuple[Channel, Passages | None]], workers: int
) -> Generator[tuple[list[Part], bool]]:
    """The tables of each channel, in their order, several at a time."""
    make, left = _maker(making, channels), deque(range(len(channels)))
    ahead: deque[Future[tuple[list[Part], bool]]] = deque()
    with ThreadPoolExecutor(workers) as pool:
        while left or ahead:
            # one more than are at work, so that nobody waits while rows are written
            while left and len(ahead) <= workers:
                ahead.append(pool.submit(make, left.popleft()))
            yield ahead.popleft().result()


def _by_processes(
    making: ChannelWorker, channels: Sequence[tuple[Channel, Passages | None]], workers: int
) -> Generator[tuple[list[Part], bool]]:
    """As `_by_threads`, without what the rows were found in, which no pipe carries."""
    make = _maker(making, channels)

    def bare(number: int) -> tuple[list[Part], bool]:
        parts, turns = make(number)
        return [replace(part, found=None) for part in parts], turns

    return in_processes(len(channels), workers, bare)


def _by_stretches(
    making: ChannelWorker, stored: Channel, found: Passages | None, workers: int
) -> Generator[tuple[list[Part], bool]]:
    """The tables of the only channel, without what its rows were found in.

    One process learns the form while another makes the tables that need none; then both measure
    stretches of passages.
    """
    from tirelog.strain.footprint.footprint import Measuring, refuse_cutoff

    work = making.work(stored, found)
    names = [name for name in making.wanted if name != "footprint"]
    if len(names) == len(making.wanted) or work.passages.doubt:
        yield [*making.parts(work, making.wanted).values()], len(work.passages) > 0
        return
    cutoff = cutoff_in(making.wanted["footprint"])
    refuse_cutoff(making.recording, work.channel, cutoff)

    def begun(number: int) -> Any:
        if number:
            parts = making.parts(work, names)
            return {name: replace(part, found=None) for name, part in parts.items()}
        settled = making.with_form(work).settled
        return settled and settled.light

    settled, made = in_processes(2, workers, begun)
    measured = None
    if settled:

        def measure(number: int) -> tuple[IntArray, Measured]:
            measuring = Measuring.of(work.channel, work.passages, settled, cutoff)
            rows = measuring.measure(number, _STRETCHES)
            return rows, measuring.work.take(rows)

        measured = list(in_processes(_STRETCHES, workers, measure))
    parts = making.parts(replace(work, settled=settled, measured=measured), ["footprint"])
    made |= {name: replace(part, found=None) for name, part in parts.items()}
    yield [made[name] for name in making.wanted if name in made], len(work.passages) > 0
