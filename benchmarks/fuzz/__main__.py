"""`python -m benchmarks.fuzz [--cases N] [--seed S] [--family F] [--seconds T] [--jobs J] [--keep
FOLDER]`.

Prints a row per family and every case that failed; status 1 if there is one. A seed and a case's
number make the same case again: `--seed S --only N`.
"""

from __future__ import annotations

import argparse
import json
import os
import secrets
import shutil
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path

import numpy as np

from benchmarks.fuzz import bases, case


def families(seed: int, cases: int, only: str | None) -> list[str]:
    """The family of each case, drawn by its share."""
    if only is not None:
        return [only] * cases
    names = list(case.FAMILIES)
    shares = np.array([case.FAMILIES[name][0] for name in names])
    return [
        str(name)
        for name in np.random.default_rng(seed).choice(names, size=cases, p=shares / shares.sum())
    ]


def warmed(base: Path) -> None:
    """Import and compile in this process what the forks use."""
    from tirelog.cli import run

    out = str(base / "warm")
    for arguments in (
        ["tables", str(base / "plain.csv"), "-o", out, "--quiet"],
        ["tables", str(base / "comma.csv"), "-o", out, "--quiet"],
        ["tables", str(base / "peaks.csv"), "-o", out, "--quiet"],
        ["tables", str(base / "messages_zstd.mcap"), "-o", out, "--quiet"],
        ["tables", str(base / "samples.h5"), "-o", out, "--quiet"],
        ["tables", str(base / "matlab.mat"), "-o", out, "--quiet"],
        ["tables", str(base / "frames.wav"), "-o", out, "--quiet"],
        ["tables", str(base / "archive.csv.zip"), "-o", out, "--quiet"],
        ["tables", str(base / "labview.lvm"), "-o", out, "--quiet"],
        ["phase-shift", str(base / "encoder.h5"), "-o", f"{out}/phase.csv", "--quiet"],
        ["check", f"{out}/speed.csv", "--against", f"{out}/speed.csv"],
    ):
        run(arguments)
    shutil.rmtree(out)
    if threading.active_count() > 1:
        sys.exit("a thread is alive after the warm-up; forks of this process would not be sound")


def share(
    base: Path, seed: int, drawn: list[str], numbers: range, until: float, keep: Path, results: Path
) -> None:
    """Carry out some of the cases and write their outcomes, one JSON line each."""
    with results.open("w") as log:
        for number in numbers:
            if time.monotonic() > until:
                break
            folder = Path(tempfile.mkdtemp(prefix="case-", dir=base.parent))
            try:
                arguments = case.build(drawn[number], seed, number, base, folder)
                done = case.carried_out(arguments, folder)
                row = {
                    "number": number,
                    "family": drawn[number],
                    "status": done.status,
                    "cpu_s": done.cpu_s,
                    "peak": done.peak_bytes,
                }
                row |= {
                    "faults": done.faults,
                    "arguments": done.arguments,
                    "stderr": done.stderr[-600:],
                }
                if done.faults:
                    shutil.copytree(folder, keep / f"{seed}-{number}", dirs_exist_ok=True)
                log.write(json.dumps(row) + "\n")
                log.flush()
            finally:
                shutil.rmtree(folder)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description=__doc__)
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=None, help="another one each time unless given")
    parser.add_argument("--family", choices=list(case.FAMILIES))
    parser.add_argument("--only", type=int, help="number of the one case to carry out")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after this time")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument(
        "--keep",
        type=Path,
        default=Path("fuzz_failures"),
        help="where the inputs of failed cases go",
    )
    asked = parser.parse_args()
    seed = secrets.randbelow(2**31) if asked.seed is None else asked.seed
    print(f"seed {seed}", flush=True)
    with tempfile.TemporaryDirectory(prefix="fuzz-") as top:
        base = Path(top) / "base"
        base.mkdir()
        bases.make(base)
        warmed(base)
        started = time.monotonic()
        drawn = families(seed, max(asked.cases, (asked.only or 0) + 1), asked.family)
        jobs = 1 if asked.only is not None else asked.jobs
        workers = []
        for job in range(jobs):
            numbers = (
                range(asked.only, asked.only + 1)
                if asked.only is not None
                else range(job, asked.cases, jobs)
            )
            worker = os.fork()
            if worker == 0:
                try:
                    share(
                        base,
                        seed,
                        drawn,
                        numbers,
                        started + asked.seconds,
                        asked.keep,
                        Path(top) / f"results-{job}",
                    )
                except BaseException:
                    import traceback

                    traceback.print_exc()
                    os._exit(1)
                os._exit(0)
            workers.append(worker)
        broken = [w for w in workers if os.waitstatus_to_exitcode(os.waitpid(w, 0)[1])]
        rows = [
            json.loads(line)
            for path in sorted(Path(top).glob("results-*"))
            for line in path.read_text().splitlines()
        ]
    _say(rows, seed, time.monotonic() - started)
    if broken or not rows:
        print("the fuzzer itself failed")
        return 1
    return 1 if any(row["faults"] for row in rows) else 0


def _say(rows: list[dict], seed: int, seconds: float) -> None:
    """A row per family, then the failures, each with its command."""
    print(f"{'family':12s} cases  status 0/1/2/3/4        faults  most CPU s  most MB")
    for name in case.FAMILIES:
        own = [row for row in rows if row["family"] == name]
        if not own:
            continue
        status = Counter(row["status"] for row in own)
        told = "/".join(str(status[s]) for s in range(5))
        faults = sum(bool(row["faults"]) for row in own)
        most = (
            f"{max(row['cpu_s'] for row in own):10.1f}  "
            f"{max(row['peak'] for row in own) / 1e6:7.0f}"
        )
        print(f"{name:12s} {len(own):5d}  {told:24s} {faults:6d}  {most}")
    kinds = Counter(fault for row in rows for fault in row["faults"])
    print(
        f"{len(rows)} cases in {seconds:.0f} s; "
        + (", ".join(f"{fault}: {n}" for fault, n in kinds.most_common()) or "no fault")
    )
    for row in sorted((r for r in rows if r["faults"]), key=lambda r: r["number"])[:200]:
        last = row["stderr"].strip().splitlines()[-1:] or [""]
        told = f"{row['family']}; {', '.join(row['faults'])}"
        print(
            f"  --seed {seed} --only {row['number']} ({told}): {' '.join(row['arguments'])}: "
            f"{last[0][:200]!r}"
        )


if __name__ == "__main__":
    sys.exit(main())
