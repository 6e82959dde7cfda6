"""Real logs in a folder, each held against what another program reads in it."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator
from contextlib import redirect_stderr
from pathlib import Path

import numpy as np
import pandas as pd
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from benchmarks.layouts.judge import Verdict, read

#: wheel speeds on a vehicle's bus come in bunches: no clock is behind them
_BUS = "stamps that bunch, as text"


def real(folder: Path) -> Iterator[tuple[str, str, Verdict]]:
    """(source, file, verdict) of every log below the folder that is known here."""
    for path in sorted(folder.rglob("*.txt.gz")):
        yield path.parent.name, path.name, _interrogator(path)
    for path in sorted(folder.rglob("in_tire/*.csv.gz")):
        yield path.parent.name, path.name, _in_tire(path)
    for path in sorted(folder.rglob("*.mcap")):
        yield path.parent.name, path.name, _messages(path)
    for path in sorted(folder.rglob("*_t.npy")):
        yield path.parent.name, f"{path.stem.removesuffix('_t')}: {_BUS}", _bus(path)
    for path in sorted(folder.rglob("*_value.npy")):
        yield path.parent.name, path.name, read(path, _setup("#1"), refused="numpy.load")


def _setup(*sources: str, log: str = "", kind: str = "signal") -> str:
    text = "".join(
        f'[channels.c{k}]\nkind = "{kind}"\nsource = "{source}"\n'
        for k, source in enumerate(sources)
    )
    return text + (f"[log]\n{log}\n" if log else "")


def _interrogator(path: Path) -> Verdict:
    """Strains and temperatures; the clock is the line number, at 20 Hz."""
    table = pd.read_csv(path, sep="\t", usecols=["Linenumber", "W-N-01", "T-N-06", "B-S-04"])
    number = table["Linenumber"].to_numpy(float)
    truth = {f"c{k}": table[name].to_numpy(float) for k, name in enumerate(table.columns[1:])}
    return read(path, _setup(*table.columns[1:]), truth, (number - number[0]) / 20.0, 1e-9)


def _in_tire(path: Path) -> Verdict:
    """The accelerometer has no time column; 25 kHz is what its level and speed agree at."""
    table = pd.read_csv(path)
    names = [name for name in table.columns if name != "time_s"]
    truth = {f"c{k}": table[name].to_numpy(float) for k, name in enumerate(names)}
    stamped = "time_s" in table.columns
    times = table["time_s"].to_numpy(float) if stamped else np.arange(len(table)) / 25_000.0
    return read(
        path,
        _setup(*names, log="" if stamped else "sampling_rate_Hz = 25000.0"),
        truth,
        times,
        1e-9,
    )


def _bus(path: Path) -> Verdict:
    """Stamps and values of two arrays, written as a table."""
    stamps = np.load(path)
    values = np.load(path.with_name(path.name.replace("_t.npy", "_value.npy")))
    names = [f"v{k}" for k in range(values.shape[1])]
    with tempfile.TemporaryDirectory(prefix="layouts-") as folder:
        log = Path(folder) / "log.csv"
        table = pd.DataFrame(values, columns=names)
        table.insert(0, "time_s", stamps)
        table.to_csv(log, index=False)
        truth = {f"c{k}": values[:, k].astype(float) for k in range(values.shape[1])}
        # an accelerometer has a clock that its stamps show to a tenth of a period
        return read(log, _setup(*names), truth, stamps - stamps[0], 0.011)


def _messages(path: Path) -> Verdict:
    """The first plain number of the first topic that has one, by ROS's own decoder."""
    found: dict[tuple[str, str], list[float]] = {}
    topics: set[str] = set()
    decoder, decoders = DecoderFactory(), {}
    # the decoder prints what it does not understand
    with path.open("rb") as stream, redirect_stderr(io.StringIO()):
        for schema, channel, message in make_reader(stream).iter_messages():
            topics.add(channel.topic)
            try:
                if channel.id not in decoders:
                    decoders[channel.id] = decoder.decoder_for(channel.message_encoding, schema)
                decoded = decoders[channel.id](message.data)
            except Exception:  # an encoding or a schema that ROS does not decode either
                continue
            for name in getattr(decoded, "__slots__", ()):
                value = getattr(decoded, name)
                if isinstance(value, int | float):
                    found.setdefault((channel.topic, name), []).append(float(value))
    if not found:
        topic = min(topics, default="/nowhere")
        why = "not in the log" if not topics else topic
        return read(path, _setup(f"{topic}:data"), refused=why)
    (topic, name), values = next(iter(found.items()))
    return read(path, _setup(f"{topic}:{name}"), {"c0": np.array(values)}, None, np.inf)
