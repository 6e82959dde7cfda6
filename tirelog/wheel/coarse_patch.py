"""Where an in-tire accelerometer passes the patch, coarsely.

And the centripetal level beside each passage.

    channel, WheelAngle --means over one degree of wheel angle--> bins (m,)
        --below half of the level--> dips
        --degrees beside each dip--> DIPS: coarse fronts, level and its slope, what gravity does to
                                     them, noise of a sample

The acceleration is Omega^2 (w'' + w - R), outward positive (errata): a level -Omega^2 R all around,
and nothing in the patch: there the tread is straight. Divided by Omega^2 of its bin the level is
the same at every speed, so half of it marks the patch without a threshold in m/s^2. A recorded
signal may have either sign; the level tells.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from tirelog.data.recording import Channel
from tirelog.dsp.filters import runs, sliding_mean
from tirelog.dsp.pitch import AngleFunction
from tirelog.vocabulary.arrays import FloatArray, IntArray, Records, records
from tirelog.wheel.angle import WheelAngle

#: radians of a degree
DEGREE = np.pi / 180
#: samples read at once (1 MB)
PIECE = 1 << 17
#: bins worked on at once, and their overlap: a turn and a half
CORE, OVERLAP = 360 * 128, 540
#: the level is taken from this range beside each front [deg]; half of the first lies in the lobes
#: of the front, twice the second reaches beyond the top of the wheel
BESIDE = (25, 130)
#: slower than this the level drowns in gravity [rad/s]: on a car's wheel it is 1.1 g there, and a
#: quarter of that at half; doubled, nothing below 3.6 m/s is seen
SLOWEST_rad_s = 6.0


#: a dip: coarse fronts; mean of a / Omega^2 beside it [m], with the sensor's sign, and its slope
#: [m/rad]; what a unit of cos(phi) adds to both; standard error of the level per noise; noise of a
#: sample (its variance with correlation counted in); sums for the gravity in the level
DIPS = np.dtype(
    [("entry_rad", "f8"), ("exit_rad", "f8"), ("level", "f8"), ("tilt", "f8"),
     ("gravity_level", "f8"), ("gravity_tilt", "f8"), ("level_share", "f8"),
     ("noise_m_s2", "f8"), ("normal", "f8", (3, 4))]
)  # fmt: skip


#: a bin of one degree: its number [deg]; mean [m/s^2], NaN if empty; samples; sum of their squared
#: deviations; mean time
BIN = np.dtype(
    [("degree", "i8"), ("mean", "f8"), ("count", "f8"), ("squares", "f8"), ("time_s", "f8")]
)


def binned(channel: Channel, angle: AngleFunction) -> Iterator[Records]:
    """The channel in degrees of wheel angle, in pieces of CORE bins, (m,) of BIN.

    They overlap their neighbours by OVERLAP on both sides.
    """
    first, highest = 0, -np.inf
    held: FloatArray = np.zeros((4, 0))
    offset = 0.0
    for start, values in channel.blocks(PIECE):
        time = channel.axis.time(start, start + values.size)
        theta = angle.coarse(time) / DEGREE
        climbing = np.fmax.accumulate(np.append(highest, theta))[1:]
        highest = float(climbing[-1])
        kept = np.isfinite(values) & (theta > climbing - 0.5)
        values, time, k = values[kept], time[kept], np.floor(theta[kept]).astype(np.int64)
        if k.size == 0:
            continue
        if held.shape[1] == 0:
            first, offset = int(k[0]), float(values[0])
        k = np.maximum(k - first, 0)
        size = max(int(k.max()) + 1, held.shape[1])
        x = values - offset  # small numbers keep the digits of the squares
        sums = np.stack([np.bincount(k, w, size) for w in (None, x, x * x, time)]).astype(
            np.float64
        )
        sums[:, : held.shape[1]] += held
        held = sums
        while held.shape[1] > CORE + 2 * OVERLAP:
            yield _bins(first, held[:, : CORE + 2 * OVERLAP], offset)
            first, held = first + CORE, held[:, CORE:]
    if held.shape[1]:
        yield _bins(first, held, offset)


def _bins(first: int, sums: FloatArray, offset: float) -> Records:
    """The bins (m,) of BIN from `first` on: their samples, sums, squares and times (4, m)."""
    count = sums[0]
    mean, squares, time = sums[1:] / np.where(count > 0, count, np.nan)
    return records(
        BIN,
        degree=first + np.arange(count.size),
        mean=mean + offset,
        count=count,
        squares=np.maximum(squares - mean**2, 0.0) * count,
        time_s=time,
    )


def find_dips(pieces: Iterable[Records]) -> Records:
    """All dips of a log in order, (n,) of DIPS."""
    found, last = [np.zeros(0, DIPS)], -np.inf
    for number, piece in enumerate(pieces):
        dips = _dips(piece, begins=number == 0)
        found.append(dips[dips["entry_rad"] > last + 5 * DEGREE])
        last = float(found[-1]["entry_rad"].max(initial=last))
    return np.concatenate(found)


def _dips(bins: Records, begins: bool) -> Records:
    """The dips of one piece whose surroundings are in it (but for the log's ends).

    `begins`: the piece is the log's first.
    """
    m, none = bins.size, np.zeros(0, DIPS)
    known = np.flatnonzero(bins["count"] > 0)
    if m < 90 or known.size < 45:
        return none
    at = np.arange(m)
    mean, time = (np.interp(at, known, bins[name][known]) for name in ("mean", "time_s"))
    lost = sliding_mean((bins["count"] == 0).astype(float), 9) > 0.7
    ahead, behind = np.minimum(at + 12, m - 1), np.maximum(at - 12, 0)
    rate = (ahead - behind) * DEGREE / np.maximum(time[ahead] - time[behind], 1e-9)
    fast = (rate > SLOWEST_rad_s) & ~lost
    specific = mean / rate**2
    usual = float(np.median(specific[fast])) if fast.any() else 0.0
    if usual == 0.0:
        return none
    q = sliding_mean(specific / usual, 3)
    starts, stops = _bridged_runs((q < 0.5) & fast)
    entry = starts - (0.5 - q[starts]) / np.maximum(q[np.maximum(starts - 1, 0)] - q[starts], 1e-3)
    leave = (
        stops
        - 1
        + (0.5 - q[stops - 1]) / np.maximum(q[np.minimum(stops, m - 1)] - q[stops - 1], 1e-3)
    )
    entry, leave = np.maximum(entry, starts - 1), np.minimum(leave, stops)
    width = leave - entry
    inner = np.stack([entry + 0.25 * width, leave - 0.25 * width], axis=1).astype(int)
    deep = np.array([q[a : b + 1].mean() < 0.4 for a, b in inner], bool)
    # a dip that is shorter or longer than this is no patch [deg]; half of it is 1 cm on a car's
    # wheel, twice of it most of the lower half
    good = (width > 4) & (width < 70) & deep & (starts > 1) & (stops < m - 1)
    # the last overlap is the next piece's first
    good &= (entry >= OVERLAP / 2) | begins
    return _levels(bins, mean, rate, lost, entry[good], leave[good])


def _bridged_runs(mask: np.ndarray) -> tuple[IntArray, IntArray]:
    """[start, stop) of the runs of `mask`, with holes of up to two closed."""
    starts, stops = runs(mask)
    apart = starts[1:] - stops[:-1] > 2
    return starts[np.insert(apart, 0, True)[: starts.size]], stops[
        np.append(apart, True)[: stops.size]
    ]


def _levels(
    bins: Records,
    mean: FloatArray,
    rate: FloatArray,
    lost: np.ndarray,
    entry: FloatArray,
    leave: FloatArray,
) -> Records:
    """The dips with the level beside each.

    A straight line through a / Omega^2 on both sides, and the same for cos(phi) / Omega^2.
    """
    beside = np.arange(*BESIDE)
    middle = 0.5 * (entry + leave)
    at = np.concatenate(
        [
            np.rint(entry).astype(int)[:, None] - beside,
            np.rint(leave).astype(int)[:, None] + beside,
        ],
        axis=1,
    )
    inside = (at >= 0) & (at < mean.size)
    at = np.clip(at, 0, mean.size - 1)
    weight = np.where(inside & ~lost[at], bins["count"][at], 0.0)
    phi = (at - middle[:, None]) * DEGREE
    square = rate[at] ** 2
    powers, wanted = np.stack([np.ones(at.shape), phi]), np.stack([mean[at], np.cos(phi)]) / square
    left = np.einsum("ikm,jkm->kij", powers * weight, powers) + 1e-12 * np.eye(2)
    lines = np.linalg.solve(left, np.einsum("ikm,jkm->kij", powers * weight, wanted))
    within = np.sum(np.where(weight > 1, bins["squares"][at], 0.0), axis=1) / np.maximum(
        np.sum(np.maximum(weight - 1, 0), axis=1), 1.0
    )
    bend = mean[at] - 0.5 * (mean[np.maximum(at - 1, 0)] + mean[np.minimum(at + 1, mean.size - 1)])
    between = np.sum(weight * bend**2, axis=1) / np.maximum(np.sum(weight > 0, axis=1), 1) / 1.5
    design = np.stack([square, square * np.cos(phi), np.cos(phi)], axis=-1)
    target = np.concatenate([design, mean[at][..., None]], axis=-1)
    normal = np.einsum("ij,ijk,ijl->ikl", weight, design, target)
    scale = bins["degree"][0] * DEGREE
    dips = records(
        DIPS,
        entry_rad=(entry + 0.5) * DEGREE + scale,
        exit_rad=(leave + 0.5) * DEGREE + scale,
        level=lines[:, 0, 0],
        tilt=lines[:, 1, 0],
        gravity_level=lines[:, 0, 1],
        gravity_tilt=lines[:, 1, 1],
        level_share=np.sqrt(np.linalg.inv(left)[:, 0, 0]),
        noise_m_s2=np.sqrt(np.maximum(within, between)),
    )
    dips["normal"] = normal
    return dips


# ---- The samples around the fronts of a log, cleared of what is not the patch.
#
# Read in pieces, divided by the level, gravity taken off.
#
# Dips, WheelAngle --level, tilt, speed, acceleration at each passage--> flanks (entries, then
# exits)
# flanks, half widths --pieces of the channel, a / level - gravity--> owner (s,), angle from the
#                                                     front (s,) [rad], level left (s,)


#: a front of a passage; n passages have (2 n,), entries first: `angle` at which it is
#: thought to be, `middle` of the patch, `level`, `tilt` of a / Omega^2 outside with gravity's part
#: taken off, `noise` [m/s^2] of a sample, `level_share` standard error of the level for a noise of
#: one, `gravity` [m/s^2] in the signal, `ahead` the vehicle's acceleration, `rate` of the wheel,
#: `angle_noise` [rad] of its angle
FLANK = np.dtype(
    [("angle", "f8"), ("middle", "f8"), ("level", "f8"), ("tilt", "f8"), ("noise", "f8"),
     ("level_share", "f8"), ("gravity", "f8"), ("ahead", "f8"), ("rate", "f8"),
     ("angle_noise", "f8")]
)  # fmt: skip


def flanks_of(dips: Records, wheel: WheelAngle, radius_m: float, gravity: float) -> Records:
    """Both fronts of the `dips` (n,), (2 n,) of FLANK."""
    middle = 0.5 * (dips["entry_rad"] + dips["exit_rad"])
    time, span = wheel.angle.time_at(middle), 0.1
    change = wheel.speed_rad_s(time + span / 2) - wheel.speed_rad_s(time - span / 2)
    passages = records(
        FLANK,
        middle=middle,
        level=dips["level"] - gravity * dips["gravity_level"],
        tilt=dips["tilt"] - gravity * dips["gravity_tilt"],
        noise=float(np.median(dips["noise_m_s2"])),
        level_share=dips["level_share"],
        gravity=gravity,
        ahead=np.nan_to_num(radius_m * change / span),
        rate=wheel.speed_rad_s(time),
        angle_noise=wheel.angle.noise_at(time),
    )
    flanks = np.tile(passages, 2)
    flanks["angle"] = np.concatenate([dips["entry_rad"], dips["exit_rad"]])
    return flanks


def moved(flanks: Records, angle: FloatArray) -> Records:
    """The `flanks` at other angles (n,), where these are known and near."""
    result = flanks.copy()
    near = np.isfinite(angle) & (np.abs(angle - flanks["angle"]) < 3 * DEGREE)
    result["angle"] = np.where(near, angle, flanks["angle"])
    return result


def ranges(
    channel: Channel, wheel: WheelAngle, flanks: Records, windows: FloatArray
) -> tuple[IntArray, IntArray]:
    """First and last-but-one sample index of each front's window."""
    order = np.argsort(flanks["angle"])
    first, last = np.zeros(order.size, np.int64), np.zeros(order.size, np.int64)
    for bound, shift in ((first, -1.0), (last, 1.0)):
        time = wheel.angle.time_at(flanks["angle"][order] + shift * windows[order])
        bound[order] = np.ceil(channel.axis.index(np.nan_to_num(time, nan=-1.0)))
    first = np.clip(first, 0, channel.size)
    return first, np.clip(last, first, channel.size)


def samples(
    channel: Channel, wheel: WheelAngle, flanks: Records, first: IntArray, last: IntArray
) -> Iterator[tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray]]:
    """(rows, owner, angle from its front [rad], signal in levels outside, as recorded), by pieces.

    Of the samples [first, last) of each of the `flanks` (n,), (s,) each; owners count in the
    `rows`. Rows whose samples are strewn over more than a few pieces are left out.
    """
    order, at = np.argsort(first, kind="stable"), 0
    while at < order.size:
        start = int(first[order[at]])
        rows = order[at : at + max(int(np.searchsorted(first[order[at:]], start + PIECE)), 1)]
        at += rows.size
        rows = rows[last[rows] - start <= 4 * PIECE]
        sizes = last[rows] - first[rows]
        if not sizes.any():
            continue
        owner = np.repeat(np.arange(rows.size), sizes)
        index = np.arange(owner.size) + (first[rows] - np.cumsum(sizes) + sizes)[owner]
        values = channel.read(start, int(last[rows].max()))[index - start]
        theta = wheel.angle.at(channel.axis.at(index.astype(np.float64)))
        own = flanks[rows[owner]]
        phi, gravity = theta - own["middle"], own["gravity"]
        a = values - gravity * np.cos(phi) - np.sign(gravity) * own["ahead"] * np.sin(phi)
        level = own["level"] + own["tilt"] * phi
        yield rows, owner, theta - own["angle"], a / (own["rate"] ** 2 * level), values
