"""What series mean, in every format that can hold them: units, times, starts, headers, codes."""

from __future__ import annotations

import gzip
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from benchmarks.layouts import writers
from benchmarks.layouts.generated import RATE_HZ, ROWS, T, V, channel, setup, table, text_case
from benchmarks.layouts.judge import Case

Columns = Mapping[str, NDArray]
A, B = ([f"{x:.4f}" for x in v] for v in V[:2])
BOTH = {"a": V[0], "b": V[1]}


# ---- Formats: how columns (n,) and their times are written, and what a source is then called.


def _text(path: Path, columns: Columns, times: NDArray, name: str) -> None:
    pd.DataFrame({name: times, **columns}).to_csv(path, index=False)


def _parquet(path: Path, columns: Columns, times: NDArray, name: str) -> None:
    pd.DataFrame({name: times, **columns}).to_parquet(path)


def _feather(path: Path, columns: Columns, times: NDArray, name: str) -> None:
    pd.DataFrame({name: times, **columns}).to_feather(path)


def _hdf5(path: Path, columns: Columns, times: NDArray, name: str) -> None:
    with h5py.File(path, "w") as file:
        file.update({name: times, **columns})


def _matlab(path: Path, columns: Columns, times: NDArray, name: str) -> None:
    from scipy.io import savemat

    savemat(path, {name: times, **columns})


def _matrix(path: Path, columns: Columns, times: NDArray, name: str) -> None:
    from scipy.io import savemat

    savemat(path, {"data": np.vstack([times, *columns.values()])})


def _tdms(path: Path, columns: Columns, times: NDArray, name: str) -> None:
    writers.tdms(path, columns, RATE_HZ, unit="")


def _mdf(path: Path, columns: Columns, times: NDArray, name: str) -> None:
    writers.mdf(path, columns, RATE_HZ, unit="")


#: format -> (name of its files, library, writer, what a column is called in a source)
FORMATS: dict[str, tuple[str, str, Callable[..., None], Callable[[int, str], str]]] = {
    "text": ("log.csv", "", _text, lambda k, name: name),
    "Parquet": ("log.parquet", "", _parquet, lambda k, name: name),
    "Feather": ("log.feather", "", _feather, lambda k, name: name),
    "HDF5": ("log.h5", "", _hdf5, lambda k, name: f"/{name}"),
    "MATLAB 5": ("log.mat", "", _matlab, lambda k, name: f"/{name}"),
    "a MATLAB matrix": ("log.mat", "", _matrix, lambda k, name: f"/data[{k + 1}]"),
    "TDMS": ("log.tdms", "nptdms", _tdms, lambda k, name: f"/run/{name}"),
    "MDF": ("log.mf4", "asammdf", _mdf, lambda k, name: f"/run/{name}"),
}
_WITH_NAMES = ("text", "Parquet", "Feather", "HDF5", "TDMS", "MDF")
_WITH_TIMES = ("text", "Parquet", "Feather", "HDF5", "MATLAB 5", "a MATLAB matrix")


def _units() -> Iterator[Case]:
    """A unit in a name is that of a channel without one."""
    for name, kind, factor, offset in (
        ("Acc Z (g)", "radial_acceleration", 9.80665, 0.0),
        ("Speed [km/h]", "vehicle_speed", 1.0 / 3.6, 0.0),
        ("Fz (kN)", "vertical_load", 1e3, 0.0),
        ("Tire Pressure (psi)", "inflation_pressure", 6894.757293168361, 0.0),
        ("T 1 (°C)", "temperature", 1.0, 273.15),
        ("eps [microstrain]", "strain", 1e-6, 0.0),
    ):
        for format in _WITH_NAMES:
            file, needs, write, source = FORMATS[format]
            spelt = re.sub(r"[/\[\]:]+", "_", name) if needs else name
            if format == "HDF5" and "/" in name:  # is a path there
                continue
            use = channel("a", source(0, spelt), "").replace("temperature", kind)
            yield Case(
                format,
                f"unit in the name: {name}",
                file,
                lambda path, write=write, name=name: write(path, {name: V[0]}, T, "time_s"),
                use,
                {"a": V[0] * factor + offset},
                needs=needs,
            )


