"""Run every benchmark, one process each, and say which failed.

`python -m benchmarks chain model` runs some.
"""

import subprocess
import sys
from pathlib import Path

wanted = sys.argv[1:]
failed = []
for path in sorted(Path(__file__).parent.glob("bench_*.py")):
    name = path.stem.removeprefix("bench_")
    if wanted and name not in wanted:
        continue
    print(f"== {name}", flush=True)
    if subprocess.run([sys.executable, "-m", f"benchmarks.{path.stem}"], check=False).returncode:
        failed.append(name)
if failed:
    sys.exit(f"failed: {', '.join(failed)}")
