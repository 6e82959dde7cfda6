"""The tables of a recording by name: the only way from channels to rows, for whoever wants them.

    recording, {name: options} --tables_of--> Part (rows of one channel, remarks, what they are
                                              made of), channel by channel
    channels --one after the other, or processes--> Parts of each channel, in their order

Each table's command, `tables`, campaigns, the report and the Python functions all go through
`tables_of`. Tables of strain channels share what they are made of: a channel is read once and its
passages are found once, whatever the number of tables; a channel's rows are the same to the bit
whoever makes them. A table that a function of its
own makes needs nothing here: `vocabulary.tables` names the function.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from tirelog.data.recording import Channel, Recording
from tirelog.errors import UsageError, refuse_unknown
from tirelog.process_pool import POSSIBLE, in_processes
from tirelog.vocabulary.kinds import ACCELERATION_KINDS, STRAIN_KINDS
from tirelog.vocabulary.tables import LOG_TABLES, STRETCH, LogTable

if TYPE_CHECKING:
    from tirelog.dsp.filters import Cutoff
    from tirelog.strain.footprint.learn import EdgeForm
    from tirelog.strain.passages.find import Passages
    from tirelog.wheel.calibration import Calibration
    from tirelog.wheel.phase_shift import EdgeTimes

Options = Mapping[str, Any]

#: what the tables of strain channels are made with, beside what is loaded already
_OF_CHANNELS = (
    "tirelog.runs.in_memory",
    "tirelog.strain.dissipation",
    "tirelog.strain.footprint.footprint",
    "tirelog.strain.passages.find",
    "tirelog.strain.speed",
)


@dataclass(frozen=True)
class Part:
    """Rows of one table, as a rule those of one channel.

    columns  by name, arrays of one length (or scalars, repeated)
    remarks  sentences on the channel or the log that were not in a part before
    found    what the rows were made of, for pictures and further tables: Passages of a grating
             (speed), PassageRows (footprint, dissipation), InflationOfChannel; of phase shifts
             EdgeTimes and the calibration that was applied to them, or None
    """

    table: str
    columns: Mapping[str, Any]
    remarks: Sequence[str] = ()
    found: Any = None


@dataclass(frozen=True)
class Work:
    """A strain channel with the measurements that all its tables use."""

    recording: Recording
    channel: Channel
    passages: Passages
    settled: EdgeForm | None = None


@dataclass(frozen=True)
class Maker:
    """How a table of the register is made.

    inner       options that are for programs, no setting of a table
    of_channel  the rows of one channel whose passages are known; None: the log as a whole is needed
    whole       the rows of a whole log; with both, `of_channel` is taken if `by_channel` says so
    check       UsageError for options that no log can be made a table with
    """

    table: LogTable
    inner: tuple[str, ...] = ()
    of_channel: Callable[[Work, Options], Part] | None = None
    whole: Callable[[Recording, Options], Iterator[Part]] | None = None
    by_channel: Callable[[Recording, Options], bool] = lambda recording, options: True
    check: Callable[[Options], object] = lambda options: None

    def suits(self, recording: Recording) -> bool:
        """True if the recording has the channels that the table is made of."""
        return bool(recording.of_kind(*self.table.kinds))


def checked(wanted: Mapping[str, Options]) -> Mapping[str, Options]:
    """The wanted tables, names and options known to be possible before any log is opened.

    UsageError: no such table, no such option, or a value that none of its tables can be made with.
    """
    for name, options in wanted.items():
        refuse_unknown(name, MAKERS, f"no table is called {name!r}", do="choose among them")
        maker = MAKERS[name]
        known = {option.name: option for option in (*maker.table.options, *maker.table.views)}
        for option, value in options.items():
            what, all_of_it = f"no option of {name} is called {option!r}", (*known, *maker.inner)
            refuse_unknown(option, all_of_it, what, do="choose among them")
            if option in known and not known[option].fits(value):
                what = f"{name}: {option} = {str(value)[:40]!r}"
                raise UsageError(what, allowed=known[option].allowed, do="mend it")
        maker.check(options)
    return wanted


def with_channels(
    recording: Recording, names: Collection[str], tables: Collection[str]
) -> Recording:
    """The recording with no other channel than these that the `tables` could be made of.

    UsageError: it has no such channel, or none of the tables is made of one.
    """
    made = [MAKERS[table].table for table in tables]
    kinds = {kind for table in made for kind in table.rows_of or table.kinds}
    suited = [channel.name for channel in recording.of_kind(*kinds)]
    for name in names:
        refuse_unknown(
            name,
            suited,
            f"no channel of {' or '.join(tables)} is called {name!r}",
            do="choose among them, or leave --channel out for all",
            file=recording.log,
        )
    kept = {
        name: channel
        for name, channel in recording.channels.items()
        if name in names or name not in suited
    }
    return replace(recording, channels=kept)


def tables_of(
    recording: Recording,
    wanted: Mapping[str, Options],
    workers: int = 1,
    *,
    refused_first: bool = False,
    processes: bool = False,
) -> Iterator[Part]:
    """The `wanted` tables (keys of MAKERS, with their options), part by part.

    A table's parts are in the order of the channels, whatever the number of `workers`, and the same
    to the bit. With `refused_first` the first part comes when all are made. A log that is refused
    for one of its channels then leaves no rows on a stream. With `processes` the workers are
    processes where they can be, and parts come without what they were `found` in; else one channel
    is worked on after the other.

    UsageError: the recording lacks what a table is made of, or an option is none.
    """
    checked(wanted)
    made = _tables(recording, wanted, workers, processes)
    yield from list(made) if refused_first else made


def _tables(
    recording: Recording, wanted: Mapping[str, Options], workers: int, processes: bool
) -> Iterator[Part]:
    """The tables that are made channel by channel, then those of the log as a whole."""
    of_channels = {
        name: options
        for name, options in wanted.items()
        if MAKERS[name].of_channel and MAKERS[name].by_channel(recording, options)
    }
    if of_channels:
        yield from _channel_tables(recording, of_channels, workers, processes)
    for name, options in wanted.items():
        whole = MAKERS[name].whole
        if name not in of_channels and whole is not None:
            yield from whole(recording, options)


def _channel_tables(
    recording: Recording, wanted: Mapping[str, Options], workers: int, processes: bool
) -> Iterator[Part]:
    """The tables that are made channel by channel, each channel's passages found once."""
    from tirelog.strain.speed import not_turning, radius_remarks, speed_channels, strain_channels

    only_speed = set(wanted) == {"speed"}
    channels = speed_channels(recording) if only_speed else strain_channels(recording)
    turned = False
    told: set[tuple[str, str]] = set()
    with closing(_by_channel(recording, wanted, channels, workers, processes)) as of_channels:
        for parts, turns in of_channels:
            turned |= turns
            for part in parts:
                remarks = [
                    remark
                    for remark in (*radius_remarks(recording), *part.remarks)
                    if (part.table, remark) not in told
                ]
                told |= {(part.table, remark) for remark in remarks}
                yield replace(part, remarks=tuple(remarks))
    if not turned and not only_speed:
        raise not_turning(recording)


