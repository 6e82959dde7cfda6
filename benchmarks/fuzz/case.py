"""One damaged input, one command in a process of its own, and what may not happen."""

from __future__ import annotations

import os
import re
import resource
import shutil
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.fuzz import bases, damage
from benchmarks.fuzz.damage import Rng

MOST_BYTES = 1 << 30
MOST_CPU_S = 30.0
MOST_WALL_S = 240
#: of the process, so that a runaway case cannot take the machine
ADDRESS_SPACE = 6 << 30
SENTINEL = b"an older table\n"
MESSAGE = re.compile(r"tirelog: (error|note|warning|remark)?:? ?\S")
CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")
TABLES = ("speed", "footprint", "dissipation", "inflation", "tables", "info", "ingest")

Texts = Callable[[bytes, Rng], bytes]


@dataclass(frozen=True)
class Outcome:
    """What a case did; `faults` is empty if it is as it should be."""

    arguments: tuple[str, ...]
    status: int
    cpu_s: float
    peak_bytes: int
    stderr: str
    faults: tuple[str, ...] = field(default=())


def _copied(base: Path, folder: Path, *names: str) -> None:
    for name in names:
        shutil.copy(base / name, folder / name)


def _mutated(base: Path, folder: Path, name: str, how: Texts, rng: Rng) -> Path:
    target = folder / name
    target.write_bytes(how((base / name).read_bytes(), rng))
    return target


def _table(log: Path | str, rng: Rng, *more: str) -> list[str]:
    """A command that reads a log and, nine times of ten, writes a file."""
    command = str(rng.choice(TABLES))
    if command == "tables":
        return ["tables", str(log), "-o", "out", *more]
    if command == "ingest":
        return ["ingest", str(log), "-o", "out/run.h5", *more]
    if command == "info" or rng.random() < 0.1:
        return [command, str(log), *more]
    suffix = str(rng.choice(["csv", "parquet", "ndjson", "json"]))
    return [command, str(log), "-o", f"out/table.{suffix}", *more]


def _log(names: tuple[str, ...], how: Texts) -> Callable[[Path, Path, Rng], list[str]]:
    def build(base: Path, folder: Path, rng: Rng) -> list[str]:
        name = str(rng.choice(names))
        setup = f"{name.split('.')[0]}.toml"
        if rng.random() < 0.15:  # nobody has described it yet
            log = _mutated(base, folder, name, how, rng).name
            if rng.random() < 0.5:
                return ["info", log]
            return ["setup", "new", log, "-o", "out/setup.toml"]
        _copied(base, folder, setup)
        return _table(_mutated(base, folder, name, how, rng).name, rng, "--setup", setup)

    return build


def _hdf5(names: tuple[str, ...], setup: bool) -> Callable[[Path, Path, Rng], list[str]]:
    def build(base: Path, folder: Path, rng: Rng) -> list[str]:
        name = str(rng.choice(names))
        _copied(base, folder, name)
        (folder / "secret.bin").write_bytes(b"secret" * 100)
        damage.damage_hdf5(folder / name, rng)
        more = []
        if setup and rng.random() < 0.15:
            return ["info", name]
        if setup:
            _copied(base, folder, f"{name.split('.')[0]}.toml")
            more = ["--setup", f"{name.split('.')[0]}.toml"]
        if "encoder" in name and rng.random() < 0.5:
            return ["phase-shift", name, "-o", "out/table.csv", *more]
        return _table(name, rng, *more)

    return build


def _mcap(base: Path, folder: Path, rng: Rng) -> list[str]:
    name = str(rng.choice(["messages_none", "messages_zstd", "messages_lz4"]))
    _copied(base, folder, f"{name}.mcap", f"{name}.toml")
    damage.damage_mcap(folder / f"{name}.mcap", rng)
    if rng.random() < 0.15:
        (folder / f"{name}.toml").unlink()
        return ["info", f"{name}.mcap"]
    return _table(f"{name}.mcap", rng, "--setup", f"{name}.toml")


def _setup(base: Path, folder: Path, rng: Rng) -> list[str]:
    log = ("plain.csv", "peaks.csv", "samples.h5", "encoder.h5")[int(rng.integers(4))]
    setup = f"{log.split('.')[0]}.toml"
    _copied(base, folder, log)
    _mutated(base, folder, setup, damage.damaged_toml, rng)
    if log == "encoder.h5":
        return ["phase-shift", log, "--setup", setup, "-o", "out/table.csv"]
    return _table(log, rng, "--setup", setup)


