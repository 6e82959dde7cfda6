"""The table `footprint` of an accelerometer: contact length between the fronts of each passage.

    Passages --their kinematics--> wheel angle --`wheel.fronts`--> fronts
        --speed--> length, entry and exit time

Inside the patch the tread moves straight and its acceleration is nothing; outside it is Omega^2 R
or, if the sensor is AC-coupled, something else by as much. A front is where the signal crosses the
middle between the two levels: a fixed share of the step at every speed (errata on P4). No encoder
is needed: the passages themselves are the clock.
"""

from __future__ import annotations

import numpy as np

from tirelog.data.recording import Channel, Recording
from tirelog.dsp.pitch import AngleFunction
from tirelog.runs.in_memory import without_spikes
from tirelog.strain.passages.find import Passages, passages_of
from tirelog.strain.passages.passage_flags import TURN_RAD
from tirelog.strain.speed import PassageRows, identity_columns, speed_quality
from tirelog.vocabulary.arrays import FloatArray, Records, records
from tirelog.vocabulary.kinds import ACCELERATION_KINDS
from tirelog.vocabulary.quality import Quality, good, marked, quality_column
from tirelog.wheel.fronts import PASSAGE, fill_fronts

#: columns of lengths that only a strain's derivatives have
_OF_STRAIN = (
    "length_form_se_m", "length_d2_m", "length_d2_se_m", "length_d1_m", "length_d1_se_m",
)  # fmt: skip
#: a passage's own kinematics tell the angle so far to either side [rad]; half a turn on it is the
#: next one's
_OWN_RAD = 2.6


def accelerometer_footprints(recording: Recording) -> list[PassageRows]:
    """The footprint of every accelerometer of a recording."""
    return [
        footprint_of_accelerometer(recording, channel)
        for channel in recording.of_kind(*ACCELERATION_KINDS)
    ]


def footprint_of_accelerometer(recording: Recording, channel: Channel) -> PassageRows:
    """The footprint of one accelerometer."""
    channel = without_spikes(channel)
    passages = passages_of(recording, channel)
    fronts, entry_s, exit_s = _fronts(channel, passages)
    nothing, width = np.full(len(passages), np.nan), fronts["exit_rad"] - fronts["entry_rad"]
    # samples between the fronts below which none can be known; twice as many leave fast passages of
    # slow loggers without
    short = 2.0 * fronts["half_rad"] * channel.axis.rate_Hz < 4.0 * fronts["rate_rad_s"]
    untold, flags = np.isnan(width), speed_quality(passages)
    flags |= marked(short, Quality.PATCH_SHORT)
    flags |= np.where(untold, fronts["quality"], np.uint32(0))
    with np.errstate(invalid="ignore", divide="ignore"):
        of_speed = width * np.nan_to_num(passages.omega_se_rad_s / passages.omega_rad_s)
        steep = fronts["exit_slope"] - fronts["entry_slope"]
        asymmetry = (fronts["exit_slope"] + fronts["entry_slope"]) / steep
    length = passages.radius_m * width
    columns = identity_columns(recording.log, passages) | {
        "length_m": length,
        "length_se_m": passages.radius_m * np.hypot(fronts["width_se_rad"], of_speed),
        **dict.fromkeys(_OF_STRAIN, nothing),
        "entry_time_s": entry_s,
        "exit_time_s": exit_s,
        "edge_asymmetry": np.where(untold, np.nan, asymmetry),
        "slip_onset_m": nothing,
        "slip_onset_se_m": nothing,
        "slip_onset_reason": np.full(len(passages), "not strain", object),
        "quality": quality_column(flags | marked(untold & good(flags), Quality.NO_LENGTH)),
    }
    if passages.doubt:
        said = passages.doubt
    elif untold.all():
        said = f"{channel.name}: no front was found; no lengths"
    else:
        said = (
            f"{channel.name}: contact length {1e3 * float(np.nanmedian(length)):.2f} mm (median), "
            "between the fronts at half of the step of the acceleration; the tread's bend at the "
            "edges is in it"
        )
    return PassageRows(columns, (said,), channel, passages)


def _fronts(channel: Channel, passages: Passages) -> tuple[Records, FloatArray, FloatArray]:
    """The fronts (n,) of PASSAGE of all passages; times of entry and exit (n,) [s]."""
    n, nan = len(passages), np.nan
    fronts = records(PASSAGE, entry_rad=np.full(n, nan), exit_rad=nan, width_se_rad=nan)
    fronts["rate_rad_s"] = passages.omega_rad_s
    times = np.full((2, n), nan)
    known = np.flatnonzero(np.isfinite(passages.omega_rad_s))
    if passages.doubt or passages.template is None or not known.size:
        return fronts, *times
    rows = fronts[known]
    rows["middle_rad"] = TURN_RAD * np.arange(known.size)
    rows["half_rad"] = passages.template.half_width_rad
    rows["ahead_m_s2"] = np.nan_to_num(passages.acceleration_m_s2[known])
    angle = _angle(passages, known)
    fill_fronts(channel, angle, rows, -passages.sign, passages.noise)
    times[:, known] = [angle.time_at(rows[name]) for name in ("entry_rad", "exit_rad")]
    fronts[known] = rows
    return fronts, *times


def _angle(passages: Passages, known: np.ndarray) -> AngleFunction:
    """The wheel angle by the kinematics of the `known` passages, a turn apart each."""
    omega = passages.omega_rad_s[known][:, None]
    alpha = np.nan_to_num(passages.alpha_rad_s2[known])[:, None]
    turned = np.array([-_OWN_RAD, 0.0, _OWN_RAD])
    with np.errstate(invalid="ignore"):  # a wheel at rest before has no time there
        rate = np.sqrt(omega**2 + 2.0 * alpha * turned)
    time = (passages.time_s[known][:, None] + 2.0 * turned / (omega + rate)).ravel()
    angle = (TURN_RAD * np.arange(known.size)[:, None] + turned).ravel()
    kept = time > np.fmax.accumulate(np.append(-np.inf, time))[:-1]
    stretch = np.zeros(int(kept.sum()), np.int32)
    return AngleFunction(
        time[kept], angle[kept], 1.0, rate.ravel()[kept].astype(np.float32), stretch, 0.0
    )
