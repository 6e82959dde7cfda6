"""Compile all loops of tirelog once, by commands on the sample logs; `make demo` does so first.

A minute here, so that no command of a user waits for the compiler. What is compiled lies beside the
sources (or in NUMBA_CACHE_DIR) and holds for this machine and version; running this again takes
seconds.
"""

import compileall
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

SAMPLES = Path(__file__).resolve().parent
TIRELOG = str(Path(sys.executable).parent / "tirelog")
#: a log with slip in it: none of the samples has any
SLIPPING = """
seed = 7
truth = "beam"
manoeuvres = [
    { duration_s = 12.0, speed_m_s = 10.0 },
    { duration_s = 4.0, speed_m_s = 24.0 },
    { duration_s = 4.0, speed_m_s = 10.0 },
]
effects = [{ name = "traction", slip_per_g = 0.6, lever_m = 0.01 }]

[channels.strain_1]
kind = "fbg_strain"
noise = 0.0008
"""
COMMANDS = (
    "tables {samples}/drive.csv.gz -o {out}/tables",
    "simulate {out}/scenario.toml -o {out}/slipping.csv",
    "footprint {out}/slipping.csv -o {out}/slipping_footprint.csv",
    "ingest {samples}/drive.csv.gz -o {out}/run.h5",
    "tables {out}/run.h5 -o {out}/of_run --format ndjson",
    "tables {samples}/drive_messages.mcap -o {out}/messages",
    "phase-shift {samples}/encoder_ramp.h5 --calibrate {out}/calibration.toml -o {out}/ramp.csv",
    "inflation {samples}/inflation.csv.gz -o {out}/inflation.csv",
    "model new --carcass beam --setup {samples}/hidden_1.toml -o {out}/beam.toml",
    "compare {samples}/hidden_1.csv.gz --model {out}/beam.toml",
    "model new --carcass ring --setup {samples}/hidden_1.toml -o {out}/ring.toml",
    "compare {samples}/hidden_1.csv.gz --model {out}/ring.toml",
)


def main() -> None:
    print("compiling once for this machine, about a minute", flush=True)
    package = find_spec("tirelog")
    for folder in (package and package.submodule_search_locations) or ():
        compileall.compile_dir(folder, quiet=1)  # Python's own step, which saves 0.4 s a command
    with tempfile.TemporaryDirectory() as out:
        (Path(out) / "scenario.toml").write_text(SLIPPING)
        for line in COMMANDS:
            command = [TIRELOG, *line.format(samples=SAMPLES, out=out).split(), "--quiet"]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                print(f"$ tirelog {line}\n{done.stderr}", file=sys.stderr)
                sys.exit(f"tirelog ended with status {done.returncode}")


if __name__ == "__main__":
    main()
