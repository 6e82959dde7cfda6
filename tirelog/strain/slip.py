"""The table `slip`: longitudinal slip of every turn of the wheel, from the vehicle's speed.

    turns of the wheel (encoder, else passages) --distance of the vehicle in each--> metres per turn
        --`wheel.rolling`--> delay of the vehicle's speed, rolling radius R of free rolling
        --> sigma = 1 - omega R / V (P2 (14))

Over whole turns omega R / V is 2 pi R over the distance of one. Positive slip is braking. A radius
that is off by 1 % is a slip of 0.01, as much as hard braking makes: so R is what the vehicle
travels per turn while nothing pulls, in this log, and what a tire slips then counts for none. A
belt is longer at speed: R follows the speed squared if the turns of free rolling surely say so. A
speed that comes late by d is a slip of -d a / v, which the same turns show and which is corrected.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from tirelog.data.recording import Channel, Recording
from tirelog.data.setup import PLAUSIBLE
from tirelog.dsp.filters import unlike_neighbours
from tirelog.errors import UsageError
from tirelog.physics.pressure import STATIC_FRICTION
from tirelog.strain.footprint.footprint import footprints_of
from tirelog.strain.footprint.measure import friction_of
from tirelog.strain.passages.find import trusted_passages
from tirelog.strain.passages.passage_flags import TURN_RAD
from tirelog.strain.speed import speed_channels, speed_columns, turns_around, vehicle_speed
from tirelog.vocabulary.arrays import BoolArray, FloatArray, Records, TableRows
from tirelog.vocabulary.columns import TABLES
from tirelog.vocabulary.quality import OK, Quality, marked, quality_column
from tirelog.wheel.angle import encoder_of, means_between, rolling_radius
from tirelog.wheel.calibration import least_squares
from tirelog.wheel.phase_shift import encoder_speed
from tirelog.wheel.rolling import FREE_M_S2, LEAST_TURNS, Rolling, rolling


def slip_of(recording: Recording, fit: bool = False) -> Iterator[TableRows]:
    """The slip of every turn; with `fit` what it says of the road's friction, a row per channel.

    UsageError: no vehicle speed, nothing that tells the turns, or no radius to go by; with `fit`
    also no longitudinal force, or no load.
    """
    reference = vehicle_speed(recording, "slip")
    for columns, wheel, remarks in _turns(recording):
        found = _slip(recording, reference, columns, wheel, remarks)
        yield _friction_of(recording, found, wheel) if fit else found


def _turns(recording: Recording) -> Iterator[tuple[Mapping[str, Any], Records, Sequence[str]]]:
    """(columns of the table `speed`, its turns, remarks) of each channel that tells the turns."""
    channels = speed_channels(recording)
    if not channels or recording.of_kind("wheel_encoder"):
        yield encoder_speed(recording)
        return
    for channel in channels:
        passages = trusted_passages(recording, channel)
        yield speed_columns(recording.log, passages), turns_around(passages), []


def _slip(
    recording: Recording,
    reference: Channel,
    columns: Mapping[str, Any],
    wheel: Records,
    remarks: Sequence[str],
) -> TableRows:
    found = rolling(reference, wheel)
    radius, radius_se, said = _radius(recording, reference, found)
    metres = found.rows["metres"]
    with np.errstate(invalid="ignore", divide="ignore"):
        period = (wheel["end_s"] - wheel["begin_s"]) / wheel["turns"]
        slip = 1.0 - TURN_RAD * radius / metres
        share = np.abs(1.0 - slip)
        error = np.hypot(found.rows["se"] / metres, radius_se / radius) * share
        delayed = np.abs(found.rows["change_m_s"]) * found.delay_se_s / metres * share
    begin, end = (wheel[name] + found.delay_s for name in ("begin_s", "end_s"))
    outside = (begin < reference.axis.at(0.0)) | (end > reference.axis.at(reference.size - 1.0))
    lost = (wheel["turns"] > 0) & ~np.isfinite(metres)
    # slip that the delay's standard error may make of a row before it is marked: a quarter of what
    # moderate braking makes; doubled, rows are `ok` of which half may be the delay
    quality = (
        wheel["quality"]
        | marked(delayed > 0.005, Quality.DELAY_UNKNOWN)
        | marked(lost & outside, Quality.EDGE_OF_LOG)
        | marked(lost & ~outside, Quality.GAP)
    )
    quality |= marked(_contradicted(recording, found, wheel), Quality.IMPLAUSIBLE)
    # slip that a wheel may have in one turn alone
    quality |= unlike_neighbours(slip, quality, 0.01)
    table = {name: columns[name] for name in ("log", "channel", "revolution", "time_s")} | {
        "speed_m_s": columns["speed_m_s"],
        "vehicle_speed_m_s": metres / period,
        "slip": slip,
        "slip_se": error,
        "slip_delay_se": delayed,
        "quality": quality_column(quality),
    }
    late = f"{reference.name} late by {found.delay_s:.3f} +- {found.delay_se_s:.3f} s, corrected"
    return TableRows(table, (*remarks, said, late))


def _contradicted(recording: Recording, found: Rolling, wheel: Records) -> BoolArray:
    """Turns (n,) of free rolling on a radius that no tire has, by the vehicle's speed."""
    tire, unusual = recording.setup.tire, recording.setup.log.unusual or ()
    name = "vehicle_to_unloaded" if tire.rolling_radius_m is None else "vehicle_to_rolling"
    ratio, bounds = found.rows["metres"] / (TURN_RAD * tire.radius_m), PLAUSIBLE[name]
    free = np.abs(wheel["acceleration_m_s2"]) < FREE_M_S2
    return np.asarray(free & ((ratio < bounds.low) | (ratio > bounds.high)) & (name not in unusual))


