"""The tables of a recording by name: the only way from channels to rows, for whoever wants them.

    recording, {name: options} --tables_of--> Part (rows of one channel, remarks, what they are
                                              made of), channel by channel

Each table's command, `tables`, campaigns, the report and the Python functions all go through
`tables_of`. Tables of strain channels share what they are made of: a channel is read once and its
passages are found once, whatever the number of tables, and several channels are worked on at a
time. A table that a function of its own makes needs nothing here: `vocabulary.tables` names the
function.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING

from tirelog.by_channel import ChannelWorker, Options, Part, Work, by_channel, cutoff_in
from tirelog.data.recording import Channel, Recording
from tirelog.errors import UsageError, refuse_unknown
from tirelog.vocabulary.kinds import ACCELERATION_KINDS, STRAIN_KINDS
from tirelog.vocabulary.tables import LOG_TABLES, LogTable, TableOption

if TYPE_CHECKING:
    from tirelog.strain.passages.find import Passages
    from tirelog.wheel.calibration import Calibration
    from tirelog.wheel.phase_shift import EdgeTimes


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
    check: Callable[[Options], None] = lambda options: None

    @property
    def options(self) -> tuple[str, ...]:
        """Names of the table's settings."""
        return tuple(option.name for option in self.table.options)

    @property
    def known(self) -> tuple[str, ...]:
        """Names of all that it may be given: settings, views, and what is for programs."""
        return (*self.options, *(view.name for view in self.table.views), *self.inner)

    def option(self, name: str) -> TableOption | None:
        """The setting or view of that name; None: it is for programs."""
        return next((o for o in (*self.table.options, *self.table.views) if o.name == name), None)

    def suits(self, recording: Recording) -> bool:
        """True if the recording has the channels that the table is made of."""
        return bool(recording.of_kind(*self.table.kinds))

    def goes_by_channel(self, recording: Recording, options: Options) -> bool:
        """True if the table is made channel by channel from passages."""
        return self.of_channel is not None and self.by_channel(recording, options)


def checked(wanted: Mapping[str, Options]) -> Mapping[str, Options]:
    """The wanted tables, names and options known to be possible before any log is opened.

    UsageError: no such table, no such option, or a value that none of its tables can be made with.
    """
    for name, options in wanted.items():
        _one_of("table", name, MAKERS)
        for option, value in options.items():
            _one_of(f"option of {name}", option, MAKERS[name].known)
            known = MAKERS[name].option(option)
            if known is not None and not known.fits(value):
                raise UsageError(
                    f"{name}: {option} = {str(value)[:40]!r}", allowed=known.allowed, do="mend it"
                )
        MAKERS[name].check(options)
    return wanted


def _one_of(what: str, name: str, allowed: Collection[str]) -> None:
    refuse_unknown(name, allowed, f"no {what} is called {name!r}", do="choose among them")


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

    A table's parts are in the order of the channels, whatever the number of `workers` (threads),
    and the same to the bit. `refused_first` finds the passages of all channels before the first
    part, so that a log that is refused for one of its channels leaves no rows on a stream, at the
    price of reading the channels once more. With `processes` the workers are processes where
    they can be, and parts come without what they were `found` in.

    UsageError: the recording lacks what a table is made of, or an option is none.
    """
    checked(wanted)
    of_channels = {
        name: options
        for name, options in wanted.items()
        if MAKERS[name].goes_by_channel(recording, options)
    }
    if of_channels:
        yield from _channel_tables(recording, of_channels, workers, refused_first, processes)
    for name, options in wanted.items():
        whole = MAKERS[name].whole
        if name not in of_channels and whole is not None:
            parts = whole(recording, options)
            yield from list(parts) if refused_first else parts


def _channel_tables(
    recording: Recording,
    wanted: Mapping[str, Options],
    workers: int,
    refused_first: bool,
    processes: bool,
) -> Iterator[Part]:
    """The tables that are made channel by channel, each channel's passages found once."""
    from tirelog.strain.speed import not_turning, radius_remarks, speed_channels, strain_channels

    only_speed = set(wanted) == {"speed"}
    stored = speed_channels(recording) if only_speed else strain_channels(recording)
    found: list[Passages | None] = [None] * len(stored)
    if refused_first:
        stored, found = _all_passages(recording, stored, workers, keep=not only_speed)
        if not only_speed and not any(len(passages) for passages in found if passages is not None):
            raise not_turning(recording)
    turned = False
    told: set[tuple[str, str]] = set()
    channels = list(zip(stored, found, strict=True))
    making = ChannelWorker(recording, wanted, _part)
    with closing(by_channel(making, channels, workers, processes)) as of_channels:
        for made in of_channels:
            turned |= made.turns
            for part in made.parts:
                remarks = [
                    remark
                    for remark in (*radius_remarks(recording), *part.remarks)
                    if (part.table, remark) not in told
                ]
                told |= {(part.table, remark) for remark in remarks}
                yield replace(part, remarks=tuple(remarks))
    if not turned and not only_speed:
        raise not_turning(recording)


def _all_passages(
    recording: Recording, channels: list[Channel], workers: int, keep: bool
) -> tuple[list[Channel], list[Passages | None]]:
    """The channels and the passages of each; a single one in memory if it is to be `kept` there."""
    from tirelog.runs.in_memory import without_spikes
    from tirelog.strain.passages.find import passages_of

    if keep and len(channels) == 1:
        channels = [without_spikes(channels[0])]  # gone through once more by whoever takes it
    with ThreadPoolExecutor(workers) as pool:
        return channels, list(pool.map(partial(passages_of, recording), channels))


def _part(name: str, work: Work, options: Options) -> Part | None:
    """Rows of the table `name` of one channel; None if no channel alone has any."""
    of_channel = MAKERS[name].of_channel
    return None if of_channel is None else of_channel(work, options)


