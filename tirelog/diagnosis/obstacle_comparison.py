"""`compare` on transients.

A coupled ring model's answer to an obstacle against a log, in time and in frequency.

    TransientLogs, Model (fitted on the steady revolutions) --`fit_hit` each--> Hits
        --rows in time and frequency--> TransientComparison

The model's own parameters are not touched here: what it says of the obstacle is a prediction, with
four nuisance numbers per hit (when, phase, level, alignment), which the errors are charged for.
Beside the error of the whole reading stand the model's error off the obstacle (`rmse_steady`), the
repeatability of steady revolutions at the same wheel angles (`noise_floor`), what the obstacle
added as measured (`added`) and what of that the model does not cover (`missed`). Errors in the
observable's unit; squares of a band are mean squares, so that bands add up to the whole.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.diagnosis.answer import AnswerTable, excess_of, plain_fields
from tirelog.diagnosis.obstacles import NUISANCES, Hit, fit_hit
from tirelog.inference.obstacle_log import WINDOW_S, TransientLog, around
from tirelog.inference.stacks.align import split_turns
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import shown
from tirelog.vocabulary.quality import OK, Quality, quality_text

#: Rows of the table by time [s], and edges of the bands [Hz] of the table by frequency: thirds of
#: an octave above 20 Hz. Twice as long rows show half as much of a hit's course, each with less
#: scatter.
BIN_S = 0.01
BANDS_HZ = np.array(
    [
        0,
        20,
        25,
        31.5,
        40,
        50,
        63,
        80,
        100,
        125,
        160,
        200,
        250,
        315,
        400,
        500,
        630,
        800,
        1000,
        1250,
        1600,
        2000,
        2500,
        4e3,
        1e4,
    ]
)
#: Angles over which errors off the obstacle are averaged. Twice as many leave half as many samples
#: for each mean.
_ANGLES = 128
#: A hit of which the model covers less than this share may be something else than the obstacle.
#: Twice as much marks also hits of which a third is explained.
_COVERED = 0.2


@dataclass(frozen=True)
class Spectrum:
    """Mean squares of one hit per band of frequency, (b,).

    `edges_Hz` (b + 1,) of the bands; `added` by the obstacle as measured, `residual` that the model
    leaves, `missed` by its answer, `steady` error, noise `floor`.
    """

    edges_Hz: FloatArray
    added: FloatArray
    residual: FloatArray
    missed: FloatArray
    steady: FloatArray
    floor: FloatArray


@dataclass(frozen=True)
class HitResult:
    """A hit and its numbers, in the observable's unit but for times, phase and shares."""

    log: TransientLog
    ordinal: int
    hit: Hit
    floor: FloatArray
    steady: FloatArray
    spectrum: Spectrum

    @property
    def _charged(self) -> float:
        """Samples over samples less nuisances."""
        size = self.hit.since_s.size
        return size / max(size - NUISANCES, 1)

    def row(self) -> dict[str, Any]:
        """One row of the table by hit."""
        hit, left = self.hit, self.hit.measured - self.hit.predicted
        added, missed = (
            np.sqrt(np.mean(hit.added**2)),
            np.sqrt(np.mean(hit.missed**2) * self._charged),
        )
        floor = float(np.sqrt(np.mean(self.floor)))
        rmse = float(np.sqrt(np.mean(left**2) * self._charged))
        covered = 1.0 - max(missed**2 - floor**2, 0.0) / max(added**2 - floor**2, 1e-300)
        return {
            "log": self.log.log, "channel": self.log.channel, "hit": self.ordinal,
            "time_s": hit.time_s, "time_se_s": hit.time_se_s, "speed_m_s": hit.speed_m_s,
            "phase_deg": float(np.degrees(hit.phase_rad)),
            "alignment_deg": float(np.degrees(hit.alignment_rad)), "level": hit.level,
            "samples": int(left.size), "rmse": rmse,
            "rmse_steady": float(np.sqrt(np.mean(self.steady))), "noise_floor": floor,
            "excess": excess_of(rmse, floor), "added": float(added), "missed": float(missed),
            "covered": float(covered),
            "quality": quality_text(0 if covered > _COVERED else Quality.UNLIKE),
        }  # fmt: skip

    def time_rows(self) -> list[dict[str, Any]]:
        """Rows of 10 ms after the hit."""
        hit, left = self.hit, self.hit.measured - self.hit.predicted
        bins = (hit.since_s / BIN_S).astype(np.int64)
        rows = []
        for number in np.unique(bins):
            at = bins == number
            parts = (
                left**2 * self._charged,
                self.steady,
                self.floor,
                hit.added**2,
                hit.missed**2 * self._charged,
            )
            rows.append(
                {
                    **self._name(),
                    "since_s": (number + 0.5) * BIN_S,
                    "samples": int(at.sum()),
                    **_errors([p[at].mean() for p in parts]),
                }
            )
        return rows

    def frequency_rows(self) -> list[dict[str, Any]]:
        """Rows of bands up to half the sampling rate."""
        s = self.spectrum
        rows = []
        for i, (low, high) in enumerate(zip(s.edges_Hz[:-1], s.edges_Hz[1:])):
            parts = (
                s.residual[i] * self._charged,
                s.steady[i],
                s.floor[i],
                s.added[i],
                s.missed[i] * self._charged,
            )
            rows.append(
                {
                    **self._name(),
                    "low_Hz": float(low),
                    "high_Hz": float(high),
                    **_errors(list(parts)),
                }
            )
        return rows

    def _name(self) -> dict[str, Any]:
        return {"log": self.log.log, "channel": self.log.channel, "hit": self.ordinal}


