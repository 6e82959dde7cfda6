"""Text to arrays: our reader with its clock against pandas, whole file and in chunks, each in a
process of its own.

TIRELOG_BENCH_TEXT_MINUTES sets the length of the log (default 10: 0.32 GB; 60 for the hour of the
goals). The reader gives stamps, lost samples and flags beside the numbers; pandas gives the numbers
alone.
"""

import os
import sys
import tempfile
from pathlib import Path

from benchmarks.family import FAMILY, write
from benchmarks.measure import apart, cost, median

OURS = """
from tirelog.runs.clock import ClockFit
from tirelog.readers.text.reader import open_text
from tirelog.data.setup import load_setup
reader = open_text(r"{log}", load_setup(r"{setup}"), "log")
clock = ClockFit(resolution_s=reader.groups[0].stamp_resolution_s)
for block in reader.blocks():
    clock.add(block.stamps_s, block.number, next(iter(block.values.values())).size)
assert clock.axis().rate_Hz == 2500.0 and not reader.report.losses
"""
WHOLE = 'import pandas as pd\npd.read_csv(r"{log}").to_numpy()'
CHUNKS = (
    'import pandas as pd\nfor part in pd.read_csv(r"{log}", chunksize=50_000):\n    part.to_numpy()'
)
WAYS = {"tirelog": OURS, "pandas, whole file": WHOLE, "pandas, in chunks": CHUNKS}


def main() -> None:
    minutes = float(os.environ.get("TIRELOG_BENCH_TEXT_MINUTES", "10"))
    with tempfile.TemporaryDirectory() as name:
        log = Path(name) / "log.csv"
        apart(write, FAMILY[0], log, minutes)
        size_MB = log.stat().st_size / 1e6
        print(
            f"{minutes:g} min x 16 gratings at 2.5 kHz, {size_MB:.0f} MB of text, "
            f"{os.cpu_count()} cores, median of 3"
        )
        found = {}
        for way, script in WAYS.items():
            command = [sys.executable, "-c", script.format(log=log, setup=log.with_suffix(".toml"))]
            found[way] = median([cost(command) for _ in range(3)])
            print(
                f"{way:20} {found[way]}  {size_MB / found[way].wall_s:5.0f} MB/s wall  "
                f"{size_MB / found[way].cpu_s:5.0f} MB/s a core"
            )
        ours = found["tirelog"]
        for way, other in found.items():
            if way != "tirelog":
                wall, memory = other.wall_s / ours.wall_s, other.peak_MB / ours.peak_MB
                print(f"{way} / tirelog: {wall:.2f} x wall, {memory:.1f} x memory")


if __name__ == "__main__":
    main()
