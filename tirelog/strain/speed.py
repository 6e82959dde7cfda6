"""The speed table: speed with its error, one row per passage.

    Recording --find_passages on each strain channel--> Passages
        --here--> columns of the table `speed`

v_i = 2 (2 pi R_e) / (t_{i+1} - t_{i-1}) between like passages (P1 4, P2 4.2, errata). Its form for
unequal steps is exact for constant acceleration; the error of a changing one is subtracted
(`passage_flags.kinematics`). R_e is the loaded rolling radius.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tirelog.data.recording import Channel, Recording
from tirelog.dsp.filters import UNLIKE_SPEED, unlike_neighbours
from tirelog.errors import UsageError
from tirelog.strain.passages.find import Passages, passages_of
from tirelog.strain.passages.passage_flags import TURN_RAD
from tirelog.vocabulary.arrays import Records, TableRows, records
from tirelog.vocabulary.kinds import STRAIN_KINDS
from tirelog.vocabulary.quality import Quality, QualityFlags, having, marked, quality_column
from tirelog.wheel.rolling import FREE_M_S2, LEAST_TURNS, TURNS, rolling

# ---- The strain channels of a recording, and the refusal of a log whose wheel does not turn.


def strain_channels(recording: Recording) -> list[Channel]:
    """The strain channels.  UsageError if there is none."""
    channels = recording.of_kind(*STRAIN_KINDS)
    if not channels:
        wanted = f"channels of kind {' and '.join(STRAIN_KINDS)}"
        raise no_channel(recording, "no strain channel", wanted)
    return channels


def no_channel(recording: Recording, what: str, wanted: str) -> UsageError:
    """The error of a log without a channel that is needed; it tells those that there are."""
    have = ", ".join(f"{c.name} ({c.kind})" for c in recording.channels.values()) or "none"
    return UsageError(
        what,
        allowed=f"allowed are {wanted}, the log has {have}",
        do="name one in the setup",
        file=recording.log,
    )


def not_turning(recording: Recording) -> UsageError:
    """The error of a command that needs passages on a log without any."""
    return UsageError(
        "the wheel does not turn in this log: no grating passes the patch",
        allowed="allowed are logs with at least one passage",
        do="for a static test use `tirelog inflation`, and give the inked length as "
        "static_footprint_length_m under [tire]",
        file=recording.log,
    )


# Errata, Speed: R_e is a setting, or calibrated with a speed reference (`wheel.rolling`), by the
# turns that roll freely, as for the slip.


def calibrate_radius(speed: Channel, wheels: Sequence[Passages]) -> tuple[float, float, int]:
    """(rolling radius, its standard error [m], turns) by one wheel's channels.

    From the reference `speed` [m/s] and the passages of each channel.
    UsageError if fewer than LEAST_TURNS turns of free rolling lie within the reference.
    """
    found = [rolling(speed, turns_around(passages)) for passages in wheels]
    known = [one for one in found if np.isfinite(one.mean_radius_m[0])]
    if not known:
        raise UsageError(
            f"--calibrate-radius: fewer than {LEAST_TURNS} whole turns below {FREE_M_S2:g} m/s^2 "
            f"lie within {speed.name}",
            allowed="allowed is a log with more",
            do="give one with a cruise, or rolling_radius_m in the setup",
        )
    # the gratings of a wheel share the reference's errors, so more of them do not make the mean
    # better
    radius, error = np.mean([one.mean_radius_m for one in known], axis=0)
    return float(radius), float(error), sum(int(one.rows["free"].sum()) for one in known)


def speed_quality(passages: Passages) -> QualityFlags:
    """The passages' flags, with those on the speed.

    edge_of_log at the first and last, extrapolated if it is not centred, standstill and reversing
    beside such a break.
    """
    at_end = np.zeros(len(passages), bool)
    at_end[:1] = at_end[-1:] = True
    uncentred = passages.sides < 2
    flags = (
        passages.quality
        | marked(uncentred & at_end, Quality.EDGE_OF_LOG)
        | marked(uncentred & ~at_end, Quality.EXTRAPOLATED)
    )
    for why in (Quality.STANDSTILL, Quality.REVERSING):
        before = having(passages.break_after, why)
        flags |= marked(before, why)
        flags[1:] |= marked(before[:-1], why)
    speed = passages.speed_m_s
    return flags | unlike_neighbours(speed, flags, UNLIKE_SPEED * np.abs(speed))


def turns_around(passages: Passages) -> Records:
    """The turns to both sides of each passage, or the one that is known; (n,).

    Whole turns from passage to passage, whatever the speed does in them.
    """
    before, after = passages.turn_before, passages.turn_after
    time = passages.time_s
    return records(
        TURNS,
        begin_s=np.where(before, np.concatenate([time[:1], time[:-1]]), time),
        end_s=np.where(after, np.concatenate([time[1:], time[-1:]]), time),
        turns=before.astype(float) + after,
        acceleration_m_s2=passages.acceleration_m_s2,
        quality=speed_quality(passages),
    )


@dataclass(frozen=True)
class PassageRows(TableRows):
    """Rows of a table with one row per passage of `channel`.

    `found` (n,): what they were made of, of FOOTPRINT or DISSIPATION; None if of passages alone.
    """

    channel: Channel
    passages: Passages
    found: Any = None


def identity_columns(log: str, passages: Passages) -> dict[str, Any]:
    """The columns that every table with one row per revolution begins with.

    The names take no memory for each row.
    """
    n = len(passages)
    return {
        "log": np.broadcast_to(np.array(log, object), n),
        "channel": np.broadcast_to(np.array(passages.channel, object), n),
        "revolution": np.arange(n),
        "time_s": passages.time_s,
        "speed_m_s": passages.speed_m_s,
    }


def speed_columns(
    log: str, passages: Passages, radius_se_m: float = 0.0, rate_error: float = 0.0
) -> dict[str, Any]:
    """The speed table's columns for one channel's passages.

    `radius_se_m` is the radius' error if it was calibrated, `rate_error` that of the sampling rate,
    as a share.
    """
    # half of the time between the passages before and after if these are one turn away, else a turn
    # at the passage's speed
    step = np.diff(passages.time_s, prepend=np.nan, append=np.nan)
    both = passages.turn_before & passages.turn_after
    period = np.where(both, 0.5 * (step[:-1] + step[1:]), TURN_RAD / passages.omega_rad_s)
    with np.errstate(over="ignore", invalid="ignore"):  # an error without bounds is none
        share = np.hypot(radius_se_m / passages.radius_m, rate_error)
        error = np.hypot(passages.speed_se_m_s, share * passages.speed_m_s)
        # a standard error above the speed itself, and above this [m/s], tells nothing and is left
        # blank; half of it would blank those of a wheel that is about to stand, twice as much would
        # keep what no reader can use
        absurd = error > np.maximum(np.abs(passages.speed_m_s), 1.0)
    return identity_columns(log, passages) | {
        "period_s": period,
        "speed_se_m_s": np.where(absurd, np.nan, error),
        "acceleration_m_s2": passages.acceleration_m_s2,
        "quality": quality_column(speed_quality(passages) | marked(absurd, Quality.ERROR_UNKNOWN)),
    }


def speed_channels(recording: Recording) -> list[Channel]:
    """The channels whose passages tell the speed; none if the encoder tells it.

    Of strain, or without an encoder the radial acceleration.  UsageError: nothing does.
    """
    channels = recording.of_kind(*STRAIN_KINDS)
    if channels or recording.of_kind("wheel_encoder"):
        return channels
    channels = recording.of_kind("radial_acceleration")
    if not channels:
        wanted = "strain, wheel_encoder and radial_acceleration"
        raise no_channel(recording, "no channel tells the speed", wanted)
    return channels


def speed_by_encoder(
    recording: Recording, *, calibrate: bool = False
) -> tuple[Mapping[str, Any], Sequence[str]]:
    """(columns of the `speed` table, remarks) of a log whose encoder tells the speed.

    `calibrate` takes the rolling radius from the log's `vehicle_speed`. UsageError: it has none.
    SetupError: an accelerometer's patch shows that the encoder has other steps.
    """
    from tirelog.wheel.phase_shift import encoder_speed  # a log with gratings does without

    if calibrate:
        vehicle_speed(recording, "--calibrate-radius")
        recording = _without_rolling_radius(recording)
    columns, _, remarks = encoder_speed(recording)
    return columns, remarks


def calibrated_speed(
    recording: Recording,
) -> Iterator[tuple[Mapping[str, Any], Sequence[str]]]:
    """(columns of the `speed` table, remarks) of each channel.

    The rolling radius is taken from the log's `vehicle_speed` by all of them together.  UsageError:
    nothing to calibrate against.
    """
    reference = vehicle_speed(recording, "--calibrate-radius")
    if recording.setup.tire.unloaded_radius_m is not None:
        recording = _without_rolling_radius(recording)  # what is calibrated is not held against it
    found = [passages_of(recording, channel) for channel in speed_channels(recording)]
    if all(passages.doubt for passages in found):
        raise UsageError(f"--calibrate-radius: {found[0].doubt}", file=recording.log)
    radius_m, se_m, turns = calibrate_radius(reference, found)
    said = [
        f"rolling radius {radius_m:.5f} +- {se_m:.5f} m, calibrated against {reference.name} over "
        f"{turns} turns"
    ]
    for passages in found:
        rolled = replace(passages, radius_m=radius_m)
        vague = recording.channels[rolled.channel].axis.rate_error
        yield speed_columns(recording.log, rolled, se_m, vague), [*said, *speed_doubts(rolled)]
        said = []


def vehicle_speed(recording: Recording, needed_by: str) -> Channel:
    """The channel of the vehicle's speed, which is `needed_by` something.  UsageError: none."""
    references = recording.of_kind("vehicle_speed")
    if not references:
        raise UsageError(
            f"{needed_by}: the log has no vehicle speed",
            allowed="allowed is a log with a channel of kind vehicle_speed",
            do="add it to the setup",
            file=recording.log,
        )
    return references[0]


def speed_doubts(passages: Passages) -> list[str]:
    """Remarks on a channel whose passages give no speed."""
    if passages.doubt:
        return [passages.doubt]
    if not len(passages):
        return [
            f"{passages.channel}: no passage of the patch in this log: the wheel does not turn, "
            "or this is no patch signal; no rows"
        ]
    return []


def _without_rolling_radius(recording: Recording) -> Recording:
    """The recording as if its setup had no rolling radius, so that it is calibrated."""
    setup = recording.setup
    return replace(recording, setup=replace(setup, tire=replace(setup.tire, rolling_radius_m=None)))


def radius_remarks(recording: Recording) -> list[str]:
    """Remarks to say if the setup has no rolling radius."""
    tire = recording.setup.tire
    if tire.rolling_radius_m is not None:
        return []
    way = (
        "--calibrate-radius takes it from the vehicle's speed"
        if recording.of_kind("vehicle_speed")
        else "give rolling_radius_m"
    )
    return [
        f"no rolling radius in the setup: the unloaded radius {tire.radius_m:g} m is used, and "
        f"speeds are too high by about 2 %; {way}"
    ]