def _radius(
    recording: Recording, reference: Channel, found: Rolling
) -> tuple[FloatArray | float, FloatArray | float, str]:
    """(rolling radius, its standard error [m], what was done)."""
    tire, radius, free = recording.setup.tire, found.rows["radius_m"], found.rows["free"]
    count = int(free.sum())
    if np.isfinite(found.mean_radius_m[0]):
        ends = radius[free]
        radii = (
            f"{ends.min():.5f} to {ends.max():.5f} m per radian, by the speed squared,"
            if found.grows
            else f"{found.mean_radius_m[0]:.5f} m per radian"
        )
        return (
            radius,
            found.rows["radius_se_m"],
            f"slip against {reference.name}: {radii} in {count} turns of free rolling, whose slip "
            "counts as none",
        )
    if tire.rolling_radius_m is None:
        raise UsageError(
            f"{count} turns below {FREE_M_S2:g} m/s^2, and the setup has no rolling radius: "
            "no slip can be measured",
            allowed=f"allowed are {LEAST_TURNS} turns of free rolling, or rolling_radius_m",
            do="give a log with a cruise, or the radius in the setup",
            file=recording.log,
        )
    return (
        tire.rolling_radius_m,
        0.0,
        f"slip against {reference.name} by the setup's rolling radius, for want of free rolling: "
        "a radius off by 1 % is a slip of 0.01",
    )


# ---- The table `slip --fit`: the road's friction from how slip grows with the force (P3).
#
#     slip sigma, mu = -F_x / F_z of each turn
#         --least squares--> sigma = mu / k + b mu |mu| + c + d v^2
#
# k is the slip slope by which Gustafsson parts roads (Automatica 33, 1997). Of a brush whose
# tread is as stiff as P2 (17) has it, k = 3 f_s: a road of other friction has another slope. A tire
# is some ten times stiffer, and then k says how the friction of two roads compares.


def slip_slope(
    mu: FloatArray, slip: FloatArray, se: FloatArray, speed: FloatArray, late: FloatArray
) -> dict[str, float]:
    """k and the friction by it, with standard errors.

    mu (positive in braking), slip, its standard error and speed are (n,), one turn after the other.
    So is the slip that one standard error of the delay of the vehicle's speed makes. By the speed
    squared goes what of the slip the rolling radius has taken for a belt that grows: drag is force
    too. All is NaN if k is not three times its error.
    """
    # five turns at a time: the force's noise flattens the line by what it is of the force's range;
    # with twice as many, gentle manoeuvres are lost between others
    size = mu.size // 5 * 5
    one = np.stack([slip, se / math.sqrt(5.0), mu, mu * np.abs(mu), speed**2, late])
    slip, se, *columns = one[:, :size].reshape(6, -1, 5).mean(axis=2)
    design = np.stack([*columns, np.ones(slip.size)], axis=1)
    known = np.eye(5)[3:4]  # the delay's error is one of its own, as by one turn more
    solved, covariance, _ = least_squares(
        np.vstack([design, known]), np.append(slip, 0.0), np.append(se, 1.0)
    )
    k, k_se = 1.0 / solved[0], math.sqrt(covariance[0, 0]) / solved[0] ** 2
    if not k > 3.0 * k_se:
        k = k_se = float("nan")
    return {
        "slip_slope": k,
        "slip_slope_se": k_se,
        "friction_by_slope": k / 3.0,
        "friction_by_slope_se": k_se / 3.0,
    }


