"""A campaign of 200 logs, two minutes each, four gratings at 2.5 kHz, each log another drive under
other conditions, ten of them broken.

    python -m benchmarks campaign

One core, two cores, unchanged, then models over all of it. Goals: complete tables, ten errors
named, at most 400 MB a process, two cores 1.8 x faster than one, unchanged within 2 s.
TIRELOG_BENCH_LOGS is the number of logs; TIRELOG_BENCH_FOLDER keeps the logs from one run to the
next (simulating them takes longer than the campaign).
"""

import csv
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.measure import Cost, cost

TIRELOG = [sys.executable, "-m", "tirelog"]
TABLES = ("speed", "footprint", "dissipation")
RATE_HZ, SECONDS = 2500, 120
MANIFEST = """[campaign]
output = "results"
[[logs]]
glob = "logs/*"
setup = "setup.toml"
conditions = "conditions.csv"
[tables.speed]
[tables.footprint]
[tables.dissipation]
"""
MODELS = '[[models]]\nfile = "beam.toml"\ncommands = ["compare", "diagnose"]\n'
CHANNEL = """[channels.strain_{n}]
kind = "fbg_strain"
source = "CH{n}"
angle_deg = {angle}
surface = "outer"
reference_wavelength_nm = {nm}
noise = 0.0008
quantisation = 0.0001
lost_fraction = 0.0003
"""


def scenario(seed: int) -> tuple[str, dict[str, float]]:
    """(TOML, conditions) of one drive: cruises, drive, coast and brake in an order and at speeds of
    its own; a water film to be found.
    """
    random = np.random.default_rng(seed)
    conditions = {
        "load_N": round(3434.0 * random.uniform(0.8, 1.25), 1),
        "water_depth_mm": round(random.uniform(0.0, 1.5), 2),
    }
    text = f'seed = {seed}\ntruth = "beam"\n[road]\nroughness = 0.01\n[conditions]\n'
    text += "".join(f"{name} = {value}\n" for name, value in conditions.items())
    left = float(SECONDS)
    while left > 0.0:
        speed, change, cruise = (
            random.uniform(7.0, 25.0),
            random.uniform(3.0, 9.0),
            random.uniform(4.0, 12.0),
        )
        for seconds in (change, cruise):
            seconds = min(seconds, left) if left - seconds > 2.0 else left
            left -= seconds
            if seconds > 0.0:
                text += f"[[manoeuvres]]\nduration_s = {seconds:.3f}\nspeed_m_s = {speed:.3f}\n"
    first = random.uniform(0.0, 360.0)
    for n in range(4):
        text += CHANNEL.format(
            n=n + 1, angle=round((first + 90.0 * n) % 360.0, 1), nm=1540.0 + 5.0 * n
        )
    return text + '[[effects]]\nname = "water_film"\namplitude = 0.06\nlength = 0.4\n', conditions


def broken(folder: Path, good: bytes) -> None:
    """Ten logs that fail, each in its own way."""
    lines = good.splitlines(keepends=True)
    start = next(i for i, line in enumerate(lines) if line.startswith(b"time_s"))
    head, rows = lines[start], lines[start + 1 :]
    words = {
        "empty.csv": b"",
        "binary.csv": bytes(range(256)) * 4000,
        "other_columns.csv": b"a,b\n1,2\n2,3\n",
        "no_rows.csv": head,
        "words.csv": head + b"one,two,three,four,five\n" * 5000,
        "ten_rows.csv": head + b"".join(rows[:10]),
        "standing.csv": head
        + b"".join(b"%.4f,1540.0,1545.0,1550.0,1555.0\n" % (i / RATE_HZ) for i in range(20_000)),
        "cut.csv.gz": _gzip(good)[:3000],
        "not.mcap": b"\x89MCAP0\r\n" + bytes(5000),
        "not.h5": b"\x89HDF\r\n\x1a\n" + bytes(5000),
    }
    for name, data in words.items():
        (folder / f"broken_{name}").write_bytes(data)


def _gzip(data: bytes) -> bytes:
    import gzip

    return gzip.compress(data[:200_000], mtime=0)


