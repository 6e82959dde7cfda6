"""Text to the strain tables in one command, side by side with the plain script; each command from
an ingested run; and help.

TIRELOG_BENCH_MINUTES sets the length of the log (default 10; 60 for the hour of the goals).
"""

import os
import sys
import tempfile
from pathlib import Path

from benchmarks.family import FAMILY, write
from benchmarks.measure import Cost, apart, cost

TIRELOG = str(Path(sys.executable).parent / "tirelog")


def main() -> None:
    minutes = float(os.environ.get("TIRELOG_BENCH_MINUTES", "10"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log, run = folder / "log.csv", folder / "run.h5"
        apart(write, FAMILY[0], log, minutes)
        print(f"{minutes:g} min x 16 gratings at 2.5 kHz, {log.stat().st_size / 1e9:.2f} GB")
        plain = cost(
            [sys.executable, "-m", "benchmarks.plain_script", str(log), str(folder / "plain.csv")]
        )
        print(f"plain script             {plain}")
        whole = cost([TIRELOG, "tables", str(log), "-o", str(folder / "tables")])
        print(f"tables from the text     {whole}")
        print(_ratios(plain, whole))
        steps = [cost([TIRELOG, "ingest", str(log), "-o", str(run)])]
        print(f"ingest                   {steps[0]}")
        for table in ("speed", "footprint", "dissipation"):
            steps.append(cost([TIRELOG, table, str(run), "-o", str(folder / f"{table}.csv")]))
            print(f"{table:10} from the run  {steps[-1]}")
        ours = Cost(
            sum(s.wall_s for s in steps), sum(s.cpu_s for s in steps), max(s.peak_MB for s in steps)
        )
        print(f"ingest and all three     {ours}")
        print(_ratios(plain, ours))
    for arguments in (["--help"], ["speed", "--help"]):
        best = min((cost([TIRELOG, *arguments]) for _ in range(7)), key=lambda c: c.cpu_s)
        print(f"tirelog {' '.join(arguments):16} {best}")


def _ratios(plain: Cost, ours: Cost) -> str:
    """The plain script's cost in units of ours."""
    parts = plain.wall_s / ours.wall_s, plain.cpu_s / ours.cpu_s, plain.peak_MB / ours.peak_MB
    return "plain / tirelog: {:.2f} x wall, {:.2f} x cpu, {:.1f} x memory".format(*parts)


if __name__ == "__main__":
    main()