def _friction_of(recording: Recording, found: TableRows, wheel: Records) -> TableRows:
    """The row of the table `slip-fit` from the rows of the table `slip`."""
    forces, load = recording.of_kind("longitudinal_force"), recording.setup.conditions.load_N
    loads = recording.of_kind("vertical_load")
    if not forces or (not loads and load is None):
        raise UsageError(
            "slip --fit needs the wheel's longitudinal force and its load",
            allowed="allowed is a log with channels of kind longitudinal_force and vertical_load, "
            "the latter or load_N in [conditions]",
            do="add them to the setup",
            file=recording.log,
        )
    pull = means_between(forces[0], wheel["begin_s"], wheel["end_s"])
    press = means_between(loads[0], wheel["begin_s"], wheel["end_s"]) if loads else load
    table = found.columns
    names = ("slip", "slip_se", "speed_m_s", "slip_delay_se")
    slip, se, speed, late = (np.asarray(table[name], float) for name in names)
    late = np.copysign(late, wheel["acceleration_m_s2"])
    with np.errstate(invalid="ignore", divide="ignore"):
        mu = np.asarray(-pull / press, float)
        # of a brush with f_s = 0.8 the slope is then right to 1 %, of one with 0.4 to 8 %; twice as
        # much of mu would be off by as much on a dry road
        used = (np.asarray(table["quality"]) == OK) & (np.abs(mu) < 0.2) & (se > 0.0)
    used &= np.isfinite(slip + mu + speed + late)
    # a line with a bend and a delay through fewer turns, or through hardly any force, is chance
    if used.sum() < 40 or np.ptp(mu[used]) < 0.05:
        remark = f"{used.sum()} turns of known slip and force: too few, or hardly any force"
        return TableRows({name: [] for name in TABLES["slip-fit"]}, (*found.remarks, remark))
    row = slip_slope(*(x[used] for x in (mu, slip, se, speed, late)))
    remark = (
        "friction_by_slope is slip_slope / 3, for a tread that slides as a whole at slip 1 only: "
        "divide it by the tread's stiffness over that one's, or compare roads of one tire by it"
    )
    whole = {
        "log": table["log"], "channel": table["channel"], "turns": int(used.sum()), **row
    }  # fmt: skip
    columns = {name: np.atleast_1d(whole[name])[:1] for name in TABLES["slip-fit"]}
    return TableRows(columns, (*found.remarks, remark))


# ---- The table `grip`: how much of the patch still adheres, and what friction that is (P2 3, 4.2).
#
#     slip onset x_s and length 2 L of a passage --(15)--> adhesion share a = (x_s + L) / 2 L
#         --(13), (17)--> friction used and left
#
# With C_x = r 2 gamma L f_s, x_s = L (1 - 2 r |sigma|), so that r |sigma| = 1 - a, and the traction
# of (13) sums to
#
#     |F_x| / F = 3 f_s (1 - a) a^2 + f_d (2 - 3 u + u^3) / 4,      u = x_s / L = 2 a - 1
#
# The strain has the size of the traction alone, since drive and a lever of one sign look like
# braking
# and a lever of the other; the sign of F_x, positive in drive, is that of the car's acceleration.
# What is left is counted from the largest that this can be. The brush is P2's: friction and
# stiffness
# are given, not measured, and a road that is smoother than they say leaves less.


#: L ~ F^0.5, as model files start with (`patch_load_exponent`): a patch that is 1 % longer carries
#: 2 % more; an exponent twice as large halves that
LOAD_EXPONENT = 0.5
#: standard error of that exponent: tires have some 0.35 to 0.8; twice as much doubles the error of
#: a force away from the usual one
EXPONENT_SD = 0.15
#: acceleration [m/s^2] from which its sign is that of the traction: a grade of 6 % asks for as much
#: the other way; twice as much leaves the force of gentle driving without its sign
SIGN_M_S2 = 0.6


