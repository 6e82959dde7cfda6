"""The generated files in formats that a library reads, each with the library that it needs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.feather

from benchmarks.layouts import writers
from benchmarks.layouts.generated import RATE_HZ, ROWS, T, V, setup
from benchmarks.layouts.judge import Case

_BOTH = {"a": V[0], "b": V[1]}
_COLUMNS = {"inner": V[0], "outer": V[1]}


def _case(
    needs: str, source: str, layout: str, name: str, write: Callable[[Path], object], *sources: str,
    **more: object,
) -> Case:  # fmt: skip
    given = {"truth": _BOTH, **more}
    return Case(source, layout, name, write, setup(*sources), needs=needs, **given)  # type: ignore[arg-type]


def _cut(path: Path) -> None:
    writers.tdms(path, _COLUMNS, RATE_HZ)
    path.write_bytes(path.read_bytes()[:-1600])


def _tdms() -> Iterator[Case]:
    def case(layout: str, write: Callable[[Path], object], **more: object) -> Case:
        names = ("/run/inner", "/run/outer")
        return _case("nptdms", "TDMS", layout, "log.tdms", write, *names, **more)

    yield case("waveforms in segments", lambda path: writers.tdms(path, _COLUMNS, RATE_HZ))
    yield case("one segment", lambda path: writers.tdms(path, _COLUMNS, RATE_HZ, 1))
    yield case(
        "dates in a channel, text beside",
        lambda path: writers.tdms_dated(path, _COLUMNS, T),
        said="note holds no real numbers",
    )
    yield case("cut in its last segment", _cut, said="cut off")
    yield case(
        "whole numbers and single precision",
        lambda path: writers.tdms(
            path, {"inner": V[0].astype("f4"), "outer": np.round(V[1]).astype("i2")}, RATE_HZ
        ),
        truth={"a": V[0].astype("f4").astype(float), "b": np.round(V[1])},
    )


def _excel() -> Iterator[Case]:
    def case(layout: str, sheets: dict, **more: object) -> Case:
        return _case(
            "python_calamine",
            "Excel",
            layout,
            "log.xlsx",
            lambda path: writers.xlsx(path, sheets),
            "inner",
            "outer",
            **more,
        )

    rows = [[float(t), float(a), float(b)] for t, a, b in zip(T, V[0], V[1], strict=True)]
    stamps = np.datetime64("2026-03-04T10:00:00", "us") + np.round(T * 1e6).astype("m8[us]")
    dated = [[stamp, *row[1:]] for stamp, row in zip(stamps, rows, strict=True)]
    head = ["time [s]", "inner", "outer"]
    yield case("a header and numbers", {"Sheet1": [head, *rows]})
    yield case(
        "a title, an empty row, units below the names",
        {"run": [["Drum test 7"], [], ["time", "inner", "outer"], ["s", "K", "K"], *rows]},
    )
    yield case("dates in a column", {"run": [["when", *head[1:]], *dated]}, time_error_s=2e-3)
    yield case(
        "notes on a sheet before it",
        {"notes": [["driver", "B"], ["load", 3.4]], "run": [head, *rows]},
        said="sheet run is read, not notes",
    )
    yield case("no numbers at all", {"notes": [["driver", "B"]]}, truth={}, refused="no sheet has")


def _mdf() -> Iterator[Case]:
    names = ("/run/inner", "/run/outer")
    counts = {"inner": V[0], "outer": np.round(V[1] * 100).astype("u2")}
    linear = {"outer": {"a": 0.01, "b": -3.0}}

    def case(layout: str, write: Callable[[Path], object], *sources: str, **more: object) -> Case:
        return _case("asammdf", "MDF", layout, "log.mf4", write, *(sources or names), **more)

    yield case("version 4", lambda path: writers.mdf(path, _COLUMNS, RATE_HZ))
    yield case("version 4, packed", lambda path: writers.mdf(path, _COLUMNS, RATE_HZ, packed=2))
    yield case(
        "version 3",
        lambda path: writers.mdf(path, _COLUMNS, RATE_HZ, "3.30"),
        "/group_1/inner",
        "/group_1/outer",
    )
    yield case(
        "counts with a linear scale",
        lambda path: writers.mdf(path, counts, RATE_HZ, conversions=linear),
        truth={"a": V[0], "b": counts["outer"] * 0.01 - 3.0},
    )
    yield case(
        "a formula of a function, which is not evaluated",
        lambda path: writers.mdf(
            path, _COLUMNS, RATE_HZ, conversions={"outer": {"formula": "sin(X1)"}}
        ),
        truth={"a": V[0]},
        said="outer is converted by the formula",
    )


def _feather() -> Iterator[Case]:
    table = pa.table({"time_s": T, **_COLUMNS, "note": ["x"] * ROWS, "list": [[1.0]] * ROWS})

    def case(layout: str, write: Callable[[Path], object], **more: object) -> Case:
        return _case("pyarrow", "Feather", layout, "log.feather", write, *_COLUMNS, **more)

    for packing in ("uncompressed", "lz4", "zstd"):
        yield case(
            packing,
            lambda path, packing=packing: pa.feather.write_feather(
                table, path, compression=packing, chunksize=200
            ),
            said="neither numbers nor times: note, list",
        )
    yield case(
        "no numbers at all",
        lambda path: pa.feather.write_feather(table.select(["list"]), path),
        truth={},
        refused="no column of numbers",
    )


def cases() -> Iterator[Case]:
    """All of them, also those whose library is not installed."""
    yield from _tdms()
    yield from _excel()
    yield from _mdf()
    yield from _feather()
