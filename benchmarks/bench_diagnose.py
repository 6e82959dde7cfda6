"""`diagnose` on about 2,000 revolutions x 256 angles x 16 candidates: nothing hidden, one effect, a
pair. Goal: 20 s on two cores.
"""

import time

from benchmarks.cases import Case, case
from tirelog.diagnosis.diagnose import diagnose
from tirelog.inference.stacks.cut import stacks_from_logs
from tirelog.physics.model.model import Model
from tirelog.simulation import simulate, to_recording

HIDDEN: tuple[tuple[str, ...], ...] = ((), ("viscous_damping",), ("water_film", "load_transfer"))


def main() -> None:
    for effects in HIDDEN:
        logs = case(effects, seed=900, how=Case(logs=4, duration=1.07))
        recordings = [to_recording(simulate(log), f"log_{i}") for i, log in enumerate(logs)]
        begun, cpu = time.perf_counter(), time.process_time()
        stacks = stacks_from_logs(recordings)
        result = diagnose(stacks, Model.new("beam", radius_m=0.305))
        wall, used = time.perf_counter() - begun, time.process_time() - cpu
        tested = len(result.effects) + len(result.not_tested)
        print(
            f"{result.revolutions} revolutions x {stacks[0].phi_rad.size} angles x {tested} "
            f"candidates: {wall:.1f} s, {used:.1f} s cpu"
        )
        print(
            f"    hidden: {' '.join(effects) or 'nothing'}; said: {result.verdict} "
            f"{' '.join(result.selected)}"
        )


if __name__ == "__main__":
    main()