#: unit -> (stamps as they are stored, error [s] of what that type can hold)
_STAMPS: dict[str, tuple[NDArray, float]] = {
    "s since 1970": (1_772_600_000.0 + T, 1e-6),
    "ms since 1970": (1_772_600_000_000 + np.round(T * 1e3).astype(np.int64), 1e-9),
    "us since 1970": (1_772_600_000_000_000 + np.round(T * 1e6).astype(np.int64), 1e-9),
    "ns since 1970": (1_772_600_000_000_000_000 + np.round(T * 1e9).astype(np.int64), 1e-6),
    "FILETIME": (134_170_736_000_000_000 + np.round(T * 1e7).astype(np.int64), 1e-5),
    "ticks of .NET": (639_081_968_000_000_000 + np.round(T * 1e7).astype(np.int64), 1e-5),
    "days of MATLAB": (740_045.2 + T / 86_400.0, 2e-5),
    "days of a spreadsheet": (46_085.2 + T / 86_400.0, 1e-6),
    "seconds of the run": (0.5 + T, 1e-9),
}


def _times() -> Iterator[Case]:
    """A time by its name, and one without, in units that nothing states."""
    for what, (stamps, error) in _STAMPS.items():
        for format in _WITH_TIMES:
            file, needs, write, source = FORMATS[format]
            for name in ("timestamp", "stamp_1"):
                if format == "a MATLAB matrix" and name == "timestamp":
                    continue
                yield Case(
                    format,
                    f"{what}, named {name}",
                    file,
                    lambda path, write=write, name=name, stamps=stamps: write(
                        path, {"a": V[0], "b": V[1]}, stamps, name
                    ),
                    setup(source(0, "a"), source(1, "b")),
                    BOTH,
                    time_error_s=error,
                    needs=needs,
                )

    spans = pd.DataFrame({"a": V[0], "b": V[1]}, index=pd.to_timedelta(T, unit="s"))
    yield Case("Parquet", "an index of spans, without a name", "log.parquet", spans.to_parquet,
               setup("a", "b"), BOTH)  # fmt: skip