def make(folder: Path, logs: int) -> None:
    """The logs with setup, conditions, model and manifests; what is there already is kept."""
    from tirelog.cli import run

    (folder / "logs").mkdir(parents=True, exist_ok=True)
    rows = []
    for number in range(logs - 10):
        log = folder / "logs" / f"drive_{number:03}.csv"
        text, conditions = scenario(9000 + number)
        rows.append({"log": log.name, **conditions})
        if not log.is_file():
            (folder / "scenario.toml").write_text(text)
            made = folder / "made.csv"
            run(["simulate", str(folder / "scenario.toml"), "-o", str(made), "--quiet"])
            made.with_suffix(".toml").replace(folder / "setup.toml")
            (folder / "made.csv.truth.json").unlink()
            made.replace(log)
    broken(folder / "logs", (folder / "logs" / "drive_000.csv").read_bytes())
    with (folder / "conditions.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, ["log", "load_N", "water_depth_mm"])
        writer.writeheader()
        writer.writerows(rows)
    (folder / "beam.toml").unlink(missing_ok=True)
    run(
        [
            "model",
            "new",
            "--carcass",
            "beam",
            "--setup",
            str(folder / "setup.toml"),
            "-o",
            str(folder / "beam.toml"),
        ]
    )
    (folder / "tables.toml").write_text(MANIFEST)
    (folder / "models.toml").write_text(MANIFEST + MODELS)


def campaign(manifest: Path, *more: str, status: int = 3) -> tuple[Cost, str]:
    """One run of it, which ends with this status, and what it said."""
    said = manifest.with_suffix(".said")
    command = f'"$@" 2> {said}; test $? = {status}'
    return cost(
        ["sh", "-c", command, "sh", *TIRELOG, "campaign", "run", str(manifest), *more]
    ), said.read_text()


def complete(folder: Path, said: str) -> None:
    """What the tables hold, and which logs failed, by the summary and by what was said."""
    import pandas as pd

    summary = pd.read_csv(folder / "results" / "summary.csv")
    counts = summary["status"].value_counts().to_dict()
    named = set(re.findall(r"error: \S*/(broken_\S+?):", said)) | set(
        re.findall(r"note: \S*/(broken_\S+?): lost", said)
    )
    print(
        f"summary: {counts}; named: "
        f"{len(named)} ({' '.join(sorted(n.removeprefix('broken_') for n in named))})"
    )
    print(f"peak memory of a worker: {summary['peak_memory_MB'].max():.0f} MB")
    for table in TABLES:
        rows = pd.read_parquet(
            folder / "results" / f"table={table}", columns=["log", "channel", "quality"]
        )
        logs = rows.groupby("log", observed=True)["channel"].nunique()
        good = logs[[str(name).startswith("logs_drive") for name in logs.index]]
        print(
            f"{table:12} {len(rows)} rows, {len(good)} drives of {int(good.min())} channels; "
            f"ok {(rows['quality'] == 'ok').mean():.3f}"
        )


def models(folder: Path) -> None:
    """What the models said."""
    result = json.loads((folder / "results" / "models" / "beam" / "diagnose.json").read_text())
    used = (
        f"{result['cells_used']} of {result['cells']} means of like revolutions, "
        f"{result['logs_used']} of {result['logs']} logs"
    )
    print(f"diagnose: {result['verdict']} {' '.join(result['selected'])}; {used}")


def main() -> None:
    logs = int(os.environ.get("TIRELOG_BENCH_LOGS", "200"))
    given = os.environ.get("TIRELOG_BENCH_FOLDER")
    folder = Path(given) if given else Path(tempfile.mkdtemp(prefix="tirelog-campaign-"))
    try:
        maker = (
            "import pathlib, benchmarks.bench_campaign as b; "
            f"b.make(pathlib.Path({str(folder)!r}), {logs})"
        )
        subprocess.run(
            [sys.executable, "-c", maker], check=True
        )  # a process of its own: what it takes would count for those started here
        print(
            f"{logs} logs, {logs - 10} drives of {SECONDS} s x 4 gratings at {RATE_HZ} Hz, ten "
            f"broken; load {os.getloadavg()[0]:.1f} before"
        )
        campaign(
            folder / "tables.toml", "--only", "*drive_000*", status=0
        )  # compiled kernels are kept; a first run compiles them
        walls = {}
        for workers in ("1", "2"):
            shutil.rmtree(folder / "results", ignore_errors=True)
            taken, said = campaign(folder / "tables.toml", "--workers", workers)
            walls[workers] = taken.wall_s
            print(f"workers {workers}     {taken}")
        print(f"two cores against one: {walls['1'] / walls['2']:.2f} x")
        print(f"unchanged     {campaign(folder / 'tables.toml')[0]}")
        print(f"with models   {campaign(folder / 'models.toml', '--workers', '2')[0]}")
        print(f"unchanged     {campaign(folder / 'models.toml')[0]}")
        models(folder)
        complete(folder, said)  # last: what it imports would count for the processes started here
    finally:
        if not given:
            shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
