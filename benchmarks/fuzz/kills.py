"""Commands killed at any moment, then started again: `python -m benchmarks.fuzz.kills [--tables N]
[--campaigns N]`.

After a kill an output is absent, the older one or the whole new one, and no process is left. After
the next start the results equal those of an undisturbed run, and nothing else lies in the output
folder or in the folder for temporary files. Prints counts; status 1 if anything was otherwise.
"""

from __future__ import annotations

import argparse
import os
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import h5py
import numpy as np

from benchmarks.fuzz.bases import SETUP, strain_log

SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT)
COMMANDS = {
    "ingest": ["ingest", "log.csv", "-o", "out/run.h5"],
    "tables": ["tables", "log.csv", "-o", "out"],
    "speed": ["speed", "log.csv", "-o", "out/speed.csv"],
}
CAMPAIGN = """[campaign]
name = "kills"
output = "out"
[[logs]]
glob = "logs/*.csv"
setup = "log.toml"
[tables.speed]
[tables.dissipation]
"""
#: seconds until the processes of a killed command have to be gone
PATIENCE_S = 60.0


def log_text(seconds: float, speed_m_s: float) -> str:
    rows = zip(*strain_log(seconds, speed_m_s), strict=True)
    return "time_s,CH1,CH2\n" + "".join(f"{a:.4f},{b:.4f},{c:.4f}\n" for a, b, c in rows)


def contents(path: Path) -> object:
    """What a result holds: bytes, rows without what is timed, or of a run its datasets (HDF5 files
    differ in their gaps).
    """
    if path.name == "summary.csv":  # its last two columns are seconds and memory
        return [row.rsplit(",", 2)[0] for row in path.read_text().splitlines()]
    if path.suffix != ".h5":
        return path.read_bytes()
    found: dict[str, bytes] = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, node: found.update(
                {name: np.asarray(node[()]).tobytes()} if isinstance(node, h5py.Dataset) else {}
            )
        )
    return {name: data for name, data in found.items() if "provenance" not in name}


def results(folder: Path) -> dict[str, object]:
    """All files below an output folder with their contents, without a campaign's own records of
    time.
    """
    return {
        str(path.relative_to(folder)): contents(path)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and ".tirelog" not in path.parts
    }


def _default_signals() -> None:
    """In the new process: what the starter of this one has set to be ignored (`nohup`) ends it
    again.
    """
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)