def _starts() -> Iterator[Case]:
    """Channels with clocks and beginnings of their own."""
    slow, many = V[1][: ROWS // 4], ROWS // 4
    own = {"a": T, "b": 3.25 + np.arange(many) / 20.0}
    truth = {"a": V[0], "b": slow}

    def case(format: str, layout: str, name: str, write: object, use: str, **more: object) -> Case:
        given = {"own_times_s": own, "truth": truth, "time_error_s": 1e-6, **more}
        return Case(format, layout, name, write, use, **given)  # type: ignore[arg-type]

    def tdms(path: Path) -> None:
        from nptdms import ChannelObject, TdmsWriter

        start = np.datetime64("2026-03-29T11:59:55")
        early = {"wf_increment": 0.01, "wf_start_offset": 0.0, "wf_start_time": start}
        late = {"wf_increment": 0.05, "wf_start_offset": 0.25}
        late["wf_start_time"] = start + np.timedelta64(3, "s")
        with TdmsWriter(str(path)) as writer:
            writer.write_segment(
                [ChannelObject("g", "a", V[0], early), ChannelObject("g", "b", slow, late)]
            )

    def hdf5(path: Path) -> None:
        with h5py.File(path, "w") as file:
            for name, values, step, begin in (("a", V[0], 0.01, 1.0), ("b", slow, 0.05, 4.25)):
                file[name] = values
                file[name].attrs.update(wf_increment=step, wf_start_offset=begin)

    def mdf(path: Path) -> None:
        from asammdf import MDF, Signal

        with MDF(version="4.10") as file:
            for name, values in truth.items():
                file.append([Signal(values, own[name] + 2.0, name=name)], acq_name=name)
            Path(file.save(path, overwrite=True)).replace(path)

    yield case("TDMS", "start times and offsets", "log.tdms", tdms, setup("/g/a", "/g/b"),
               needs="nptdms")  # fmt: skip
    yield case("HDF5", "wf_start_offset", "log.h5", hdf5, setup("/a", "/b"))
    yield case("MDF", "groups that begin apart", "log.mf4", mdf, setup("/a/a", "/b/b"),
               needs="asammdf")  # fmt: skip

    blank = [""] * (ROWS - many)
    pairs = [[f"{x:.3f}" for x in T], A, [f"{x:.3f}" for x in own["b"]] + blank, B[:many] + blank]
    lvm = (
        "LabVIEW Measurement\t\nX_Columns\tMulti\n***End_of_Header***\t\n\t\nChannels\t2\t\t\t\n"
        "Y_Unit_Label\tK\t\tK\t\nX_Dimension\tTime\t\tTime\t\nDelta_X\t0.01\t\t0.05\t\n"
        "***End_of_Header***\t\t\t\t\n"
    )
    for layout, head, separator in (
        ("X_Value before each channel", lvm + "X_Value\ta\tX_Value\tb\n", "\t"),
        ("Time 1, Time 2", "Time 1,a,Time 2,b\n", ","),
        ("pandas' second name", "time [s],a,time [s].1,b\n", ","),
        ("times that have the channel's name", "t_a;a;t_b;b\n".replace("t_", "time_"), ";"),
        ("units below the names", "Time;a;Time;b\ns;K;s;K\n", ";"),
    ):
        data = (head + table(pairs, separator)).encode()
        yield case(
            "text", f"a time for each channel: {layout}", "log.csv",
            lambda path, data=data: path.write_bytes(data), setup("a", "b"),
        )  # fmt: skip


def _headers() -> Iterator[Case]:
    """Headers of several rows."""
    t = [f"{x:.2f}" for x in T]
    clock = [f'"2026-03-29 12:00:{x:05.2f}"' for x in T]
    kilo = {"a": V[0] + 273.15, "b": V[1]}
    in_deg = channel("a", "a", "") + channel("b", "b", "")

    def case(layout: str, text: str | bytes, use: str = in_deg, **more: object) -> Case:
        return text_case("headers", layout, text, use, **{"truth": kilo, **more})

    for width in (2, 4, 8):  # as wide as the first line of a TOA5 file, and not
        fill = width - 2
        names = ",".join(['"TIMESTAMP"', '"RECORD"', '"a"', '"b"', *['"x"'] * fill])
        units = ",".join(['"TS"', '"RN"', '"degC"', '"K"', *['""'] * fill])
        kinds = ",".join(['""', '""', '"Smp"', '"Avg"', *['"Max"'] * fill])
        first = '"TOA5","st1","CR6","1","CR6.Std.07","CPU:x.CR6","55","fast"\n'
        yield case(
            f"TOA5: names, units, statistics over {width + 2} columns",
            first
            + f"{names}\n{units}\n{kinds}\n"
            + table([clock, range(ROWS), A, B, *[["1.5"] * ROWS] * fill]),
        )
    catman = "File\tx\nSample rate\t100 Hz\n\nTime  1 - default sample rate\ta\tb\ns\t°C\tK\n"
    places = "MX840_0_CH 1\tMX840_0_CH 2\tMX840_0_CH 3\n"
    same = "\t".join(["Format=Numeric 8 Byte"] * 3) + "\n"
    for layout, more in (("names, units, places, formats", places + same), ("places", places)):
        yield case(
            f"catman: {layout}",
            (catman + more + "\n" + table([t, A, B], "\t", decimal=",")).encode("cp1252"),
        )
    vbox = [f"1325{x + 55:05.2f}" if x < 5 else f"1326{x - 5:05.2f}" for x in T]
    yield case(
        "VBOX: sections, times as HHMMSS.ss",
        "File created on 19/11/2026 at 13:25:38\n\n[header]\nsatellites\ntime\na\nb\n\n"
        "[comments]\nVBOX\n\n[column names]\nsats time a b\n\n[data]\n"
        + table([["003"] * ROWS, vbox, A, B], " "),
        setup("a", "b"),
        truth=BOTH,
    )  # fmt: skip
    yield case(
        "RaceCapture: name, unit, range and rate in each cell",
        '"Interval"|"ms"|0|0|100,"a"|"degC"|-1000|1000|100,"b"|"K"|-1000|1000|100\n'
        + table([[f"{1e3 * x + 402:.1f}" for x in T], A, B]),
    )
    yield case("units above the names", "s;degC;K\ntime;a;b\n" + table([t, A, B], ";"))
    yield case(
        "units behind a word", "Logger;7\nUnits;s;degC;K\nNo;time;a;b\n"
        + table([range(ROWS), t, A, B], ";"),
    )  # fmt: skip
    for behind in (1, 2, 3):
        yield case(
            f"{behind} blank names at the end",
            "Meta,,,\nPhysical channel,Start Time,Interval,Count\nChannel 0,-0.5,0.01,900\n,,,\n"
            f"Data,,,\na (degC),Time,b{',' * behind}\n" + table([A, t, B], end="," * behind + "\n"),
        )
    both_k = setup("a", "b")
    plain = "time,a,b\n" + table([t, A, B])
    for encoding in ("utf-16", "utf-16-le", "utf-16-be"):
        yield case(f"{encoding} text", plain.encode(encoding), both_k, truth=BOTH)
    yield case("utf-16, packed", gzip.compress(plain.encode("utf-16")), both_k, truth=BOTH,
               name="log.csv.gz")  # fmt: skip
    large = {"a": 1e4 * V[0], "b": np.round(1e6 * V[1])}
    for sign, decimal, separator, quote in (
        (".", ",", ";", ""), ("'", ".", ",", ""), ("’", ".", ";", ""), ("\u00a0", ",", ";", ""),
        ("\u202f", ",", "\t", ""), (",", ".", ",", '"'), (",", ".", ";", ""), (".", ",", "\t", ""),
    ):  # fmt: skip
        cells = [
            [f"{quote}{x:,.2f}{quote}".translate({44: sign, 46: decimal}) for x in v]
            for v in (np.round(large["a"], 2), large["b"])
        ]
        stamps = [x.replace(".", decimal) for x in t]
        yield case(
            f"groups of three digits: {sign!r}, decimal {decimal!r}, between cells {separator!r}",
            separator.join(["time", "a", "b"]) + "\n" + table([stamps, *cells], separator),
            both_k,
            truth={"a": np.round(large["a"], 2), "b": large["b"]},
        )
    yield case(
        "ISO 8601 without signs",
        "stamp,a,b\n" + table([[f"20261104T0144{28 + x:09.6f}" for x in T], A, B]),
        both_k,
        truth=BOTH,
    )
    some = [f"{x:,.2f}".translate({44: ".", 46: ","}) for x in np.where(T < 8.0, 900.0, 1234.5)]
    yield case(
        "groups of three digits in the last rows alone",
        "time;a;b\n" + table([[x.replace(".", ",") for x in t], some, some], ";"),
        both_k,
        truth=dict.fromkeys("ab", np.where(T < 8.0, 900.0, 1234.5)),
    )
    lvm = "LabVIEW Measurement\n***End_of_Header***\nChannels\t2\nSamples\t{}\t{}\t\n"
    lvm += "***End_of_Header***\nX_Value\ta (degC)\tb\n" + table([t, A, B], "\t")
    yield case("LabVIEW: as many samples as it says", lvm.replace("{}", str(ROWS)))
    head, twice = lvm.partition("X_Value")[0], [f"{x:.2f}" for x in 2.0 * T]
    rows = "X_Value\ta (degC)\tX_Value\tb\n" + table([t, A, twice, B], "\t")
    cut_off = "promises 51200 samples and 900 are there"
    yield case("LabVIEW: fewer samples than it says, two times", head.replace("{}", "51200") + rows,
               said=cut_off, own_times_s={"b": 2.0 * T})  # fmt: skip
    yield case("LabVIEW: fewer samples than it says", lvm.replace("{}", "51200"), said=cut_off)


def _long_tables() -> Iterator[Case]:
    """Tables of a time, a name and a value, in turns and sorted by name."""
    t = [f"{x:.2f}" for x in T]
    for name, cells in (("name", ("a", "b")), ("channel", ("3", "7"))):
        turns = [f"{x},{c},{v}\n" for x, *vs in zip(t, A, B, strict=True)
                 for c, v in zip(cells, vs, strict=True)]  # fmt: skip
        short = sorted(turns, key=lambda row: row.split(",")[1])
        one = [row for row in short if row.split(",")[1] == cells[0]]
        said = f"2 signals one after the other, by column {name!r}: {', '.join(cells)}"
        # of numbers only the first 256 KB are looked at: they may be what is measured
        late = [("sorted, long", 20 * one + short)] if name == "name" else []
        for layout, rows in (("in turns", turns), ("sorted", short), *late):
            yield text_case(
                "long tables", f"{name} of each row, {layout}",
                f"time,{name},value\n" + "".join(rows),
                setup("value"), refused=said,
            )  # fmt: skip
        yield text_case("long tables", f"{name} of each row, one signal",
                        f"time,{name},value\n" + "".join(one), setup("value"))  # fmt: skip
    turns = [n // 300 for n in range(ROWS)]
    places = [("straight", "curve")[n // 200 % 2] for n in range(ROWS)]
    damaged = ["fro#t" if n == ROWS // 2 else "front" for n in range(ROWS)]
    for name, cells in (("id", turns), ("measurement", turns), ("tag", places), ("name", damaged)):
        yield text_case("long tables", f"{name} beside one signal", f"time,a,{name}\n"
                        + table([t, A, cells]), setup("a"))  # fmt: skip
    yield text_case("text", "index in seconds", "index,a,b\n" + table([t, A, B]),
                    setup("a", "b"), BOTH)  # fmt: skip
    for kind in ("object", "category"):
        columns = {
            "time": np.tile(T, 2),
            "name": np.repeat(["a", "b"], ROWS),
            "value": V[:2].ravel(),
        }
        frame = pd.DataFrame(columns).astype({"name": kind})
        yield Case("long tables", f"Parquet, sorted, names of type {kind}", "log.parquet",
                   frame.to_parquet, setup("value"), refused="by column 'name': a, b")  # fmt: skip
    named = {"time": np.repeat(T, 2), "name": np.tile(["a", "b"], ROWS), "value": V[:2].T.ravel()}
    for more, values in (("index", np.arange(2 * ROWS)), ("unit", ["K"] * 2 * ROWS)):
        frame = pd.DataFrame({**named, more: values})
        text = frame.to_csv(index=False)
        yield text_case("long tables", f"name of each row, in turns, beside an {more}", text,
                        setup("value"), refused="by column 'name': a, b")  # fmt: skip
    yield Case("long tables", "Parquet, in turns, beside an index", "log.parquet",
               pd.DataFrame({**named, "row": np.arange(2 * ROWS)}).to_parquet, setup("value"),
               refused="by column 'name': a, b")  # fmt: skip
    states = np.where(np.arange(ROWS) // 200 % 2, "good", "bad")
    yield text_case("long tables", "a state of the signal beside several", "time,a,b,c,signal\n"
                    + table([t, A, B, A, states.tolist()]), setup("a", "b"), BOTH)  # fmt: skip
    for order in ("in turns", "sorted"):
        own = {"time": np.repeat(T, 2), "name": np.tile(["a", "b"], ROWS), "value": V[:2].T.ravel()}
        if order == "sorted":
            rows = np.argsort(own["name"], kind="stable")
            own = {name: values[rows] for name, values in own.items()}
        yield from _long_in_binary(order, own)


def _long_in_binary(order: str, columns: Columns) -> Iterator[Case]:
    """Long tables in formats of numbers, names as words and as numbers of channels."""
    ids = {**columns, "channel": np.where(columns["name"] == "a", 7, 10)}
    del ids["name"]
    words = {**columns, "name": columns["name"].astype("S4")}
    together = np.rec.fromarrays(list(words.values()), names=list(words))

    def texts(path: Path) -> None:
        with h5py.File(path, "w") as file:
            file.update({"time": columns["time"], "value": columns["value"]})
            file.create_dataset("name", data=list(columns["name"]), dtype=h5py.string_dtype())

    def table_of(path: Path) -> None:
        with h5py.File(path, "w") as file:
            file["log"] = together

    by_name, by_id = "by column 'name': a, b", "by column 'channel': 10, 7"
    for layout, write, source, refused in (
        (
            "three columns",
            lambda path: _hdf5(path, words, words["time"], "time"),
            "/value",
            by_name,
        ),
        ("three columns, names as texts of any length", texts, "/value", by_name),
        (
            "numbers of channels",
            lambda path: _hdf5(path, ids, ids["time"], "time"),
            "/value",
            by_id,
        ),
        ("a table", table_of, "/log:value", by_name),
    ):
        yield Case("long tables", f"HDF5, {order}, {layout}", "log.h5", write, setup(source),
                   refused=refused)  # fmt: skip
    if order == "in turns":  # messages come in the order of time
        for layout, own, refused in (("names", columns, by_name), ("numbers", ids, by_id)):
            yield Case(
                "long tables", f"MCAP, {layout}", "log.mcap",
                lambda path, own=own: writers.json_messages(path, own, own["time"]),
                setup("/log:value"), refused=refused,
            )  # fmt: skip
    front = {**columns, "name": np.full(2 * ROWS, "front"), "time": np.arange(2 * ROWS) / RATE_HZ}
    one = {"a": front["value"]}
    yield Case("long tables", f"MCAP, {order}, one signal", "log.mcap",
               lambda path: writers.json_messages(path, front, front["time"]),
               setup("/log:value"), one)  # fmt: skip
    coded = {**front, "name": front["name"].astype("S5")}
    yield Case("long tables", f"HDF5, {order}, one signal", "log.h5",
               lambda path: _hdf5(path, coded, coded["time"], "time"), setup("/value"),
               one)  # fmt: skip


#: names under which a quantity may rise as evenly as a time, and is none
_OTHERS = ("Distance", "dist_m", "lat", "Odometer", "TreadTemp", "GPS Longitude", "angle (deg)")


def _other_quantities() -> Iterator[Case]:
    """What rises evenly beside the signals, under a name of its own, is no time."""
    for format in _WITH_TIMES:
        file, needs, write, source = FORMATS[format]
        if format == "a MATLAB matrix":
            continue
        for name in _OTHERS[: 5 if format == "MATLAB 5" else None]:
            for log, more in (
                ("", {"refused": "no stamps and no rate"}),
                ("sampling_rate_Hz = 100.0\n", {"truth": BOTH}),
            ):
                yield Case(
                    format,
                    f"{name!r} that rises, {'a rate in the setup' if log else 'no rate'}",
                    file,
                    lambda path, write=write, name=name: write(
                        path, {"a": V[0], "b": V[1]}, T, name
                    ),
                    setup(source(0, "a"), source(1, "b"), log=log),
                    needs=needs,
                    **more,
                )
    seconds = [f"{x:.2f}" for x in T]
    yield text_case("text", "samples in seconds", "Sample (s),a,b\n" + table([seconds, A, B]),
                    setup("a", "b"), BOTH)  # fmt: skip
    for name, began, behind in (("Lap Time", 1.0, "Lap"), ("GPS Time", 1234.0, "GPS Speed")):
        rows = table([seconds, A, [f"{x + began:.2f}" for x in T], range(ROWS), B])
        text = f"Time,a,{name},{behind},b\n{rows}"
        yield text_case("text", f"{name} beside Time", text, setup("a", "b"), BOTH)


def _no_rate() -> Iterator[Case]:
    """Stamps that passed single precision: they rise once, which times nothing."""
    stamps = np.where(np.arange(ROWS) < 400, 1_743_249_536.0, 1_743_249_664.0)
    for format in _WITH_TIMES:
        file, needs, write, source = FORMATS[format]
        if format == "a MATLAB matrix":
            continue
        sources = source(0, "a"), source(1, "b")
        for layout, log, more in (
            ("no rate", "", {"refused": "stamps that rise once and no rate"}),
            ("a rate in the setup", "sampling_rate_Hz = 100.0\n", {}),
        ):
            yield Case(
                format,
                f"stamps that rise once, {layout}",
                file,
                lambda path, write=write: write(path, {"a": V[0], "b": V[1]}, stamps, "timestamp"),
                setup(*sources, log=log),
                BOTH,
                needs=needs,
                **more,  # type: ignore[arg-type]
            )


def cases() -> Iterator[Case]:
    """All of them, also those whose library is not installed."""
    yield from _units()
    yield from _times()
    yield from _starts()
    yield from _headers()
    yield from _long_tables()
    yield from _other_quantities()
    yield from _no_rate()
