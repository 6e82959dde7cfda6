"""The table `footprint` of an accelerometer: contact length between the fronts of each passage.

    Passages --some of them, over their level--> the mean form: where its fronts are, how steep
        each passage: level inside and outside, samples of its flanks --cubic--> crossings
            --speed--> length, entry and exit time

Inside the patch the tread moves straight and its acceleration is nothing; outside it is Omega^2 R
or, if the sensor is AC-coupled, something else by as much. A front is where the signal crosses the
middle between the two levels, which is a fixed share of the step at every speed (errata on P4). No
encoder is needed: the passages themselves are the clock. The lobes beside the edges belong to
neither level: outside is taken from beyond them.
"""

from __future__ import annotations

import numpy as np

from tirelog.data.recording import Channel, Recording
from tirelog.runs.in_memory import without_spikes
from tirelog.strain.passages.find import Passages, passages_of
from tirelog.strain.speed import PassageRows, identity_columns, speed_quality
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import ACCELERATION_KINDS
from tirelog.vocabulary.quality import Quality, QualityFlags, good, marked, quality_column

#: where the level outside is read, beyond the fronts [rad], as with an encoder
#: (`wheel.coarse_patch`): past the lobes; gravity's part is a twelfth of g in the mean over it
_FAR = np.radians([25.0, 130.0])
#: share of the patch, about its middle, in which the level inside is read: beyond it a short patch
#: bends already; doubled, lengths of 70 mm come out 1 % longer
_INSIDE = 0.35
#: samples that a cubic needs beside its four numbers; fewer get a line, of which two are enough
_CUBIC, _LINE = 8, 3
_FORM = np.radians(np.arange(-60.0, 60.01, 0.25))
#: half widths of a patch that a tire has [rad]; outside of these nothing is a front
_LEAST_HALF, _MOST_HALF = np.radians([2.0, 45.0])


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
    told, flags = lengths(channel, passages)
    nothing = np.full(len(passages), np.nan)
    columns = identity_columns(recording.log, passages) | {
        "length_m": told[0],
        "length_se_m": told[1],
        **dict.fromkeys(_OF_STRAIN, nothing),
        "entry_time_s": told[2],
        "exit_time_s": told[3],
        "edge_asymmetry": told[4],
        "slip_onset_m": nothing,
        "slip_onset_se_m": nothing,
        "slip_onset_reason": np.full(len(passages), "not strain", object),
        "quality": quality_column(flags),
    }
    if passages.doubt:
        said = passages.doubt
    elif not np.isfinite(told[0]).any():
        said = f"{channel.name}: no front could be told; no lengths"
    else:
        length = 1e3 * float(np.nanmedian(told[0]))
        said = (
            f"{channel.name}: contact length {length:.2f} mm (median), between the fronts at half "
            "of the step of the acceleration; the tread's bend at the edges is in it"
        )
    return PassageRows(columns, (said,), channel, passages)


#: columns of lengths that only a strain's derivatives have
_OF_STRAIN = (
    "length_form_se_m", "length_d2_m", "length_d2_se_m", "length_d1_m", "length_d1_se_m",
)  # fmt: skip