def _model(base: Path, folder: Path, rng: Rng) -> list[str]:
    name = str(
        rng.choice(["model_beam.toml", "model_ring.toml", "model_water.toml", "model_own.toml"])
    )
    _copied(base, folder, "plain.csv", "plain.toml")
    _mutated(base, folder, name, damage.damaged_toml, rng)
    kind = int(rng.integers(5))
    if kind == 0:
        return ["model", "show", name]
    if kind == 1:
        return [
            "model",
            "predict",
            name,
            "--setup",
            "plain.toml",
            "--speed",
            "12",
            "-o",
            "out/table.csv",
        ]
    if kind == 2:
        return ["model", "add", name, "hysteresis", "-o", "out/model.toml"]
    if kind == 3 and name != "model_ring.toml":
        return [
            "compare",
            "plain.csv",
            "--model",
            name,
            "--format",
            "json",
            "-o",
            "out/compare.json",
        ]
    return ["model", "remove", name, "water_film", "-o", "out/model.toml"]


def _campaign(base: Path, folder: Path, rng: Rng) -> list[str]:
    _copied(base, folder, "conditions.csv")
    (folder / "logs").mkdir()
    (folder / "setup.toml").write_bytes((base / "plain.toml").read_bytes())
    (folder / "model.toml").write_bytes((base / "model_beam.toml").read_bytes())
    for log in ("a.csv", "b.csv"):
        shutil.copy(base / "plain.csv", folder / "logs" / log)
    if rng.random() < 0.3:
        (folder / "campaign.toml").write_bytes((base / "campaign.toml").read_bytes())
        _mutated(base, folder, "conditions.csv", damage.damaged_text, rng)
    else:
        _mutated(base, folder, "campaign.toml", damage.damaged_toml, rng)
    # never let a damaged manifest write: it may name any folder
    return [
        ["campaign", "run", "campaign.toml", "--dry-run"],
        ["campaign", "status", "campaign.toml"],
    ][int(rng.integers(2))]


def _scenario(base: Path, folder: Path, rng: Rng) -> list[str]:
    _mutated(base, folder, "scenario.toml", damage.damaged_toml, rng)
    suffix = str(rng.choice(["csv", "h5", "mcap"]))
    return ["simulate", "scenario.toml", "-o", f"out/log.{suffix}"]


def _check(base: Path, folder: Path, rng: Rng) -> list[str]:
    suffix = str(rng.choice(["csv", "parquet", "ndjson", "json"]))
    how = {
        "csv": damage.damaged_text,
        "parquet": damage.damaged_bytes,
        "ndjson": damage.damaged_json,
        "json": damage.damaged_json_table,
    }[suffix]
    _mutated(base, folder, f"table.{suffix}", how, rng)
    (folder / "golden.csv").write_bytes((base / "table.csv").read_bytes())
    first, second = (
        (f"table.{suffix}", "golden.csv")
        if rng.random() < 0.7
        else ("golden.csv", f"table.{suffix}")
    )
    return ["check", first, "--against", second, "-o", "out/table.csv"]


def _read_back(base: Path, folder: Path, rng: Rng) -> list[str]:
    """A damaged table or ladder that the page is made of."""
    _copied(base, folder, "plain.csv", "plain.toml")
    log = ["report", "plain.csv", "--setup", "plain.toml", "-o", "out/page.html"]
    if rng.random() < 0.4:
        _mutated(base, folder, "m.ladder.json", damage.damaged_json, rng)
        return [*log, "--ladder", "m.ladder.json"]
    suffix = str(rng.choice(["csv", "parquet", "ndjson", "json"]))
    how = {
        "csv": damage.damaged_text,
        "parquet": damage.damaged_bytes,
        "ndjson": damage.damaged_json,
        "json": damage.damaged_json_table,
    }[suffix]
    _mutated(base, folder, f"table.{suffix}", how, rng)
    return [*log, "--table", f"table.{suffix}"]


def _forces(base: Path, folder: Path, rng: Rng) -> list[str]:
    """A damaged TYDEX file or Magic Formula beside a model."""
    name = str(rng.choice(["forces.tdx", "forces.tir"]))
    _copied(base, folder, "model_beam.toml")
    _mutated(base, folder, name, damage.damaged_text, rng)
    asked = ["model", "forces", "model_beam.toml", "--against", name, "-o", "out/table.csv"]
    return [*asked, "--speed", "12", "--slip=-0.1:0.1:0.1"]


#: family: (share of the cases, how a case of it is built)
FAMILIES: dict[str, tuple[float, Callable[[Path, Path, Rng], list[str]]]] = {
    "text": (
        0.2,
        _log(("plain.csv", "comma.csv", "iso.csv", "bare.csv", "peaks.csv"), damage.damaged_text),
    ),
    "text bytes": (
        0.05,
        _log(("plain.csv", "comma.csv", "iso.csv", "bare.csv", "peaks.csv"), damage.damaged_bytes),
    ),
    "packed": (
        0.08,
        _log(("packed.csv.gz", "packed.csv.zst", "packed.csv.xz"), damage.damaged_bytes),
    ),
    "other": (
        0.1,
        _log(
            (
                *("matlab.mat", "matlabpacked.mat", "columns.parquet", "frames.wav"),
                *("archive.csv.zip", "labview.lvm"),
            ),
            damage.damaged_bytes,
        ),
    ),
    "mcap": (0.15, _mcap),
    "hdf5": (0.13, _hdf5(("samples.h5", "encoder.h5"), True)),
    "run": (0.13, _hdf5(("run_text.h5", "run_encoder.h5"), False)),
    "setup": (0.1, _setup),
    "model": (0.06, _model),
    "forces": (0.02, _forces),
    "campaign": (0.04, _campaign),
    "scenario": (0.03, _scenario),
    "check": (0.03, _check),
    "read back": (0.06, _read_back),
} | {
    family: (
        0.01,
        _log((one[1],), damage.damaged_zip if family == "excel" else damage.damaged_bytes),
    )
    for family, one in bases.EXTRA_LOGS.items()
    if bases.has_library(family)
}


