"""Phase shift and patch width in manoeuvres (P4), truth by a ring whose tire is drawn.

    python -m benchmarks.wheel_manoeuvres [--kinds dynamic_2.0bar_1.2g,...] [--seeds 1000:1004]
                                          [-o results.csv]     one row per log, as it is done
    python -m benchmarks.wheel_manoeuvres --summary results.csv   means by plan and noise

A log is a plan of `wheel_cases` at a pressure and a noise of the accelerometer; logs of one seed
have one tire, one wheel and one transfer of the load to or from the wheel. An error is what was
found less what is true, without its mean over the log: where zero is is a convention, and of the
width half of a level is not the contact's edge. Seeds below 1000 are for choosing, from 1000 on for
reporting.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from benchmarks.case_rows import run_or_sum_up
from benchmarks.wheel_cases import WHEEL_PLANS, Instruments, wheel_scenario
from tirelog.simulation import simulate, to_recording
from tirelog.simulation.scenario.schema import Planted, Scenario, TrueTire
from tirelog.vocabulary.arrays import FloatArray
from tirelog.wheel.phase_shift import measure_phase_shift

PRESSURES_BAR, NOISES_G = (2.0, 1.6), (1.2, 3.0)
KINDS = tuple(f"{p}_{b}bar_{g}g" for p, b, g in product(WHEEL_PLANS, PRESSURES_BAR, NOISES_G))
#: columns of which a summary shows the mean, and those of which the root of the mean square
SHARES = ("found", "shift_within", "width_within", "width_follows")
SIZES = (
    *("shift_rms_deg", "shift_moving_deg", "shift_by_speed_deg"),
    *("width_rms_deg", "width_moving_deg", "width_by_speed_deg"),
)
#: a passage is one of a manoeuvre from here on [m/s^2]
MOVING_M_S2 = 1.0


@dataclass(frozen=True)
class Row:
    """One log: its errors in degrees.

    `_rms_deg` of all good passages, `_moving_deg` of those in manoeuvres (NaN without any),
    `_by_speed_deg` what the error grows by per 10 m/s, `_within` the share within 1.96 standard
    errors; `width_follows` what the found width grows by per degree of the true one; means of both.
    """

    kind: str
    seed: int
    passages: int
    found: float
    shift_rms_deg: float
    shift_moving_deg: float
    shift_by_speed_deg: float
    shift_within: float
    width_rms_deg: float
    width_moving_deg: float
    width_by_speed_deg: float
    width_within: float
    width_follows: float
    width_deg: float
    true_width_deg: float


def scenario(kind: str, seed: int) -> Scenario:
    """One log; its tire is drawn as those of `wheel_hidden` are."""
    plan, bar, noise = kind.rsplit("_", 2)
    draw = np.random.default_rng(seed)
    other = draw.uniform(0.6, 1.6, 4)
    belt_m, transfer = draw.uniform(0.11, 0.16), draw.uniform(-0.3, 0.3)
    usual = TrueTire()
    pressure = 1e5 * float(bar.removesuffix("bar"))
    made = wheel_scenario(
        plan,
        seed=seed + 500_000 * KINDS.index(kind),
        pressure_Pa=pressure,
        with_=Instruments(acceleration_noise_g=float(noise.removesuffix("g"))),
    )
    encoder = replace(made.channels["encoder"], pitch_seed=seed)
    return replace(
        made,
        truth="ring",
        effects=(Planted("load_transfer", "exact", {"coefficient": float(transfer)}),),
        channels={**made.channels, "encoder": encoder},
        tire=replace(
            made.tire,
            flexural_stiffness_N_m2=float(2.0 * other[0]),
            radial_stiffness_N_m2=float(usual.radial_stiffness_N_m2 * other[1]),
            tangential_stiffness_N_m2=float(usual.tangential_stiffness_N_m2 * other[2]),
            tread_stiffness_N_m2=float(usual.tread_stiffness_N_m2 * other[3]),
            width_belt_m=float(belt_m),
        ),
    )


def run(kind: str, seed: int) -> Row:
    """One log from the scenario to its errors."""
    simulated = simulate(scenario(kind, seed))
    found = next(measure_phase_shift(to_recording(simulated, "log")))
    true = simulated.truth["channels"]["acceleration"]["passages"]
    nearest = np.abs(np.array(true["time_s"])[:, None] - found.time_s).argmin(axis=0)
    good = found.good
    middle = found.entry_deg + found.width_deg / 2 - np.rad2deg(true["wheel_angle_rad"])[nearest]
    usual = np.angle(np.exp(1j * np.deg2rad(middle[good])).sum(), deg=True)
    middle = np.mod(middle - usual + 180.0, 360.0) - 180.0
    width = np.array(true["patch_width_deg"])[nearest]
    speed, moving = found.speed_m_s[good], np.abs(found.acceleration_m_s2[good]) > MOVING_M_S2

    def errors(value: FloatArray, se: FloatArray) -> tuple[float, float, float, float]:
        error = value[good] - value[good].mean()
        return (
            float(error.std()),
            float(np.sqrt(np.mean(error[moving] ** 2))) if moving.any() else float("nan"),
            10.0 * float(np.polyfit(speed, error, 1)[0]),
            float(np.mean(np.abs(error) < 1.96 * se[good])),
        )

    return Row(
        kind,
        seed,
        good.size,
        float(good.mean()),
        *errors(middle, found.shift_se_deg),
        *errors(found.width_deg - width, found.width_se_deg),
        float(np.polyfit(width[good], found.width_deg[good], 1)[0]),
        float(found.width_deg[good].mean()),
        float(width[good].mean()),
    )


def summary(rows: Iterable[dict[str, str]]) -> Iterator[str]:
    """Errors by plan, pressure and noise, and how the width grows at the lower pressure."""
    rows = list(rows)
    yield (
        f"{'log':24}{'n':>4}{'found':>7}  shift: {'rms':>6}{'moving':>7}{'/10 m/s':>8}{'within':>7}"
        f"  width: {'rms':>6}{'moving':>7}{'/10 m/s':>8}{'within':>7}{'follows':>8}"
    )
    for kind in KINDS:
        own = [r for r in rows if r["kind"] == kind]
        if not own:
            continue
        mean = {k: np.mean([float(r[k]) for r in own]) for k in SHARES}
        square = {k: np.sqrt(np.mean([float(r[k]) ** 2 for r in own])) for k in SIZES}
        yield (
            f"{kind:24}{len(own):4}{100 * mean['found']:6.1f}%         "
            f"{square['shift_rms_deg']:6.4f}{square['shift_moving_deg']:7.4f}"
            f"{square['shift_by_speed_deg']:8.4f}{100 * mean['shift_within']:6.1f}%         "
            f"{square['width_rms_deg']:6.4f}{square['width_moving_deg']:7.4f}"
            f"{square['width_by_speed_deg']:8.4f}{100 * mean['width_within']:6.1f}%"
            f"{mean['width_follows']:8.3f}"
        )
    by = {(r["kind"], r["seed"]): r for r in rows}
    pairs = []
    for (kind, seed), low in by.items():
        high = by.get((kind.replace("_1.6bar_", "_2.0bar_"), seed))
        if "_1.6bar_" in kind and high is not None:
            pairs.append(
                [
                    float(one[name]) - float(other[name])
                    for one, other in ((low, high),)
                    for name in ("width_deg", "true_width_deg")
                ]
                + [float(high["width_deg"]), float(high["true_width_deg"])]
            )
    if pairs:
        grown, truly, width, true_width = np.array(pairs).T
        yield (
            f"from 2.0 to 1.6 bar the width grows by {grown.mean():.3f} degree "
            f"({100 * np.mean(grown / width):.2f} %), truly by {truly.mean():.3f} "
            f"({100 * np.mean(truly / true_width):.2f} %); off by {np.std(grown - truly):.3f} "
            f"around {np.mean(grown - truly):+.3f} in {len(pairs)} pairs"
        )


if __name__ == "__main__":
    run_or_sum_up(__doc__, KINDS, "1000:1004", Row, run, summary)
