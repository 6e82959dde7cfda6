"""`python -m benchmarks.fuzz.guided [FOLDER] [SECONDS]`: inputs that reach new lines of readers.

Coverage-guided fuzzing by atheris (`pip install atheris`), from the inputs of
`tests/faults/corpus.zip` in FOLDER, to which it adds those that reach what none did. A reader may
refuse a file, and nothing else: another exception, a hang or much memory ends the run, and its
input is kept beside FOLDER. A test reads the corpus each time.
"""

from __future__ import annotations

import sys
import tempfile
import zipfile
from importlib import import_module
from pathlib import Path

CORPUS = Path(__file__).parents[2] / "tests" / "faults" / "corpus.zip"
#: modules with compiled kernels, which must not be watched
WITH_KERNELS = ("data.setup", "readers.mcap.records", "runs.store")
SOURCES = ("a", "#2", "/t:a", "/a")
#: no units, so that what a log states is looked at
SETUP = "".join(
    f'[channels.c{k}]\nkind = "signal"\nsource = "{source}"\n' for k, source in enumerate(SOURCES)
)


def read(data: bytes) -> None:
    """Reads a log of these bytes, whatever it is.  Raises what no reader may raise."""
    from tirelog.data.setup import parse_setup
    from tirelog.errors import TirelogError
    from tirelog.runs.ingest import open_recording

    with tempfile.NamedTemporaryFile() as file:
        file.write(data)
        file.flush()
        try:
            with open_recording(file.name, parse_setup(SETUP, "setup.toml")) as recording:
                for channel in recording.channels.values():
                    channel.read()
                    channel.axis.time()
        except TirelogError:
            pass


def main(folder: str = "fuzz_corpus", seconds: str = "60") -> None:
    """Runs until the time is over or something is wrong."""
    import atheris

    for name in WITH_KERNELS:
        import_module(f"tirelog.{name}")
    with atheris.instrument_imports(include=["tirelog.readers", "tirelog.runs"]):
        for name in ("readers.text.reader", "readers.mcap.reader", "readers.hdf5.reader"):
            import_module(f"tirelog.{name}")
        import_module("tirelog.runs.ingest")
    if not Path(folder).exists():
        zipfile.ZipFile(CORPUS).extractall(folder)
    beside = f"-artifact_prefix={Path(folder).resolve().parent}/"
    limits = [f"-max_total_time={seconds}", "-max_len=8192", "-timeout=20", "-rss_limit_mb=2000"]
    atheris.Setup([sys.argv[0], folder, beside, *limits], read)
    atheris.Fuzz()


if __name__ == "__main__":
    main(*sys.argv[1:])