def build(family: str, seed: int, number: int, base: Path, folder: Path) -> list[str]:
    """Make the input of a case in `folder`; the command line for it."""
    rng = np.random.default_rng([seed, number])
    (folder / "out").mkdir(parents=True)
    (folder / "tmp").mkdir()
    arguments = FAMILIES[family][1](base, folder, rng)
    if rng.random() < 0.5:  # an older result stands under the name
        for target in (a for a in arguments if a.startswith("out/")):
            (folder / target).write_bytes(SENTINEL)
    return arguments


def carried_out(arguments: list[str], folder: Path) -> Outcome:
    """Run a command line in a forked process of its own and judge it."""
    before = _files(folder)
    started = os.fork()
    if started == 0:
        _child(arguments, folder)
    _, code, used = os.wait4(started, 0)
    stderr = (
        (folder / "stderr").read_text("utf-8", "surrogateescape")
        if (folder / "stderr").exists()
        else ""
    )
    status = os.waitstatus_to_exitcode(code)
    faults = _faults(arguments, status, used, stderr)
    faults += _litter(arguments, status, before, _files(folder))
    return Outcome(
        tuple(arguments),
        status,
        used.ru_utime + used.ru_stime,
        used.ru_maxrss * 1024,
        stderr,
        tuple(faults),
    )


def _child(arguments: list[str], folder: Path) -> None:
    status = 99
    try:
        os.chdir(folder)
        os.environ["TMPDIR"] = str(folder / "tmp")
        import tempfile

        tempfile.tempdir = None
        for name, number in (("stdout", 1), ("stderr", 2)):
            opened = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(opened, number)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
        resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
        resource.setrlimit(resource.RLIMIT_CPU, (int(2 * MOST_CPU_S), int(2 * MOST_CPU_S)))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(MOST_WALL_S)
        from tirelog.cli import run

        status = run(arguments)
        sys.stdout.flush()
        sys.stderr.flush()
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        os._exit(status)


def _files(folder: Path) -> dict[str, bytes]:
    """All files below a folder but the two streams, with their bytes."""
    found = {}
    for path in folder.rglob("*"):
        if path.is_file() and path.name not in ("stdout", "stderr"):
            found[str(path.relative_to(folder))] = path.read_bytes()
    return found


def _faults(
    arguments: list[str], status: int, used: resource.struct_rusage, stderr: str
) -> list[str]:
    faults = []
    if status == 70:
        faults.append("status 70")
    elif status < 0:
        faults.append(f"killed by signal {-status}")
    elif status not in (0, 1, 2, 3, 4) or (status == 1 and arguments[0] != "check"):
        faults.append(f"status {status}")
    if used.ru_maxrss * 1024 > MOST_BYTES:
        faults.append("over 1 GB")
    if used.ru_utime + used.ru_stime > MOST_CPU_S:
        faults.append("over 30 s of CPU")
    if "Traceback" in stderr:
        faults.append("traceback")
    lines = stderr.split("\n")[:-1] if stderr else []
    if any(not MESSAGE.match(line) for line in lines) or (stderr and not stderr.endswith("\n")):
        faults.append("stderr line that is no message")
    if CONTROL.search(stderr):
        faults.append("control character on stderr")
    if status in (2, 3, 4) and not lines:
        faults.append("no message")
    return faults


def _litter(
    arguments: list[str], status: int, before: dict[str, bytes], after: dict[str, bytes]
) -> list[str]:
    faults = []
    if any(after.get(name) != data for name, data in before.items() if not name.startswith("out/")):
        faults.append("input changed")
    made = {name for name in after if name not in before}
    if any(name.startswith("tmp/") for name in made):
        faults.append("temporary file left")
    if any(not name.startswith(("tmp/", "out/")) for name in made):
        faults.append("file outside of the output")
    if any(name.endswith(".part") or "/." in name for name in made):
        faults.append("part of a file left")
    outputs = {name: data for name, data in after.items() if name.startswith("out/")}
    if status in (2, 4, 70) or status < 0:
        if outputs != {name: data for name, data in before.items() if name.startswith("out/")}:
            faults.append("output touched by a failure")
    elif status == 0:
        wanted = [a for a in arguments if a.startswith("out/")]
        if any(outputs.get(name) in (None, SENTINEL) for name in wanted):
            faults.append("no output")
    return faults
