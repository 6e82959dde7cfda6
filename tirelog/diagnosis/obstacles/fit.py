"""When a hit happened, and what the model says of it.

Four nuisance numbers per hit, found by least squares.

    TransientLog, Model, rough time
        --one motion of the model--> readings over (time of the hit, phase of the sensor)
        --least squares--> Hit

Nuisances: where the model's patch centre lies among the passages, from the steady revolutions
around (`alignment`); the time at which the wheel's centre stood over the obstacle's beginning and a
shift of the wheel's angle, fitted to what the obstacle added as measured, D = y - T(phi), so that a
misfit of the model's steady waveform does not move them; and the level. Speed and load are those of
the revolutions around it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.optimize import least_squares, minimize_scalar

from tirelog.data.recording import Conditions
from tirelog.inference.obstacle_log import DISTURBED, WINDOW_S, TransientLog
from tirelog.inference.stacks.align import split_turns
from tirelog.physics.model.model import Model
from tirelog.physics.moving.road import road_of
from tirelog.physics.moving.transient import (
    Course,
    Schedule,
    Transient,
    driven,
    free_rolling_radius,
)
from tirelog.vocabulary.arrays import FloatArray

#: Nuisance numbers of a hit.
NUISANCES = 4
#: The patch centre of the model is sought this far [rad] from the passages, and compared at so
#: many angles. Twice as far reaches shapes that lie on the wrong side of the patch.
_ALIGNED_RAD, _ALIGNED_AT = 0.15, 1024
#: Distance [m] driven on a level road before the obstacle. Half a turn of a car's wheel, for what
#: the start leaves to die away; twice as much drives that metre more.
_RUN_UP_M = 1.0
#: Its time is sought first among signals smoothed over _SMOOTH_S [s], on a grid, so far [turns]
#: from the rough time; then beside the best few on a fine grid and unsmoothed. Twice as coarse a
#: grid needs signals smoothed as much more; twice as many of the best take twice as long.
_SMOOTH_S, _GRID_S, _FINE_S, _BEST = 4e-3, 1e-3, 1e-4, 3
#: Angle [rad] from the patch centre within which the steady waveform is steep. Twice as much
#: leaves an eighth less of the turn to find a hit's time by.
_STEEP_RAD = 0.4
#: Turns before and after the rough time between which the hit is sought. Twice as far takes in the
#: passages before and after the one that was hit.
_BEFORE, _AFTER = 1.25, 0.5
#: Largest phase [rad] of a hit, either way. Twice as much lets a hit that the model does not
#: describe be turned as far until it seems to.
_PHASE_RAD = 0.2


@dataclass(frozen=True)
class Hit:
    """One passage over the obstacle, its samples in the window after it, (m,).

    since_s  time since the hit; measured, predicted (steady + added + level); added: what the
             obstacle added as measured, missed: what
    of it the model's does not cover
    """

    time_s: float
    time_se_s: float
    alignment_rad: float
    phase_rad: float
    level: float
    speed_m_s: float
    since_s: FloatArray
    measured: FloatArray
    predicted: FloatArray
    added: FloatArray
    missed: FloatArray
    remarks: tuple[str, ...]


def motion_at(
    log: TransientLog, model: Model, rough_s: float, window_s: float
) -> tuple[Transient, float]:
    """(the model's motion over the obstacle, the time in it at which the hit happens).

    At the speed and load around `rough_s`.
    """
    turn = 2.0 * np.pi / log.spin_rad_s
    around = np.linspace(rough_s - 2.0 * turn, rough_s + window_s, 64)
    around = around[(around >= log.time_s[0]) & (around <= log.time_s[-1])]
    slope, spin = np.polyfit(around - rough_s, log.wheel.speed_rad_s(around), 1)
    nearest = int(np.argmin(np.abs(log.conditions.time_s - (rough_s - 1.5 * turn))))
    conditions = log.conditions.take(slice(nearest, nearest + 1))
    load = float(conditions.load_N[0]) if conditions.known("load_N") else model.values["load_N"]
    # the axle's speed at which the model's wheel turns as the log's does
    radius = free_rolling_radius(
        model, replace(conditions, speed_m_s=np.array([log.radius_m * spin]))
    )
    run_up = _RUN_UP_M / (radius * spin)
    length = run_up + window_s + 0.02
    speeds = tuple(float(radius * (spin + slope * t)) for t in (-run_up, length - run_up))
    speed = (
        Schedule((0.0, length), speeds)
        if abs(slope) > 1e-2 * spin
        else Schedule.constant(float(radius * spin))
    )
    folder = Path(log.folder).parent if log.folder else None
    road = road_of(replace(log.road, spacing_m=None), _driven(speed, run_up), folder=folder)
    return driven(model, conditions, Course(speed, Schedule.constant(load), road, length)), run_up


def _driven(speed: Schedule, time_s: float) -> float:
    """Distance [m] after `time_s` of a straight schedule."""
    return 0.5 * (speed(0.0) + speed(time_s)) * time_s


def fit_hit(log: TransientLog, model: Model, rough_s: float, window_s: float = WINDOW_S) -> Hit:
    """The hit near `rough_s`, its nuisances fitted.

    The window ends after `window_s` or with the log.
    """
    window_s = min(window_s, log.time_s[-1] - rough_s)
    transient, reached = motion_at(log, model, rough_s, window_s)
    return _fitted(log, transient, reached, rough_s, window_s)


def view_of(
    log: TransientLog, transient: Transient, reached: float, rough_s: float, window_s: float
) -> View:
    """The samples from before to after the hit beside the motion."""
    early = rough_s - _BEFORE * 2.0 * np.pi / log.spin_rad_s
    rows = (log.time_s >= early) & (log.time_s <= rough_s + window_s)
    return View(
        log, transient, reached, rows, alignment(log, transient.model, transient.conditions)
    )


def _fitted(
    log: TransientLog, transient: Transient, reached: float, rough_s: float, window_s: float
) -> Hit:
    turn = 2.0 * np.pi / log.spin_rad_s
    view = view_of(log, transient, reached, rough_s, window_s)
    times = np.arange(rough_s - _BEFORE * turn, rough_s + _AFTER * turn, _GRID_S)
    best = _sought(view, times, max(round(_SMOOTH_S * log.rate_Hz), 1))

    def left_at(x: FloatArray) -> FloatArray:
        return view.left(best + 1e-3 * float(x[0]), float(x[1]))

    bounds = ([-1.0, -_PHASE_RAD], [1.0, _PHASE_RAD])
    found = least_squares(left_at, np.zeros(2), bounds=bounds, diff_step=[1e-3, 1e-3])
    time, phase = best + 1e-3 * float(found.x[0]), float(found.x[1])
    left = view.left(time, phase)
    freedom = max(left.size - NUISANCES, 1)
    slopes: FloatArray = np.asarray(found.jac, dtype=np.float64)
    variance = float(left @ left) / freedom
    error = 1e-3 * float(np.sqrt(variance * np.linalg.pinv(slopes.T @ slopes)[0, 0]))
    return view.hit(time, error, phase, window_s)


def alignment(log: TransientLog, model: Model, conditions: Conditions) -> float:
    """Angle [rad] of the model's patch where the passages are: its steady waveform laid on T."""
    phi = np.linspace(-np.pi, np.pi, _ALIGNED_AT, endpoint=False)
    measured = log.steady_at(phi, np.full(_ALIGNED_AT, log.spin_rad_s))
    measured = measured - measured.mean()

    def left(shift: float) -> float:
        wave = model.predict(
            conditions, np.mod(phi + shift + np.pi, 2.0 * np.pi) - np.pi, surface=log.surface
        )[0]
        return float(np.sum((measured - wave + wave.mean()) ** 2))

    return float(
        minimize_scalar(
            left, bounds=(-_ALIGNED_RAD, _ALIGNED_RAD), method="bounded", options={"xatol": 1e-6}
        ).x
    )


def _sought(view: View, times: FloatArray, width: int) -> float:
    """The time [s] at which the model's answer is most like the measured one."""
    # where the waveform is steep, a wheel that was turned a little off weighs more than the time of
    # the hit
    apart = np.abs(split_turns(view.log.wheel.theta(view.log.time_s[view.rows]))[1]) > _STEEP_RAD
    losses = np.array(
        [
            np.sum(uniform_filter1d(view.left(float(time), 0.0) * apart, width) ** 2)
            for time in times
        ]
    )
    low = np.flatnonzero((losses <= np.roll(losses, 1)) & (losses <= np.roll(losses, -1)))
    candidates = times[low[np.argsort(losses[low])[:_BEST]]]
    near = np.arange(-2.0 * _GRID_S, 2.0 * _GRID_S, _FINE_S)
    fine = (candidates[:, None] + near).ravel()
    return float(
        fine[int(np.argmin([np.sum((view.left(float(time), 0.0) * apart) ** 2) for time in fine]))]
    )


@dataclass(frozen=True)
class View:
    """The samples `rows` of a log beside a motion that meets the obstacle at `reached` [s]."""

    log: TransientLog
    transient: Transient
    reached: float
    rows: NDArray[np.bool_]
    aligned_rad: float

    def _angles(self, when: FloatArray, time_s: float, phase_rad: float) -> FloatArray:
        """The wheel's angle among the passages at the samples, (m,), if the hit is at `time_s`.

        Passages before and after tell it; between, where the obstacle disturbs them, it swings as
        the model's does.
        """
        motion, turn = self.transient.motion, 2.0 * np.pi / self.log.spin_rad_s
        begin, end = self.reached, min(self.reached + DISTURBED[1] * turn, motion.time_s[-1])
        at = np.clip(when, begin, end)
        psi = np.interp(at, motion.time_s, motion.psi_rad)
        first, last = np.interp([begin, end], motion.time_s, motion.psi_rad)
        swing: FloatArray = psi - first - (last - first) * (at - begin) / (end - begin)
        return self.log.wheel.theta(when - self.reached + time_s) + phase_rad + swing

    def _parts(
        self, time_s: float, phase_rad: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """(added by the model, steady as measured, motion's time, wheel's angle), (m,) each.

        The angle is that among the passages.
        """
        when = self.log.time_s[self.rows] - time_s + self.reached
        theta = self._angles(when, time_s, phase_rad)
        added = self.transient.added(
            self.log.observable, theta + self.aligned_rad, when, surface=self.log.surface
        )
        added = np.where(when < self.transient.motion.time_s[0], 0.0, added)
        spin = np.interp(when, self.transient.motion.time_s, self.transient.motion.omega_rad_s)
        return added, self.log.steady_at(theta, spin), when, theta

    def left(self, time_s: float, phase_rad: float) -> FloatArray:
        """Measured less steady as measured less added by the model, without its mean, (m,)."""
        added, steady, _, _ = self._parts(time_s, phase_rad)
        left = self.log.values[self.rows] - steady - added
        centred: FloatArray = left - left.mean()
        return centred

    def hit(self, time_s: float, error_s: float, phase_rad: float, window_s: float) -> Hit:
        since = self.log.time_s - time_s
        window = replace(self, rows=(since >= 0.0) & (since <= window_s))
        added, steady, when, theta = window._parts(time_s, phase_rad)
        measured = self.log.values[window.rows]
        model = self.transient.at(
            self.log.observable, theta + self.aligned_rad, when, surface=self.log.surface
        )
        level = float(np.mean(measured - model))
        off = self.log.off()[window.rows]
        missed = measured - steady - added
        return Hit(
            time_s, error_s, self.aligned_rad, phase_rad, level,
            float(self.transient.conditions.speed_m_s[0]), since[window.rows], measured,
            model + level, off - off.mean(), missed - missed.mean(), self.transient.remarks,
        )  # fmt: skip