# ---- channels, several at work at a time


def _by_channel(
    recording: Recording,
    wanted: Mapping[str, Options],
    channels: Sequence[Channel],
    workers: int,
    processes: bool,
) -> Generator[tuple[list[Part], bool]]:
    """(tables, whether it has passages) of each channel, in order.

    With `processes` they are shared by the workers where they can be, and parts come without what
    they were `found` in, which no pipe carries.
    """
    at_hand = all(channel.at_hand for channel in channels)  # processes can read it side by side
    make = _maker(recording, wanted, channels)
    if not (processes and len(channels) > 1 and workers > 1 and POSSIBLE and at_hand):
        yield from map(make, range(len(channels)))
        return
    for module in _OF_CHANNELS:  # loaded once, before the processes part
        import_module(module)

    def bare(number: int) -> tuple[list[Part], bool]:
        parts, turns = make(number)
        return [replace(part, found=None) for part in parts], turns

    yield from in_processes(len(channels), workers, bare)


def _maker(
    recording: Recording, wanted: Mapping[str, Options], channels: Sequence[Channel]
) -> Callable[[int], tuple[list[Part], bool]]:
    """What makes the tables of a channel by its number.

    The first form that can be learnt is learnt here: all later channels start from it, so that
    their rows do not depend on who is quicker.
    """
    from tirelog.runs.in_memory import without_spikes
    from tirelog.strain.passages.find import passages_of

    def work_on(number: int, like: EdgeForm | None = None) -> Work:
        channel = without_spikes(channels[number])
        passages, settled = passages_of(recording, channel), None
        if "footprint" in wanted and not passages.doubt:
            from tirelog.strain.footprint.footprint import choose_form

            settled = choose_form(channel, passages, like=like)
        return Work(recording, channel, passages, settled)

    first: dict[int, Work] = {}
    like: EdgeForm | None = None
    for number in range(len(channels)) if "footprint" in wanted else ():
        first[number] = work_on(number)
        if like := first[number].settled:
            break
    makers = [(MAKERS[name].of_channel, options) for name, options in wanted.items()]

    def make(number: int) -> tuple[list[Part], bool]:
        work = first.pop(number, None) or work_on(number, like)
        return [of(work, options) for of, options in makers if of], len(work.passages) > 0

    return make


