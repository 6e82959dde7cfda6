"""`diagnose --channel all` on two logs of a minute with 4 and with 16 gratings, whole process:
nothing hidden, run-out, an effect.  Goal: 60 s and 1 GB for sixteen.

Run-out is the wheel's, the effect the road's; the reader of the text is in it.
"""

import sys
import tempfile
from pathlib import Path

import tirelog
from benchmarks.measure import cost
from benchmarks.nuisance_worlds import CaseOf
from tirelog.physics.model.from_setup import new_model
from tirelog.simulation import scenario_of, simulate, write_log

TIRELOG = str(Path(sys.executable).parent / "tirelog")
SEED = 900
#: world and effect, whose strength is half of its ordinary one
CASES = (("control", ""), ("run_out_30", ""), ("control", "viscous_damping"))


def written(world: str, effect: str, gratings: int, folder: Path) -> tuple[list[Path], Path]:
    """(logs, model file) of a case, its gratings evenly about the wheel but for a degree or two."""
    logs = []
    for number, tables in enumerate(CaseOf(world, SEED, "beam", effect, 0.5).tables(), start=1):
        one = tables["channels"].pop("strain_1")
        for i in range(gratings):
            angle = round(360.0 * i / gratings + (i * 7 % 5) * 0.4, 1)
            own = {**one, "source": f"CH{i + 1}", "angle_deg": angle}
            tables["channels"][f"g{i + 1}"] = own
        logs.append(write_log(simulate(scenario_of(tables)), folder / f"log_{number}.csv")[0])
    with tirelog.open_log(logs[0]) as log:
        model, _ = new_model("beam", log.setup)
    tirelog.save_model(model, folder / "model.toml")
    return logs, folder / "model.toml"


def main() -> None:
    for gratings in (4, 16):
        for world, effect in CASES:
            with tempfile.TemporaryDirectory() as scratch:
                logs, model = written(world, effect, gratings, Path(scratch))
                command = [TIRELOG, "diagnose", *map(str, logs), "--model", str(model)]
                spent = cost([*command, "--channel", "all", "--quiet"])
            print(f"{gratings:2} gratings, {effect or world:16} {spent}", flush=True)


if __name__ == "__main__":
    main()