def started(arguments: list[str], folder: Path) -> subprocess.Popen[bytes]:
    environment = os.environ | {
        "TMPDIR": str(folder / "tmp"),
        "OMP_NUM_THREADS": "1",
        "PYTHONPATH": str(Path(__file__).parents[2]),
    }
    return subprocess.Popen(
        [sys.executable, "-m", "tirelog", *arguments], preexec_fn=_default_signals, cwd=folder,
        env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip


def alive(session: int) -> list[int]:
    """Processes of a session that are no zombies."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            fields = (
                (entry / "stat").read_text().rpartition(")")[2].split()
                if entry.name.isdigit()
                else []
            )
        except OSError:
            continue
        if fields and int(fields[3]) == session and fields[0] != "Z":
            found.append(int(entry.name))
    return found


def trial(
    arguments: list[str],
    top: Path,
    whole: dict[str, object],
    seconds: float,
    rng: np.random.Generator,
    inputs: Path,
) -> list[str]:
    """Kill a command once, start it again; what was wrong."""
    folder = top / "trial"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(inputs, folder)
    (folder / "out").mkdir()
    (folder / "tmp").mkdir()
    old: dict[str, object] = {}
    if rng.random() < 0.5 and len(whole) == 1:
        (name,) = whole
        (folder / "out" / name).write_bytes(b"older\n" if not name.endswith(".h5") else b"")
        old = {} if name.endswith(".h5") else {name: b"older\n"}
        if name.endswith(".h5"):
            (folder / "out" / name).unlink()
    sent = SIGNALS[int(rng.integers(len(SIGNALS)))]
    process = started(arguments, folder)
    time.sleep(float(rng.uniform(0.0, 1.1 * seconds)))
    process.send_signal(sent)
    process.wait()
    faults = []
    deadline = time.monotonic() + PATIENCE_S
    while alive(process.pid) and time.monotonic() < deadline:
        time.sleep(0.1)
    for left in alive(process.pid):
        faults.append("process left")
        os.kill(left, signal.SIGKILL)
    for path in (folder / "out").rglob("*"):
        name = str(path.relative_to(folder / "out"))
        if (
            path.is_file()
            and ".tirelog" not in path.parts
            and not path.name.endswith(".part")
            and path.name[0] != "."
        ):
            if name not in whole and name not in old:
                faults.append(f"partial result {name}")
            elif contents(path) not in (whole.get(name), old.get(name)) and not name.startswith(
                "summary"
            ):
                faults.append(f"other result {name}")
    if sent != signal.SIGKILL and process.returncode not in (0, 130, 143, 129, -sent):
        faults.append(f"status {process.returncode} after {sent.name}")
    again = started(arguments, folder)
    if again.wait() != 0:
        faults.append(f"status {again.returncode} at the next start")
    now = results(folder / "out")
    faults += [
        f"next start gives another {name}"
        for name in sorted(now.keys() | whole.keys())
        if now.get(name) != whole.get(name)
    ]
    if left_over := [str(p) for p in (folder / "tmp").iterdir()]:
        faults.append(f"left in the temporary folder ({len(left_over)})")
    if [p for p in (folder / "out").rglob("*") if p.name.endswith(".part")]:
        faults.append("part of a file left")
    return [f"{sent.name}: {fault}" for fault in faults]


def undisturbed(arguments: list[str], top: Path, inputs: Path) -> tuple[dict[str, object], float]:
    """Results and seconds of a run that nobody disturbs."""
    folder = top / "whole"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(inputs, folder)
    (folder / "out").mkdir()
    (folder / "tmp").mkdir()
    began = time.monotonic()
    if started(arguments, folder).wait():
        sys.exit(f"tirelog {' '.join(arguments)} fails on good input")
    return results(folder / "out"), time.monotonic() - began


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz.kills", description=__doc__)
    parser.add_argument("--tables", type=int, default=200)
    parser.add_argument("--campaigns", type=int, default=60)
    parser.add_argument("--seed", type=int, default=None)
    asked = parser.parse_args()
    seed = secrets.randbelow(2**31) if asked.seed is None else asked.seed
    print(f"seed {seed}", flush=True)
    rng = np.random.default_rng(seed)
    faults: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(prefix="kills-") as made:
        top = Path(made)
        inputs = top / "inputs"
        (inputs / "logs").mkdir(parents=True)
        (inputs / "log.csv").write_text(log_text(60.0, 12.0))
        (inputs / "log.toml").write_text(
            SETUP.format(strain="CH1", twin="CH2", log='time = "time_s"')
        )
        (inputs / "campaign.toml").write_text(CAMPAIGN)
        for number in range(3):
            (inputs / "logs" / f"run_{number}.csv").write_text(log_text(10.0, 9.0 + number))
        for name, arguments in COMMANDS.items():
            undisturbed(arguments, top, inputs)  # compiles
            whole, seconds = undisturbed(arguments, top, inputs)
            count = asked.tables // len(COMMANDS) + (name == "ingest") * (
                asked.tables % len(COMMANDS)
            )
            for _ in range(count):
                faults.update(
                    f"{name}: {fault}"
                    for fault in trial(arguments, top, whole, seconds, rng, inputs)
                )
            print(f"{name}: {count} kills within {1.1 * seconds:.1f} s", flush=True)
        if asked.campaigns:
            arguments = ["campaign", "run", "campaign.toml", "--workers", "2"]
            whole, seconds = undisturbed(arguments, top, inputs)
            for _ in range(asked.campaigns):
                faults.update(
                    f"campaign: {fault}"
                    for fault in trial(arguments, top, whole, seconds, rng, inputs)
                )
            print(f"campaign: {asked.campaigns} kills within {1.1 * seconds:.1f} s", flush=True)
    for fault, count in faults.most_common():
        print(f"{count:4d}  {fault}")
    print("no fault" if not faults else f"{sum(faults.values())} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