# ---- the tables


def cutoff_in(options: Options) -> Cutoff:
    """The low-pass of the footprint's plain lengths, a number in Hz.  UsageError: no low-pass."""
    from tirelog.dsp.filters import Cutoff

    given = options.get("cutoff", "auto")
    return Cutoff.parse(given if isinstance(given, str) else f"{float(given)}Hz")


def _speed_of_channel(work: Work, options: Options) -> Part:
    from tirelog.strain.speed import speed_columns, speed_doubts

    vague = work.recording.channels[work.passages.channel].axis.rate_error
    columns = speed_columns(work.recording.log, work.passages, rate_error=vague)
    return Part("speed", columns, speed_doubts(work.passages), work.passages)


def _speed_by_channel(recording: Recording, options: Options) -> bool:
    """False if the encoder gives the speed, or all channels give one rolling radius."""
    from tirelog.strain.speed import speed_channels

    return not options.get("calibrate_radius", False) and bool(speed_channels(recording))


def _speed_of_log(recording: Recording, options: Options) -> Iterator[Part]:
    from tirelog.strain.speed import calibrated_speed, speed_by_encoder, speed_channels

    if speed_channels(recording):
        made = calibrated_speed(recording)
    else:
        calibrate = bool(options.get("calibrate_radius", False))
        made = iter([speed_by_encoder(recording, calibrate=calibrate)])
    for columns, remarks in made:
        yield Part("speed", columns, remarks)


def _footprint(work: Work, options: Options) -> Part:
    from tirelog.strain.footprint.footprint import footprint_of_channel

    found = footprint_of_channel(
        work.recording,
        work.channel,
        work.passages,
        cutoff_in(options),
        work.settled,
        friction_ratio=options.get("friction_ratio"),
    )
    return Part("footprint", found.columns, found.remarks, found)


def _check_footprint(options: Options) -> None:
    """UsageError for an impossible low-pass or ratio of frictions."""
    from tirelog.strain.footprint.measure import friction_of

    cutoff_in(options)
    friction_of(options.get("friction_ratio"))


def _footprint_by_strain(recording: Recording, options: Options) -> bool:
    """False if the log has accelerometers and no grating."""
    return bool(recording.of_kind(*STRAIN_KINDS)) or not recording.of_kind(*ACCELERATION_KINDS)


def _footprint_of_accelerometers(recording: Recording, options: Options) -> Iterator[Part]:
    from tirelog.strain.footprint.footprint import accelerometer_footprints
    from tirelog.strain.speed import not_turning

    found = accelerometer_footprints(recording)
    if not any(len(one.passages) for one in found):
        raise not_turning(recording)
    for one in found:
        yield Part("footprint", one.columns, one.remarks, one)