def lengths(channel: Channel, passages: Passages) -> tuple[FloatArray, QualityFlags]:
    """Length and its error [m], entry and exit time [s], asymmetry of every passage, (5, n); flags.

    NaN if unknown; the flags say why. Of the slopes' sizes at the fronts the asymmetry is (exit -
    entry) / (exit + entry).
    """
    n = len(passages)
    result, (short, lost) = np.full((5, n), np.nan), np.zeros((2, n), bool)
    form = None if passages.doubt else _mean_form(channel, passages)
    rows = np.flatnonzero(np.isfinite(passages.omega_rad_s)).tolist()
    for row in rows if form is not None else ():
        assert form is not None
        turned, values = _samples(channel, passages, row)
        lost[row] = not (values.size and np.isfinite(values).all())
        if not values.size:
            continue
        fronts, short[row] = _fronts(turned, values, form)
        if not np.isfinite(fronts).all():
            continue
        places, errors, slopes = fronts.T
        omega, alpha = passages.omega_rad_s[row], np.nan_to_num(passages.alpha_rad_s2[row])
        # angle over the speed at the centre, to second order in the acceleration
        after = places / omega - 0.5 * alpha * (places / omega) ** 2 / omega
        width = places[1] - places[0]
        of_speed = width * float(np.nan_to_num(passages.omega_se_rad_s[row] / omega))
        result[:, row] = (
            passages.radius_m * width,
            passages.radius_m * float(np.linalg.norm([*errors, of_speed])),
            *(passages.time_s[row] + after),
            (slopes[1] - slopes[0]) / (slopes[1] + slopes[0]),
        )
    untold = np.isnan(result[0])
    flags = speed_quality(passages) | marked(short, Quality.PATCH_SHORT)
    flags |= marked(lost & untold, Quality.LOST_PEAK)
    return result, flags | marked(untold & good(flags), Quality.NO_LENGTH)


def _samples(channel: Channel, passages: Passages, row: int) -> tuple[FloatArray, FloatArray]:
    """(angles from the patch centre [rad], values with the patch upward) of one passage, (k,) each.

    None at all if the log begins or ends within them.
    """
    omega = passages.omega_rad_s[row]
    reach = (_MOST_HALF + _FAR[1]) / omega
    ends = channel.axis.index(passages.time_s[row] + np.array([-reach, reach]))
    start, stop = int(np.ceil(ends[0])), int(np.floor(ends[1])) + 1
    if start < 0 or stop > channel.size or stop - start < _CUBIC:
        return np.zeros(0), np.zeros(0)
    since = channel.axis.time(start, stop) - passages.time_s[row]
    turned = omega * since + 0.5 * np.nan_to_num(passages.alpha_rad_s2[row]) * since**2
    return turned, passages.sign * channel.read(start, stop)


def _levels(turned: FloatArray, values: FloatArray, fronts: FloatArray) -> tuple[float, float]:
    """(level inside, level outside) of a passage; NaN if too few samples are inside."""
    middle, half = fronts.mean(), 0.5 * (fronts[1] - fronts[0])
    inside = values[np.abs(turned - middle) < _INSIDE * half]
    away = np.abs(turned - middle) - half
    beside = (away > _FAR[0]) & (away < _FAR[1]) & np.isfinite(values)
    sides = [values[beside & (turned < 0.0)], values[beside & (turned > 0.0)]]
    # samples between the fronts below which no level inside can be read; twice as many leave fast
    # passages of slow loggers without fronts
    if np.isfinite(inside).sum() < 4 or not all(side.size for side in sides):
        return np.nan, np.nan
    return float(np.nanmedian(inside)), float(np.mean([side.mean() for side in sides]))


def _mean_form(channel: Channel, passages: Passages) -> tuple[FloatArray, FloatArray] | None:
    """(fronts [rad], slopes there [1/rad]) of the form that most passages have, entry and exit.

    It goes from 0 outside to 1 inside, so that the entry's slope is positive. None if it has no two
    fronts.
    """
    known = np.isfinite(passages.omega_rad_s)
    clean = known & good(passages.quality)
    rows = np.flatnonzero(clean if clean.any() else known)
    # passages that the mean form is learnt from, over the log, and its grid [rad]
    places = np.linspace(0, rows.size - 1, min(200, rows.size))
    forms = []
    for row in rows[places.round().astype(int)].tolist():
        turned, values = _samples(channel, passages, row)
        inside, outside = _levels(turned, values, np.radians([-4.0, 4.0]))
        if inside > outside:
            whole = np.isfinite(values)
            scaled = (values[whole] - outside) / (inside - outside)
            forms.append(np.interp(_FORM, turned[whole], scaled))
    if not forms:
        return None
    form, middle = np.median(forms, axis=0), _FORM.size // 2
    above = form > 0.5
    left = middle - int(np.argmin(above[middle::-1]))
    right = middle + int(np.argmin(above[middle:]))
    steps = [left, left + 1], [right, right - 1]
    fronts = np.array([np.interp(0.5, form[step], _FORM[step]) for step in steps])
    outwards = fronts * [-1.0, 1.0]
    if not (above[middle] and ((outwards > _LEAST_HALF) & (outwards < _MOST_HALF)).all()):
        return None
    return fronts, np.gradient(form, _FORM)[[left, right]]


