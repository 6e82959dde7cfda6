"""Contact length, slip onset and dissipation against finite-difference truths, beside P2's plain
method, and what they cost.

Goals: length within 0.5 % in the median and 1 % standard deviation a passage on a beam, within 3 %
on a ring without being told; standard errors that cover 68 % +-5; false slip onsets at most 1 in
100; dissipation factor within 0.5 % in the median. Reporting seeds from 10000.
"""

import time

import numpy as np

from tests.strain.conftest import make_drive
from tests.strain.strain_truth import Beam, Ring
from tests.strain.test_slip_onset import mixed
from tirelog.dsp.filters import Cutoff
from tirelog.strain.dissipation import dissipation
from tirelog.strain.footprint.footprint import footprint
from tirelog.strain.passages.find import find_passages

RADIUS_M, SECONDS, SEEDS = 0.305, 30, range(10_000, 10_004)


def case(name, truth, speed, noise_pm, rate_Hz=2500.0, surface="outer"):
    """One line: medians and scatter over some seeds."""
    length = 2 * truth.half_length_m
    errors, covered, plain, finds, factors, rows, form = [], [], [], 0, [], 0, 0.0
    for seed in SEEDS:
        made = make_drive(
            [0, SECONDS if rate_Hz < 1e4 else 6],
            [speed, speed],
            seed=seed,
            noise_pm=noise_pm,
            rate_Hz=rate_Hz,
            surface=surface,
            pulse=truth,
            height=1.0,
            drift=0.0,
        )
        passages = find_passages(made.channel, RADIUS_M)
        found = footprint(made.channel, passages, Cutoff.parse("400Hz"))
        spent = dissipation(made.channel, passages, None, passages.quality)
        errors.append(found.length_m / length - 1)
        covered.append(np.mean(np.abs(found.length_m - length) < found.length_se_m))
        plain.append(np.nanmedian(found.length_d2_m) / length)
        finds += int(np.isfinite(found.slip["onset_m"]).sum())
        rows += len(passages)
        form = float(np.nanmedian(found.form_se_m)) / length
        factors.append(spent.factor_1_m[1:-1])
    error = np.concatenate(errors)
    factor = np.median(np.concatenate(factors)) / wanted(truth, speed) - 1
    print(
        f"{name:6}{speed:5.0f} m/s {noise_pm:4.1f} pm {rate_Hz / 1e3:4.1f} kHz {surface:5}  "
        f"length {100 * np.nanmedian(error):+6.3f} % "
        f"+-{100 * np.nanstd(error):5.3f}  covered {np.mean(covered):.2f}  form "
        f"{100 * form:4.2f} %  plain d2 {np.mean(plain):5.3f}  "
        f"false onsets {finds}/{rows}  dissipation {100 * factor:+6.3f} %",
        flush=True,
    )


def told(name, found, length_m):
    """One line on rows of the same true length."""
    errors = np.concatenate(found["length_m"]) / length_m - 1
    covered = np.abs(errors) * length_m < np.concatenate(found["length_se_m"])
    print(
        f"{name:42}  length {100 * np.nanmedian(errors):+6.3f} % +-{100 * np.nanstd(errors):5.3f}  "
        f"covered {np.mean(covered[np.isfinite(errors)]):.2f}",
        end="",
    )


def manoeuvre():
    """Full acceleration and braking at 4 m/s^2, without traction in the strain: distance, not time,
    decides.
    """
    truth, rows = Beam(), {"length_m": [], "length_se_m": []}
    for seed in SEEDS:
        made = make_drive(
            [0, 8, 12, 20, 24, 32],
            [6, 6, 22, 22, 6, 6],
            seed=seed,
            pulse=truth,
            height=1.0,
            drift=0.0,
        )
        passages = find_passages(made.channel, RADIUS_M)
        found = footprint(made.channel, passages)
        moving = np.abs(np.nan_to_num(passages.acceleration_m_s2)) > 2.0
        for name, values in rows.items():
            values.append(getattr(found, name)[moving])
    told("beam   6 to 22 m/s, +-4 m/s^2", rows, 2 * truth.half_length_m)
    print()


def traction(speed, slip):
    """Rows with a traction in the strain, behind free rolling in the same log."""
    rows, onsets, onset = {"length_m": [], "length_se_m": []}, [], 0.0
    for seed in SEEDS:
        found, slipping, _, onset = mixed(make_drive, RADIUS_M, speed, slip, seed)
        for name, values in rows.items():
            values.append(getattr(found, name)[slipping])
        onsets.append(found.slip["onset_m"][slipping])
    told(f"beam {speed:5.0f} m/s with slip {slip:+.2f}", rows, 2 * Beam().half_length_m)
    where = 1e3 * (np.concatenate(onsets) - onset)
    print(
        f"  onset {np.nanmedian(where):+6.2f} mm +-{np.nanstd(where):5.2f}  found "
        f"{np.isfinite(where).mean():.2f}",
        flush=True,
    )


def wanted(truth, speed):
    """The true dissipation factor."""
    if isinstance(truth, Beam):
        return truth.dissipation_factor(speed)
    xi, strain, *_ = truth.solve()
    return float(np.trapezoid(np.gradient(strain, xi) ** 2, xi))


def main() -> None:
    for speed in (6.0, 14.0, 24.0):
        for noise_pm in (0.3, 0.8, 3.0):
            case(
                "beam",
                Beam(speeds=(speed, speed)),
                speed,
                noise_pm,
                surface="inner" if noise_pm == 0.8 else "outer",
            )
    case("beam", Beam(speeds=(14.0, 14.0)), 14.0, 3.0, 25_000.0)
    for sink_m, tread in ((0.016, 8.75e7), (0.03, 8.75e7), (0.02, 8e6)):
        for speed in (6.0, 24.0):
            case("ring", Ring(sink_m, tread), speed, 0.8)
    manoeuvre()
    for slip in (0.05, 0.1, 0.15, 0.2, 0.3):
        traction(14.0, slip)
        traction(14.0, -slip)
    made = make_drive(
        [0, 150, 300, 600], [8, 22, 14, 20], seed=3010, pulse=Beam(), height=1.0, drift=0.0
    )
    begun = time.process_time()
    passages = find_passages(made.channel, RADIUS_M)
    found = time.process_time()
    footprint(made.channel, passages)
    fitted = time.process_time()
    dissipation(made.channel, passages, None, passages.quality)
    ended = time.process_time()
    print(
        f"10 min of one grating, {len(passages)} passages: found {found - begun:.2f} s cpu, "
        f"footprint {fitted - found:.2f} s, dissipation {ended - fitted:.2f} s"
    )


if __name__ == "__main__":
    main()