def _errors(squares: Sequence[float]) -> dict[str, float]:
    """rmse, rmse_steady, noise_floor, excess, added, missed.

    From mean squares in that order (excess is their own).
    """
    rmse, steady, floor, added, missed = (float(np.sqrt(max(x, 0.0))) for x in squares)
    return {
        "rmse": rmse, "rmse_steady": steady, "noise_floor": floor, "excess": excess_of(rmse, floor),
        "added": added, "missed": missed,
    }  # fmt: skip


@dataclass(frozen=True)
class TransientComparison:
    """All hits of all logs."""

    observable: str
    unit: str
    hits: tuple[HitResult, ...]
    remarks: tuple[str, ...]

    @property
    def tables(self) -> dict[str, list[dict[str, Any]]]:
        return {
            "hit": [hit.row() for hit in self.hits],
            "time": [row for hit in self.hits for row in hit.time_rows()],
            "frequency": [row for hit in self.hits for row in hit.frequency_rows()],
        }

    def to_json(self) -> dict[str, Any]:
        """Totals over the hits, each as many samples as it has, and a row per hit."""
        rows = self.tables["hit"]
        weights = np.array([row["samples"] for row in rows], float)

        def total(name: str) -> float:
            return float(
                np.sqrt(np.average(np.array([row[name] for row in rows]) ** 2, weights=weights))
            )

        numbers = {
            name: total(name) for name in ("rmse", "rmse_steady", "noise_floor", "added", "missed")
        }
        numbers["excess"] = excess_of(numbers["rmse"], numbers["noise_floor"])
        floor = numbers["noise_floor"] ** 2
        numbers["covered"] = 1.0 - max(numbers["missed"] ** 2 - floor, 0.0) / max(
            numbers["added"] ** 2 - floor, 1e-300
        )
        return plain_fields({**numbers, "nuisance_parameters": NUISANCES * len(rows), "hits": rows})

    def hits_table(self, log_name: Callable[[str], str] = str) -> AnswerTable:
        """Hit by hit: what the obstacle added, what of it the model misses, errors and floor."""
        factor, unit = shown(self.observable, self.unit)
        sizes = ("added", "missed", "rmse", "rmse_steady", "noise_floor", "excess")
        rows = [
            [
                f"  {log_name(row['log'])} at {row['time_s']:.4f} +- {row['time_se_s']:.1g} s",
                row["speed_m_s"],
                *(row[name] * factor for name in sizes),
                f"{100.0 * row['covered']:.0f}",
                row["quality"],
            ]
            for row in self.tables["hit"]
        ]
        words = ("m/s", "added", "missed", "rmse", "steady", "floor", "excess", "covered [%]")
        return AnswerTable(f"Hit by hit, in {unit}", [f"in {unit}", *words, "quality"], rows)


def compare_transients(
    logs: Sequence[TransientLog], model: Model, *, unit: str
) -> TransientComparison:
    """The model's answer to every hit of the logs.

    ModelError if the model cannot be driven over their roads.
    """
    results: list[HitResult] = []
    remarks: list[str] = []
    for log in logs:
        for ordinal, rough in enumerate(log.hits_s):
            following = log.hits_s[ordinal + 1 :]
            window = min([WINDOW_S, *(following[:1] - rough - 0.02)])
            near = around(log, float(rough))
            hit = fit_hit(near, model, float(rough), float(window))
            results.append(_result(near, ordinal, hit, model))
            remarks += [remark for remark in hit.remarks if remark not in remarks]
            if results[-1].row()["quality"] != OK:
                remarks.append(
                    f"{log.log}: the model covers little of what happened at {hit.time_s:.4g} s; "
                    "the obstacle's dimensions, the model, or another event are to be doubted"
                )
    return TransientComparison(model.observable, unit, tuple(results), tuple(remarks))