def grip_of(
    recording: Recording,
    static_friction: float = STATIC_FRICTION,
    sliding_friction: float | None = None,
    stiffness_ratio: float = 1.0,
    load_exponent: float = LOAD_EXPONENT,
) -> Iterator[TableRows]:
    """The grip that each passage shows.  UsageError: as `footprints_of`.

    The onset is looked for with the ratio of the frictions; without a `sliding_friction` it is that
    of the setup, or the usual one.
    """
    load, ratio = recording.setup.conditions.load_N, recording.setup.tire.friction_ratio
    if sliding_friction is not None:
        ratio = sliding_friction / static_friction
    sliding, sliding_se = (static_friction * one for one in friction_of(ratio))
    for found in footprints_of(recording, ratio):
        columns = grip_columns(
            found.columns,
            static_friction,
            sliding,
            stiffness_ratio,
            load_exponent,
            load,
            found.passages.acceleration_m_s2,
            sliding_se,
        )
        told = int(np.isfinite(columns["adhesion_share"]).sum())
        said = (
            f"{found.channel.name}: an onset of slip in {told} of {len(found.passages)} passages; "
            f"friction by the brush with {static_friction:g} sticking, {sliding:.3g} sliding and "
            f"{stiffness_ratio:g} times the stiffness that slides as a whole at slip 1 only"
        )
        of_forces = "no forces: the setup's [conditions] has no load_N"
        if load is not None:
            signed = int(np.isfinite(columns["longitudinal_force_N"]).sum())
            of_forces = (
                f"forces take the passage of median length to carry {load:g} N, and the length to "
                f"grow as load^{load_exponent:g}; {told - signed} longitudinal forces are empty: "
                f"below {SIGN_M_S2:g} m/s^2 the acceleration does not tell drive from braking"
            )
        yield TableRows(columns, (*found.remarks, said, of_forces))


def refuse_frictions(
    static_friction: float = STATIC_FRICTION,
    sliding_friction: float | None = None,
    stiffness_ratio: float = 1.0,
    load_exponent: float = LOAD_EXPONENT,
) -> None:
    """UsageError for numbers that no brush has."""
    for option, value, low, high in (
        ("--static-friction", static_friction, 0.05, 3.0),
        ("--sliding-friction", sliding_friction, 0.05, 3.0),
        ("--stiffness-ratio", stiffness_ratio, 0.1, 100.0),
        ("--load-exponent", load_exponent, 0.05, 2.0),
    ):
        if value is not None and not low <= value <= high:
            raise UsageError(
                f"{option} {value:g}", allowed=f"{low:g} to {high:g} is allowed", do="correct it"
            )
    if sliding_friction is not None:
        friction_of(sliding_friction / static_friction)


def friction_used(
    adhesion: FloatArray, static_friction: float, sliding_friction: float
) -> FloatArray:
    """|F_x| / F of P2 (13) if a share of the patch adheres, shape of `adhesion`."""
    u = 2.0 * adhesion - 1.0
    stick = 3.0 * static_friction * (1.0 - adhesion) * adhesion**2
    slide: FloatArray = sliding_friction * (2.0 - 3.0 * u + u**3) / 4.0
    return stick + slide