def _fronts(
    turned: FloatArray, values: FloatArray, form: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, bool]:
    """(place [rad], its standard error, size of the slope) of both fronts, (2, 3); too few samples.

    NaN if they are not crossed, or too few samples are between or beside them. `form`: fronts and
    slopes of the mean form.
    """
    found, fronts = np.full((2, 3), np.nan), form[0]
    inside, outside = _levels(turned, values, fronts)
    if not inside > outside:
        return found, bool(np.isnan(inside))
    scaled = (values - outside) / (inside - outside) - 0.5
    for side, (front, slope) in enumerate(zip(*form, strict=True)):
        # half width of the flank that a cubic is laid through: share of the step over its slope.
        # The cubic follows a flank of this width to a hundredth of the step; twice as wide it meets
        # the lobe
        half, place = 0.6 / abs(slope), _first_below(turned, scaled, fronts.mean(), front)
        if np.isnan(place):
            break
        near = np.flatnonzero((np.abs(turned - place) < half) & np.isfinite(scaled))
        if near.size < _LINE:
            return found, True
        found[side] = _crossing(turned[near] - place, scaled[near], np.sign(slope), half)
        found[side, 0] += place
        if np.isnan(found[side, 0]):
            break
    return found, False


def _first_below(turned: FloatArray, scaled: FloatArray, middle: float, front: float) -> float:
    """Where a passage first leaves the level inside for good, from the middle outwards [rad].

    Two samples in a row below the half: one may be noise. NaN if it does not by twice as far as
    the mean form's front, or samples are lost on the way.
    """
    far, reach = np.sign(front - middle) * (turned - middle), abs(front - middle)
    way = np.flatnonzero((far > _INSIDE * reach) & (far < 2.0 * reach))
    way = way[np.argsort(far[way])]
    below = scaled[way] < 0.0
    first = np.flatnonzero(below[:-1] & below[1:])
    if not first.size or not np.isfinite(scaled[way[: first[0] + 1]]).all():
        return np.nan
    beside = way[[first[0], max(first[0] - 1, 0)]]
    return float(np.interp(0.0, scaled[beside], turned[beside]))


def _crossing(
    x: FloatArray, y: FloatArray, rises: float, half: float
) -> tuple[float, float, float]:
    """(zero, its standard error, size of the slope) of a flank y at x, which rises or falls.

    NaN if it does not.
    """
    degree = 3 if x.size >= _CUBIC else 1
    powers = np.vander(x / half, degree + 1)
    numbers = np.linalg.lstsq(powers, y, rcond=None)[0]
    roots, slopes = np.roots(numbers), np.polyder(numbers)
    real = np.real(roots[(np.abs(roots.imag) < 1e-9) & (np.abs(roots.real) <= 1.0)])
    real = real[np.polyval(slopes, real) * rises > 0]
    if not real.size:
        return np.nan, np.nan, np.nan
    zero = float(real[np.argmin(np.abs(real))])
    slope, left = abs(float(np.polyval(slopes, zero))), y - powers @ numbers
    there = np.vander([zero], degree + 1)[0]
    share = max(float(there @ np.linalg.pinv(powers.T @ powers) @ there), 0.0)
    scatter = np.sqrt(float(left @ left) / max(x.size - degree - 1, 1) * share)
    return zero * half, half * float(scatter) / slope, slope / half
