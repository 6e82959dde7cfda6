"""An effect that only differences between logs reveal: a campaign finds it, each of its logs alone
does not, and says why.

    python -m benchmarks.between_logs [--seeds 8000:8010] [--effects stiffening,water_film]

`stiffening`: short logs at one speed under six loads; `water_film`: the same in six depths of
water. All by the command line: scenarios by `simulate`, `campaign run` with a manifest, `diagnose`
on each log. Seeds below 1000 are for choosing sizes, from 8000 on for reporting.
"""

from __future__ import annotations

import argparse
import json
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden import wilson
from tirelog.cli import run

LOADS_N = tuple(3434.0 * factor for factor in (0.7, 0.85, 1.0, 1.15, 1.3, 1.0))
WATER_MM = (0.0, 0.5, 1.0, 1.5, 2.0, 0.8)
#: planted, and which condition differs between the logs; stiffening so weak that one load does not
#: show it
HIDDEN = {
    "stiffening": ("cubic_1_m2 = 100.0", "load_N", LOADS_N),
    "water_film": ("amplitude = 0.08\nlength = 0.4", "water_depth_mm", WATER_MM),
}
MANIFEST = """[campaign]
output = "results"
[[logs]]
glob = "logs/*.csv"
[tables.speed]
[[models]]
file = "beam.toml"
commands = ["compare", "diagnose", "ladder"]
"""


def scenario(effect: str, log: int, random: np.random.Generator) -> str:
    """Cruises at one speed, parted by short lifts of the foot: many manoeuvres, half a minute."""
    planted, condition, values = HIDDEN[effect]
    conditions = {
        "load_N": LOADS_N[2],
        "water_depth_mm": 0.5,
        "distance_km": 1200.0,
        condition: values[log],
    }
    speed = 14.0 + random.uniform(-0.5, 0.5)
    drive = [
        x
        for _ in range(5)
        for x in ((3.0 + random.uniform(-0.3, 0.3), speed), (1.2, speed - 0.8), (1.2, speed))
    ]
    text = (
        f'seed = {random.integers(2**31)}\ntruth = "beam"\n[road]\nroughness = 0.01\n[conditions]\n'
    )
    text += "".join(f"{name} = {value}\n" for name, value in conditions.items())
    text += "".join(
        f"[[manoeuvres]]\nduration_s = {seconds:.3f}\nspeed_m_s = {to:.3f}\n"
        for seconds, to in drive
    )
    text += (
        '[channels.strain_1]\nkind = "fbg_strain"\nsource = "CH1"\n'
        f'angle_deg = {random.uniform(0, 360):.1f}\nsurface = "outer"\n'
    )
    text += "noise = 0.0008\nquantisation = 0.0001\nreference_wavelength_nm = 1550.0\n"
    return text + f'[[effects]]\nname = "{effect}"\n{planted}\n'


def make(folder: Path, effect: str, seed: int) -> tuple[Path, list[Path]]:
    """(manifest, logs) in `folder`."""
    random = np.random.default_rng(seed)
    (folder / "logs").mkdir(parents=True)
    logs = []
    for number in range(len(LOADS_N)):
        described = folder / f"scenario_{number}.toml"
        described.write_text(scenario(effect, number, random))
        logs.append(folder / "logs" / f"log_{number}.csv")
        _done("simulate", described, "-o", logs[-1], "--quiet")
    _done(
        "model",
        "new",
        "--carcass",
        "beam",
        "--setup",
        logs[0].with_suffix(".toml"),
        "-o",
        folder / "beam.toml",
    )
    (folder / "campaign.toml").write_text(MANIFEST)
    return folder / "campaign.toml", logs


def _done(*arguments: object) -> None:
    status = run([str(a) for a in arguments])
    if status:
        raise RuntimeError(f"{arguments} ended with {status}")


def of_campaign(manifest: Path) -> dict[str, Any]:
    """The campaign's diagnosis."""
    _done("campaign", "run", manifest, "--quiet")
    result: dict[str, Any] = json.loads(
        (manifest.parent / "results" / "models" / "beam" / "diagnose.json").read_text()
    )
    return result


def of_log(log: Path, model: Path) -> dict[str, Any]:
    """One log's diagnosis."""
    answer = log.with_suffix(".diagnosis.json")
    _done("diagnose", log, "--model", model, "-o", answer, "--quiet")
    result: dict[str, Any] = json.loads(answer.read_text())
    answer.unlink()
    return result


def named_alone(result: dict[str, Any], effect: str) -> bool:
    """The verdict is the effect, and nothing beside or in place of it."""
    return result["verdict"] == "missing" and result["selected"] == [effect]


def says_so(result: dict[str, Any], effect: str) -> bool:
    """One log's answer: the effect is not claimed (nothing, a set, unknown), and what does not vary
    is said, with who follows it.
    """
    word = {"stiffening": "load", "water_film": "water depth"}[effect]
    unclaimed = result["verdict"] in ("nothing_missing", "ambiguous", "too_few", "unknown")
    same, _, followers = result["note"].partition("Effects that follow them")
    return unclaimed and word in same and effect in followers


def cases(effects: list[str], seeds: range) -> Iterator[str]:
    """A line a campaign, and the rates."""
    for effect in effects:
        found = single = logs_of_all = 0
        for seed in seeds:
            folder = Path(tempfile.mkdtemp(prefix="tirelog-between-"))
            manifest, logs = make(folder, effect, seed)
            whole = of_campaign(manifest)
            ones = [of_log(log, folder / "beam.toml") for log in logs]
            shutil.rmtree(folder)
            silent = [says_so(one, effect) for one in ones]
            found, single, logs_of_all = (
                found + named_alone(whole, effect),
                single + sum(silent),
                logs_of_all + len(silent),
            )
            answers = [f"{one['verdict']} {' '.join(one['selected'])}".strip() for one in ones]
            yield (
                f"{effect} {seed}: campaign {whole['verdict']} {' '.join(whole['selected'])}; "
                f"single logs {', '.join(answers)}"
            )
        yield f"{effect}: named alone by the campaign    {wilson(found, len(seeds))}"
        yield f"{effect}: not claimed from one log, and said {wilson(single, logs_of_all)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="8000:8010")
    parser.add_argument("--effects", default=",".join(HIDDEN))
    options = parser.parse_args()
    first, last = (int(x) for x in options.seeds.split(":"))
    for line in cases(options.effects.split(","), range(first, last)):
        print(line, flush=True)


if __name__ == "__main__":
    main()
