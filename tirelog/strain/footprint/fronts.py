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
from tirelog.strain.speed import PassageRows, begin, speed_quality
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import ACCELERATION_KINDS
from tirelog.vocabulary.quality import Quality, QualityFlags, good, marked, quality_column

#: where the level outside is read, beyond the fronts [rad], as with an encoder
#: (`wheel.coarse_patch`): past the lobes; gravity's part is a twelfth of g in the mean over it
_FAR = np.radians([25.0, 130.0])
#: share of the patch, about its middle, in which the level inside is read: beyond it a short patch
#: bends already; doubled, lengths of 70 mm come out 1 % longer
_INSIDE = 0.35
#: half width of the flank that a cubic is laid through: share of the step over its slope.  The
#: cubic follows a flank of this width to a hundredth of the step; twice as wide it meets the lobe
_FLANK = 0.6
#: samples that a cubic needs beside its four numbers; fewer get a line, of which two are enough
_CUBIC, _LINE = 8, 3
#: passages that the mean form is learnt from, over the log, and its grid [rad]
_LEARNT = 200
_FORM = np.radians(np.arange(-60.0, 60.01, 0.25))
#: half widths of a patch that a tire has [rad]; outside of these nothing is a front
_LEAST_HALF, _MOST_HALF = np.radians([2.0, 45.0])
#: samples between the fronts below which no level inside can be read; twice as many leave fast
#: passages of slow loggers without fronts
_FEWEST_INSIDE = 4


