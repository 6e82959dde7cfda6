"""Calls of the compiled kernels as commands make them, on logs of a few seconds.

`calls` runs the commands once in a process and keeps the first and the last call of each kernel for
each kind of arguments, as they were handed over.

    python -m tests.kernel_calls       add them to those that are compiled ahead
"""

from __future__ import annotations

import gzip
import json
from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from tests.simulation.rolls import belt, orders, rolling, strain_rider
from tests.strain.strain_truth import windows_of
from tests.wheel.phase_truth import Drive, Encoder, Tread, write_hdf5
from tirelog import cli
from tirelog.inference.stacks.hum import along_rises
from tirelog.kernels.build import CALLS
from tirelog.kernels.dispatch import Kernel, kind_of, spelled
from tirelog.physics.spectral import MODES, Angles
from tirelog.strain.footprint.measure import along_tread

SAMPLES = Path(__file__).parents[1] / "sample_data"

WHEEL = """
[tire]
rolling_radius_m = 0.305
[channels.encoder]
kind = "wheel_encoder"
source = "/encoder"
unit = "V"
steps = 48
[channels.acceleration]
kind = "radial_acceleration"
source = "/acceleration"
unit = "g"
"""


@contextmanager
def called(by: Any) -> Iterator[None]:
    """Kernels are called by `by(kernel, *arguments)` meanwhile."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Kernel, "__call__", by)
        yield


@cache
def calls() -> dict[tuple[str, str], list[tuple[Any, ...]]]:
    """By kernel and kinds of arguments: the arguments of its first and last call."""
    kept: dict[tuple[str, str], list[tuple[Any, ...]]] = defaultdict(list)
    plain = Kernel.__call__

    def keep(kernel: Kernel, *given: Any) -> Any:
        so_far = kept[kernel.name, spelled(map(kind_of, given))]
        so_far[1:] = [deepcopy(given)]
        return plain(kernel, *given)

    with TemporaryDirectory() as folder, called(keep):
        run_on_drives(Path(folder))
        run_on_a_wheel(Path(folder))
        run_models(Path(folder))
        roll()
        call_the_rest()
    return kept


def run(*words: object) -> None:
    status = cli.run([*map(str, words), "--quiet"])
    assert status in (0, 3), words  # 3: samples are lost


def rows_of_drive(count: int) -> list[list[str]]:
    """Names and first rows of a sample; some samples lie at an end of the range, some are lost."""
    with gzip.open(SAMPLES / "hidden_1.csv.gz", "rt") as file:
        rows = [next(file).strip().split(",") for _ in range(count + 3)][2:]
    for row in rows[1:]:
        row[1] = max(row[1], "1548.2500")
    for k in (40, 41, 3000):
        rows[k][1] = ""
    rows[5000][1] = "1555"
    return rows


def written(folder: Path, name: str, lines: Iterable[str], setup: str) -> Path:
    log = folder / f"{name}.csv"
    log.write_text("\n".join(lines) + "\n")
    log.with_suffix(".toml").write_text(setup)
    return log


def run_on_drives(folder: Path) -> None:
    setup = (SAMPLES / "hidden_1.toml").read_text()
    rows = rows_of_drive(12_000)
    drive = written(folder, "drive", map(",".join, rows), setup)
    run("tables", drive, "-o", folder / "tables.csv")
    run("ingest", SAMPLES / "drive_messages.mcap", "-o", folder / "messages.h5")
    run("model", "new", "--setup", drive.with_suffix(".toml"), "-o", folder / "model.toml")
    run("compare", drive, "--model", folder / "model.toml", "-o", folder / "compared.json")
    slow_setup = setup.replace("2500.0", "312.5")
    slow = written(folder, "slow", map(",".join, [rows[0], *rows[1::8]]), slow_setup)
    run("speed", slow, "-o", folder / "speed.csv")


def run_on_a_wheel(folder: Path) -> None:
    drive, log = Drive((0, 3, 4, 6), (10, 10, 14, 14)), folder / "wheel.h5"
    signals = {"encoder": (Encoder(), "V", 1.0), "acceleration": (Tread(), "g", 9.80665)}
    write_hdf5(log, {n: (s.signal(drive) / by, unit, 1e4) for n, (s, unit, by) in signals.items()})
    log.with_suffix(".toml").write_text(WHEEL)
    run("tables", log, "-o", folder / "wheel.csv")


def run_models(folder: Path) -> None:
    setup, model = SAMPLES / "cleat.toml", folder / "ring.toml"
    run("model", "new", "--carcass", "coupled_ring", "--setup", setup, "-o", model)
    road = "cleat,height_m=0.008,length_m=0.04,position_m=0.15"
    asked = ["--setup", setup, "--speed", "20", "--road", road, "--duration", "0.02"]
    run("model", "predict", model, *asked, "-o", folder / "predicted.csv")


def roll() -> None:
    tire = belt(32, bristle_stiffness_N_m2=3e7, radial_damping_N_s_m2=300.0)
    made = rolling(tire, speed=8.0, load=2000.0)
    riders = (strain_rider(tire, 0.3),)
    made.run(orders(3, speed=8.0, load=2000.0, torque=20.0), every=2, riders=riders)


def call_the_rest() -> None:
    """Kernels that commands call for longer logs only."""
    rng, four = np.random.default_rng(1000), np.ones(4)
    motion = {"speed_m_s": 9 * four, "acceleration_m_s2": -2 * four}
    windows = windows_of(rng.normal(size=(4, 64)), 2500.0, centre=32 * four, **motion)
    along_tread(windows, 400 * four, 2)
    Angles(rng.uniform(-1, 1, (4, 30))).evaluate(rng.normal(size=(4, MODES)).astype(complex))
    turning, left = np.exp(1j * rng.normal(size=(6, 9))), rng.uniform(size=(6, 9))
    weighted, weight, first = *rng.uniform(size=(2, 4, 9)), np.array([0, 1, 3, 4])
    along_rises(turning, left, first, weighted, weight, np.zeros(4, complex))


if __name__ == "__main__":
    ahead = json.loads(CALLS.read_text(encoding="utf-8"))
    for kernel, kinds in calls():
        of_kernel = ahead.setdefault(kernel, [])
        of_kernel += [told for told in [json.loads(kinds)] if told not in of_kernel]
    rows = {name: ",\n  ".join(map(json.dumps, told)) for name, told in sorted(ahead.items())}
    text = ",\n".join(f"{json.dumps(name)}: [\n  {told}\n]" for name, told in rows.items())
    CALLS.write_text(f"{{\n{text}\n}}\n", encoding="utf-8")