# ---- the tables


def _speed_of_channel(work: Work, options: Options) -> Part:
    from tirelog.strain.speed import speed_columns, speed_doubts

    columns = speed_columns(work.recording.log, work.passages)
    return Part("speed", columns, speed_doubts(work.passages), work.passages)


def _speed_by_channel(recording: Recording, options: Options) -> bool:
    """False if the encoder tells the speed, or all channels together the rolling radius."""
    from tirelog.strain.speed import speed_channels

    return not options.get("calibrate_radius", False) and bool(speed_channels(recording))


def _speed_of_log(recording: Recording, options: Options) -> Iterator[Part]:
    from tirelog.strain.speed import calibrated_speed, speed_by_encoder, speed_channels

    calibrate = bool(options.get("calibrate_radius", False))
    made = (
        calibrated_speed(recording)
        if speed_channels(recording)
        else iter([speed_by_encoder(recording, calibrate=calibrate)])
    )
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
        measured=work.measured,
        friction_ratio=options.get("friction_ratio"),
    )
    return Part("footprint", found.columns, found.remarks, found)


def _check_footprint(options: Options) -> None:
    """UsageError for a low-pass or a ratio of frictions that none can have."""
    from tirelog.strain.footprint.slip_onset import FrictionRatio

    cutoff_in(options)
    FrictionRatio.given(options.get("friction_ratio"))


def _footprint_by_strain(recording: Recording, options: Options) -> bool:
    """False if the log has accelerometers and no grating."""
    return bool(recording.of_kind(*STRAIN_KINDS)) or not recording.of_kind(*ACCELERATION_KINDS)


def _footprint_of_accelerometers(recording: Recording, options: Options) -> Iterator[Part]:
    from tirelog.strain.footprint.fronts import accelerometer_footprints
    from tirelog.strain.speed import not_turning

    found = accelerometer_footprints(recording)
    if not any(len(one.passages) for one in found):
        raise not_turning(recording)
    for one in found:
        yield Part("footprint", one.columns, one.remarks, one)


def _dissipation(work: Work, options: Options) -> Part:
    from tirelog.strain.dissipation_table import by_speed, dissipation_of_channel, regressions

    found = dissipation_of_channel(
        work.recording, work.channel, work.passages, *_steadiness(options)
    )
    if options.get("fit", False):
        lines, remarks = regressions(work.recording.log, found)
        return Part("dissipation-fit", lines or {}, (*found.remarks, *remarks), found)
    columns = by_speed(found) if options.get("by_speed", False) else found.columns
    return Part("dissipation", columns, found.remarks, found)


def _steadiness(options: Options) -> tuple[float, int]:
    """Largest step of a constant speed [m/s], revolutions of a moving average."""
    from tirelog.strain.dissipation import AVERAGED, STEADY_STEP_M_S

    step = float(options.get("steady_step", STEADY_STEP_M_S))
    average = int(options.get("average", AVERAGED))
    if not step > 0 or average < 1:
        raise UsageError(
            "steady_step (--steady-step) is above 0 m/s and average (--average) at least 1 "
            "revolution",
            do="mend the number",
        )
    if options.get("fit", False) and options.get("by_speed", False):
        raise UsageError(
            "fit (--fit) and by_speed (--by-speed) are two tables",
            allowed="allowed is one of them",
            do="ask twice",
        )
    return step, average


def _phase_shift(recording: Recording, options: Options) -> Iterator[Part]:
    from tirelog.wheel.table import measure_with

    calibration = _calibration(options)
    zero, forces = str(options.get("zero", "auto")), bool(options.get("forces", False))
    ordered = bool(options.get("by_time", False))
    return phase_shift_parts(
        measure_with(calibration, recording, zero, forces), calibration, ordered
    )


@dataclass(frozen=True)
class PhaseShiftFound:
    """Passages of accelerometers of one log, and the calibration that was applied to them."""

    passages: tuple[EdgeTimes, ...]
    calibration: Calibration | None


def phase_shift_parts(
    found: Iterable[EdgeTimes], calibration: Calibration | None, ordered: bool = False
) -> Iterator[Part]:
    """The rows of one log, accelerometer by accelerometer, or of all `ordered` in time."""
    from tirelog.wheel.table import by_time, table

    parts = (
        Part("phase-shift", table(p, calibration), p.said, PhaseShiftFound((p,), calibration))
        for p in found
    )
    if not ordered:
        yield from parts
    elif all_of_it := list(parts):
        yield Part(
            "phase-shift",
            by_time([part.columns for part in all_of_it]),
            [remark for part in all_of_it for remark in part.remarks],
            PhaseShiftFound(
                tuple(p for part in all_of_it for p in part.found.passages), calibration
            ),
        )


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
        from tirelog.wheel.phase_shift import refuse_other_zero

        refuse_other_zero(str(options["zero"]))


def _check_with(read: Callable[[Options], object]) -> Callable[[Options], None]:
    """A check by reading the options and dropping what they say."""

    def check(options: Options) -> None:
        read(options)

    return check


def _by_its_function(table: LogTable) -> Maker:
    """A table that one function makes of a whole log, as its entry in the register says."""

    def whole(recording: Recording, options: Options) -> Iterator[Part]:
        for found in resolve_name(table.made_by)(recording, **options):
            yield Part(table.name, found.columns, found.remarks, found)

    def check(options: Options) -> None:
        if table.checked_by:
            resolve_name(table.checked_by)(**options)

    return Maker(table, whole=whole, check=check)


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
    Maker(LOG_TABLES["dissipation"], of_channel=_dissipation, check=_check_with(_steadiness)),
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
