"""`python -m benchmarks.fuzz.guided CORPUS [SECONDS]`: inputs that reach new lines of the readers.

Coverage-guided fuzzing by atheris (`pip install atheris`), from small files of a folder, to which
it adds those that reach what none did. A reader may refuse a file, and nothing else: another
exception, a hang or much memory ends the run, and its input is kept beside the corpus.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import atheris

# imported before, and so not watched: what has compiled kernels
import tirelog.data.plausibility
import tirelog.readers.mcap.records
import tirelog.readers.text.kernels
import tirelog.runs.store

with atheris.instrument_imports(include=["tirelog.readers", "tirelog.runs"]):
    from tirelog.data.setup import parse_setup
    from tirelog.errors import TirelogError
    from tirelog.readers.hdf5 import reader as _hdf5
    from tirelog.readers.mcap import reader as _mcap
    from tirelog.readers.text import reader as _text
    from tirelog.runs.ingest import open_recording

#: no unit, so that what a log states is looked at
SETUP = parse_setup(
    "".join(
        f'[channels.c{k}]\nkind = "signal"\nsource = "{source}"\n'
        for k, source in enumerate(("a", "#2", "/t:a", "/a"))
    ),
    "setup.toml",
)


def read(data: bytes) -> None:
    """Reads a log of these bytes, whatever it is.  Raises what no reader may raise."""
    with tempfile.NamedTemporaryFile() as file:
        file.write(data)
        file.flush()
        try:
            with open_recording(file.name, SETUP) as recording:
                for channel in recording.channels.values():
                    channel.read(), channel.axis.time()
        except TirelogError:
            pass


def main(corpus: str, seconds: str = "60") -> None:
    """Runs until the time is over or something is wrong."""
    kept = Path(corpus).resolve().parent
    limits = [f"-max_total_time={seconds}", "-max_len=4096", "-timeout=20", "-rss_limit_mb=2000"]
    atheris.Setup([sys.argv[0], corpus, f"-artifact_prefix={kept}/", *limits], read)
    atheris.Fuzz()


if __name__ == "__main__":
    main(*sys.argv[1:])