def _dissipation(work: Work, options: Options) -> Part:
    from tirelog.strain.dissipation import dissipation_of_channel, regressions

    found = dissipation_of_channel(
        work.recording, work.channel, work.passages, _steady_step_m_s(options)
    )
    if options.get("fit", False):
        lines, remarks = regressions(work.recording.log, found)
        return Part("dissipation-fit", lines or {}, (*found.remarks, *remarks), found)
    return Part("dissipation", found.columns, found.remarks, found)


def _steady_step_m_s(options: Options) -> float:
    """Largest step of a constant speed between revolutions [m/s]."""
    from tirelog.strain.dissipation import STEADY_STEP_M_S

    step = float(options.get("steady_step", STEADY_STEP_M_S))
    if not step > 0:
        raise UsageError(
            f"--steady-step {step:g}", allowed="allowed is a step above 0 m/s", do="correct it"
        )
    return step


def _phase_shift(recording: Recording, options: Options) -> Iterator[Part]:
    from tirelog.wheel.calibration import measure_with

    calibration = _calibration(options)
    zero, forces = str(options.get("zero", "auto")), bool(options.get("forces", False))
    found = measure_with(calibration, recording, zero, forces)
    return phase_shift_parts(found, calibration)


def phase_shift_parts(
    found: Iterable[EdgeTimes], calibration: Calibration | None
) -> Iterator[Part]:
    """The rows of one log, accelerometer by accelerometer."""
    from tirelog.wheel.calibration import table

    for p in found:
        columns = table(p, calibration)
        yield Part("phase-shift", columns, p.said, (p, calibration))


def _calibration(options: Options) -> Calibration | None:
    """The calibration to apply, itself or the one in a file; None: without one."""
    from tirelog.wheel.calibration import Calibration, read_calibration

    given = options.get("calibration")
    return (
        given if given is None or isinstance(given, Calibration) else read_calibration(Path(given))
    )


def _check_phase_shift(options: Options) -> None:
    _calibration(options)
    if "zero" in options:
        from tirelog.wheel.phase_shift import zero_range

        zero_range(str(options["zero"]))


def _by_its_function(table: LogTable) -> Maker:
    """A table that one function makes of a whole log."""

    def whole(recording: Recording, options: Options) -> Iterator[Part]:
        for found in resolve_name(table.made_by)(recording, **options):
            yield Part(table.name, found.columns, found.remarks, found)

    def check(options: Options) -> None:
        own = {
            option.name: options[option.name] for option in table.options if option.name in options
        }
        if table.checked_by:
            resolve_name(table.checked_by)(**own)

    ends = tuple(end.name for end in STRETCH) if table.stretch == "own" else ()
    return Maker(table, ends, whole=whole, check=check)


#: tables that share what they are made of: passages, forms, a calibration
_TOGETHER = (
    Maker(
        LOG_TABLES["speed"],
        of_channel=_speed_of_channel,
        whole=_speed_of_log,
        by_channel=_speed_by_channel,
    ),
    Maker(
        LOG_TABLES["footprint"],
        of_channel=_footprint,
        whole=_footprint_of_accelerometers,
        by_channel=_footprint_by_strain,
        check=_check_footprint,
    ),
    Maker(LOG_TABLES["dissipation"], of_channel=_dissipation, check=_steady_step_m_s),
    Maker(
        LOG_TABLES["phase-shift"],
        ("forces",),
        whole=_phase_shift,
        check=_check_phase_shift,
    ),
)
#: how each table of the register is made
MAKERS: Mapping[str, Maker] = {
    **{maker.table.name: maker for maker in _TOGETHER},
    **{name: _by_its_function(table) for name, table in LOG_TABLES.items() if table.made_by},
}
#: the tables of a drive, which `tables`, campaigns and the report make together
OF_A_DRIVE: Mapping[str, Maker] = {
    name: maker for name, maker in MAKERS.items() if maker.table.driven
}