def _result(log: TransientLog, ordinal: int, hit: Hit, model: Model) -> HitResult:
    """The hit beside the errors off the obstacle, by wheel angle and by frequency."""
    off, error = log.off(), _steady_error(log, hit, model)
    near = np.flatnonzero(log.calm)
    phi = split_turns(log.wheel.theta(log.time_s))[1]
    place = (phi + np.pi) * (_ANGLES / (2.0 * np.pi))
    bins = np.clip(place.astype(np.int64), 0, _ANGLES - 1)
    rows = (log.time_s >= hit.time_s) & (log.time_s - hit.time_s <= hit.since_s[-1] + 1e-9)
    at_hit = bins[rows][: hit.since_s.size]
    edges = BANDS_HZ[: int(np.searchsorted(BANDS_HZ, 0.5 * log.rate_Hz))]
    edges = (
        np.append(edges[:-1], 0.5 * log.rate_Hz)
        if edges.size > 1
        else np.array([0.0, 0.5 * log.rate_Hz])
    )
    spectra = {"added": hit.added, "residual": hit.measured - hit.predicted, "missed": hit.missed}
    powers = {
        name: band_squares(hit.since_s, values, edges, log.rate_Hz)
        for name, values in spectra.items()
    }
    calm = {
        name: _calm_squares(log, values, near, hit.since_s[-1], edges)
        for name, values in (("steady", error), ("floor", off))
    }
    by_angle = [_by_angle(values[near] ** 2, bins[near])[at_hit] for values in (off, error)]
    return HitResult(log, ordinal, hit, by_angle[0], by_angle[1], Spectrum(edges, **powers, **calm))


def _steady_error(log: TransientLog, hit: Hit, model: Model) -> FloatArray:
    """Samples less the model's steady waveform, level removed, (N,).

    At the angle of the passages and at the hit's conditions.
    """
    nearest = int(np.argmin(np.abs(log.conditions.time_s - hit.time_s)))
    conditions = log.conditions.take(slice(nearest, nearest + 1))
    phi = split_turns(log.wheel.theta(log.time_s) + hit.alignment_rad)[1]
    wave = model.predict(conditions, phi, surface=log.surface)[0]
    if log.observable == "radial_acceleration":
        frame = model.predict(conditions, phi, observable="frame_acceleration")[
            0
        ]  # does not follow the spin
        wave = (wave - frame) * (
            log.wheel.speed_rad_s(log.time_s) * log.radius_m / conditions.speed_m_s[0]
        ) ** 2 + frame
    error: FloatArray = log.values - wave
    level: FloatArray = error - error[log.calm].mean()
    return level


def _by_angle(squares: FloatArray, bins: NDArray[np.int64]) -> FloatArray:
    """Mean square per angle (_ANGLES,); if no sample fell in one, the mean of all."""
    count = np.bincount(bins, minlength=_ANGLES)
    total = np.bincount(bins, squares, minlength=_ANGLES)
    return np.where(count > 0, total / np.maximum(count, 1), squares.mean())


def _calm_squares(
    log: TransientLog,
    values: FloatArray,
    near: NDArray[np.int64],
    length_s: float,
    edges_Hz: FloatArray,
) -> FloatArray:
    """Mean squares per band over stretches of steady rolling, (b,).

    The stretches are as long as the window (or the longest there is).
    """
    stretches = np.split(near, np.flatnonzero(np.diff(near) > 1) + 1)
    size = min(max(round(length_s * log.rate_Hz), 8), max(len(s) for s in stretches))
    parts = [
        stretch[i : i + size]
        for stretch in stretches
        for i in range(0, len(stretch) - size + 1, size)
    ]
    squares: FloatArray = np.mean(
        [band_squares(log.time_s[p], values[p], edges_Hz, log.rate_Hz) for p in parts], axis=0
    )
    return squares


def band_squares(
    time_s: FloatArray, values: FloatArray, edges_Hz: FloatArray, rate_Hz: float
) -> FloatArray:
    """Mean square of the values in each band [low, high), (b,).

    The bands of a whole spectrum add up to their variance. Lost samples are bridged by straight
    lines.
    """
    size = max(round((time_s[-1] - time_s[0]) * rate_Hz) + 1, 2)
    even = np.interp(time_s[0] + np.arange(size) / rate_Hz, time_s, values)
    power = np.abs(np.fft.rfft(even - even.mean())) ** 2 * (2.0 / size**2)
    if size % 2 == 0:
        power[-1] *= 0.5
    frequency = np.fft.rfftfreq(size, 1.0 / rate_Hz)
    band = np.clip(np.searchsorted(edges_Hz, frequency, side="right") - 1, 0, edges_Hz.size - 2)
    return np.asarray(np.bincount(band, power, minlength=edges_Hz.size - 1), dtype=np.float64)