def grip_columns(
    footprint: dict[str, Any],
    static_friction: float,
    sliding_friction: float,
    stiffness_ratio: float,
    load_exponent: float,
    load_N: float | None,
    acceleration_m_s2: FloatArray,
    sliding_se: float = 0.0,
) -> dict[str, Any]:
    """Columns of the table from those of the table `footprint`, shape (n,).

    The strain shows the size of the traction; its sign is that of the acceleration (n,).
    """
    length, onset = (np.asarray(footprint[n], float) for n in ("length_m", "slip_onset_m"))
    length_se, onset_se = (
        np.asarray(footprint[n], float) for n in ("length_se_m", "slip_onset_se_m")
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.clip(onset / length + 0.5, 0.0, 1.0)
        share_se = np.hypot(onset_se, onset / length * length_se) / length
        used = friction_used(share, static_friction, sliding_friction)
        u = 2.0 * share - 1.0
        stick, slide = 3.0 * static_friction, sliding_friction
        slope = stick * share * (2.0 - 3.0 * share) + 1.5 * slide * (u**2 - 1.0)
        by_sliding = friction_used(share, 0.0, 1.0) * sliding_se
        every = np.linspace(0.0, 1.0, 1001)
        most = friction_used(every, static_friction, sliding_friction)
        # beyond the peak more slip gives less: nothing is left
        left = np.where(share > every[np.argmax(most)], 1.0 - used / most.max(), 0.0)
        left = np.where(np.isfinite(share), left, np.nan)
    columns = {
        **{name: footprint[name] for name in ("log", "channel", "revolution", "time_s")},
        **{name: footprint[name] for name in ("speed_m_s", "slip_onset_reason", "quality")},
        "adhesion_share": share,
        "adhesion_share_se": share_se,
        "brush_slip": (1.0 - share) / stiffness_ratio,
        "friction_used": used,
        "friction_used_se": np.hypot(slope * share_se, by_sliding),
        "grip_left": left,
    }
    if load_N is None:
        return columns
    good = (np.asarray(footprint["quality"]) == OK) & np.isfinite(length)
    usual = float(np.median(length[good])) if good.any() else np.nan
    force = load_N * (length / usual) ** (1.0 / load_exponent)
    columns["vertical_force_N"] = force
    by_exponent = np.abs(np.log(length / usual)) * EXPONENT_SD / load_exponent**2
    columns["vertical_force_se_N"] = force * np.hypot(
        length_se / length / load_exponent, by_exponent
    )
    with np.errstate(invalid="ignore"):
        sure = np.abs(acceleration_m_s2) >= SIGN_M_S2
    sign = np.where(sure, np.sign(acceleration_m_s2), np.nan)
    columns["longitudinal_force_N"] = sign * used * force
    columns["longitudinal_force_se_N"] = np.abs(sign) * np.hypot(
        columns["friction_used_se"] * force, used * columns["vertical_force_se_N"]
    )
    return columns


# ---- The table `strain-shift`: P4's regressors by a strain sensor and the wheel's encoder.
#
#     footprint's entry and exit times --wheel angle at them--> fronts in wheel angle
#         --P4 section III--> patch width, shift of the patch's middle against its zero
#
# P1 and P2 end with a phonic wheel beside the gratings: its speed is beside that of the
# passages,
# and the shift is what a longitudinal force does to the patch's place, as P4 measures it by an
# accelerometer. The sensor's own angle is not known; the zero is the mean over the first passages
# that are good, so that only changes count.


def strain_shift_of(recording: Recording) -> Iterator[TableRows]:
    """Width and shift of the patch in wheel angle at each passage.

    SetupError: no encoder.  DataLoss: it shows no teeth.  UsageError: no patch comes round.
    """
    _, wheel = encoder_of(recording)
    radius_m, _, said = rolling_radius(recording, wheel)
    for found in footprints_of(recording):
        table = found.columns
        entry, exit_ = (np.asarray(table[name], float) for name in ("entry_time_s", "exit_time_s"))
        angles = [wheel.angle.at(time) for time in (entry, exit_)]
        middle = 0.5 * (angles[0] + angles[1])
        good = (np.asarray(table["quality"]) == OK) & np.isfinite(middle)
        # passages whose middle is the zero of the shift: with one its error would be in all rows;
        # twice as many would reach into the first manoeuvre of a short log
        first = np.flatnonzero(good)[:8]
        # whole turns apart: the mean direction, then what each differs from it
        zero = np.angle(np.exp(1j * middle[first]).mean()) if first.size else np.nan
        shift = np.angle(np.exp(1j * (middle - zero)))
        time = np.asarray(table["time_s"], float)
        noise = np.sqrt(0.5) * wheel.angle.noise_at(time)
        shared = np.sqrt(0.5) * wheel.angle.shared_noise_at(time)
        speed = np.asarray(table["speed_m_s"], float)
        times = np.asarray(table["length_se_m"], float) / np.where(speed > 0.0, speed, np.nan)
        rate = wheel.speed_rad_s(time)
        error = np.hypot(np.hypot(noise, shared), 0.5 * times * rate)
        columns = {
            name: table[name]
            for name in ("log", "channel", "revolution", "time_s", "speed_m_s", "quality")
        } | {
            "entry_angle_deg": np.degrees(angles[0]) % 360.0,
            "exit_angle_deg": np.degrees(angles[1]) % 360.0,
            "patch_width_deg": np.degrees(angles[1] - angles[0]),
            "patch_width_se_deg": np.degrees(np.hypot(2.0 * noise, times * rate)),
            "phase_shift_deg": np.degrees(shift),
            "phase_shift_se_deg": np.degrees(error),
            "wheel_speed_m_s": rate * radius_m,
        }
        channel = found.channel.name
        remark = (
            f"{channel}: zero of the phase shift from the first {first.size} good passages"
            if first.size
            else f"{channel}: no good passage, so the phase shift has no zero"
        )
        yield TableRows(columns, (*said, *found.remarks, remark))
        said = ()