#: columns of the table that an accelerometer's fronts tell
_TOLD = ("length_m", "length_se_m", "entry_time_s", "exit_time_s", "edge_asymmetry")


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
    columns = begin(recording.log, passages) | {
        **dict(zip(_TOLD[:2], told, strict=False)),
        **dict.fromkeys(_OF_STRAIN, nothing),
        **dict(zip(_TOLD[2:], told[2:], strict=True)),
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
    """The columns _TOLD (5, n) of every passage of an accelerometer, NaN if not told; flags why.

    Of the slopes' sizes at the fronts the asymmetry is (exit - entry) / (exit + entry).
    """
    n = len(passages)
    result = np.full((5, n), np.nan)
    flags = speed_quality(passages)
    form = None if passages.doubt else _mean_form(channel, passages)
    short = np.zeros(n, bool)
    lost = np.zeros(n, bool)
    for i in np.flatnonzero(np.isfinite(passages.omega_rad_s)) if form is not None else ():
        assert form is not None
        read = _samples(channel, passages, int(i))
        told = None if read is None else _one_length(*read, *form)
        if read is None or not np.isfinite(read[1]).all():
            lost[i] = True
        if isinstance(told, str):
            short[i] = True
        elif told is not None:
            (entry, exit_), errors, sharper = told
            omega = passages.omega_rad_s[i]
            alpha = np.nan_to_num(passages.alpha_rad_s2[i])
            turned = np.array([entry, exit_])
            # angle over the speed at the centre, to second order in the acceleration
            after = turned / omega - 0.5 * alpha * (turned / omega) ** 2 / omega
            width = exit_ - entry
            of_speed = width * float(np.nan_to_num(passages.omega_se_rad_s[i] / omega))
            result[:, i] = (
                passages.radius_m * width,
                passages.radius_m * float(np.linalg.norm([*errors, of_speed])),
                *(passages.time_s[i] + after),
                sharper,
            )
    untold = ~np.isfinite(result[0])
    flags = flags | marked(short, Quality.PATCH_SHORT) | marked(lost & untold, Quality.LOST_PEAK)
    flags = flags | marked(untold & good(flags), Quality.NO_LENGTH)
    return result, flags


def _samples(
    channel: Channel, passages: Passages, row: int
) -> tuple[FloatArray, FloatArray] | None:
    """(angles from the patch centre [rad], values with the patch upward) of one passage, (k,) each.

    None if the log begins or ends within them.
    """
    omega = passages.omega_rad_s[row]
    reach = (_MOST_HALF + _FAR[1]) / omega
    ends = channel.axis.index(passages.time_s[row] + np.array([-reach, reach]))
    start, stop = int(np.ceil(ends[0])), int(np.floor(ends[1])) + 1
    if start < 0 or stop > channel.size or stop - start < _CUBIC:
        return None
    since = channel.axis.time(start, stop) - passages.time_s[row]
    turned = omega * since + 0.5 * np.nan_to_num(passages.alpha_rad_s2[row]) * since**2
    return turned, passages.sign * channel.read(start, stop)


def _levels(
    turned: FloatArray, values: FloatArray, fronts: FloatArray
) -> tuple[float, float] | None:
    """(level inside, level outside) of a passage; None if too few samples are inside."""
    middle, half = fronts.mean(), 0.5 * (fronts[1] - fronts[0])
    inside = values[np.abs(turned - middle) < _INSIDE * half]
    away = np.abs(turned - middle) - half
    beside = (away > _FAR[0]) & (away < _FAR[1])
    sides = [values[beside & (turned < 0.0)], values[beside & (turned > 0.0)]]
    sides = [side[np.isfinite(side)] for side in sides]
    if np.isfinite(inside).sum() < _FEWEST_INSIDE or not all(side.size for side in sides):
        return None
    return float(np.nanmedian(inside)), float(np.mean([side.mean() for side in sides]))


def _mean_form(channel: Channel, passages: Passages) -> tuple[FloatArray, FloatArray] | None:
    """(fronts [rad], slopes there [1/rad]) of the form that most passages have, entry and exit.

    It goes from 0 outside to 1 inside, so that the entry's slope is positive. None if it has no two
    fronts.
    """
    known = np.flatnonzero(np.isfinite(passages.omega_rad_s) & good(passages.quality))
    if not known.size:
        known = np.flatnonzero(np.isfinite(passages.omega_rad_s))
    places = np.linspace(0, known.size - 1, min(_LEARNT, known.size))
    chosen = known[places.round().astype(int)]
    rough = np.radians([-4.0, 4.0])
    forms = []
    for row in chosen:
        read = _samples(channel, passages, int(row))
        level = None if read is None else _levels(*read, rough)
        if read is not None and level is not None and level[0] > level[1]:
            whole = np.isfinite(read[1])
            scaled = (read[1][whole] - level[1]) / (level[0] - level[1])
            forms.append(np.interp(_FORM, read[0][whole], scaled))
    if not forms:
        return None
    form = np.median(forms, axis=0)
    middle = _FORM.size // 2
    inside = form > 0.5
    if not inside[middle]:
        return None
    left = middle - int(np.argmin(inside[middle::-1]))
    right = middle + int(np.argmin(inside[middle:]))
    fronts = np.array([_between(form, left, left + 1), _between(form, right - 1, right)])
    slopes = np.gradient(form, _FORM)[[left, right]]
    if not (_LEAST_HALF < -fronts[0] < _MOST_HALF and _LEAST_HALF < fronts[1] < _MOST_HALF):
        return None
    return fronts, slopes


def _between(form: FloatArray, low: int, high: int) -> float:
    """Where the form crosses a half between two points of its grid [rad]."""
    share = (0.5 - form[low]) / (form[high] - form[low])
    return float(_FORM[low] + share * (_FORM[high] - _FORM[low]))


def _one_length(
    turned: FloatArray, values: FloatArray, fronts: FloatArray, slopes_there: FloatArray
) -> tuple[list[float], list[float], float] | str | None:
    """(fronts [rad], their standard errors, which is sharper) of a passage.

    A text if too few samples are between or beside them, None if they are not crossed.
    """
    level = _levels(turned, values, fronts)
    if level is None:
        return "too few samples inside"
    step = level[0] - level[1]
    if step <= 0.0:
        return None
    scaled = (values - level[1]) / step - 0.5
    middle = fronts.mean()
    places, errors, slopes = [], [], []
    for front, slope in zip(fronts, slopes_there, strict=True):
        half = _FLANK / abs(slope)
        guess = _first_below(turned, scaled, middle, front)
        if guess is None:
            return None
        front = guess
        near = np.flatnonzero((np.abs(turned - front) < half) & np.isfinite(scaled))
        if near.size < _LINE:
            return "too few samples at a front"
        crossed = _crossing(turned[near] - front, scaled[near], np.sign(slope), half)
        if crossed is None:
            return None
        places.append(front + crossed[0])
        errors.append(crossed[1])
        slopes.append(abs(crossed[2]))
    return places, errors, (slopes[1] - slopes[0]) / (slopes[1] + slopes[0])


def _first_below(
    turned: FloatArray, scaled: FloatArray, middle: float, front: float
) -> float | None:
    """Where a passage first leaves the level inside for good, from the middle outwards [rad].

    Two samples in a row below the half: one may be noise. None if it does not by twice as far as
    the mean form's front, or samples are lost on the way.
    """
    outwards = np.sign(front - middle)
    far = outwards * (turned - middle)
    way = np.flatnonzero((far > _INSIDE * abs(front - middle)) & (far < 2.0 * abs(front - middle)))
    way = way[np.argsort(far[way])]
    below = scaled[way] < 0.0
    first = np.flatnonzero(below[:-1] & below[1:])
    if not first.size or not np.isfinite(scaled[way[: first[0] + 1]]).all():
        return None
    at = way[first[0]]
    before = way[first[0] - 1] if first[0] else at
    if at == before:
        return float(turned[at])
    share = scaled[before] / (scaled[before] - scaled[at])
    return float(turned[before] + np.clip(share, 0.0, 1.0) * (turned[at] - turned[before]))


def _crossing(
    x: FloatArray, y: FloatArray, rises: float, half: float
) -> tuple[float, float, float] | None:
    """(zero, its standard error, slope there) of a flank y at x, which rises or falls."""
    degree = 3 if x.size >= _CUBIC else 1
    powers = np.vander(x / half, degree + 1)
    numbers, *_ = np.linalg.lstsq(powers, y, rcond=None)
    roots = np.roots(numbers)
    slope_at = np.polyder(numbers)
    real = [
        float(root.real)
        for root in roots
        if abs(root.imag) < 1e-9
        and abs(root.real) <= 1.0
        and np.polyval(slope_at, root.real) * rises > 0
    ]
    if not real:
        return None
    zero = min(real, key=abs)
    slope = float(np.polyval(slope_at, zero))
    left = y - powers @ numbers
    freedom = max(x.size - degree - 1, 1)
    spread = np.vander([zero], degree + 1)[0] @ np.linalg.pinv(powers.T @ powers)
    variance = float(left @ left) / freedom * float(spread @ np.vander([zero], degree + 1)[0])
    return zero * half, half * float(np.sqrt(max(variance, 0.0))) / abs(slope), slope / half
