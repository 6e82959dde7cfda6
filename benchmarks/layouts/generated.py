"""The generated files: every layout that was met in public data, by the program that writes it."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.layouts.judge import Case

Values = NDArray[np.float64]
#: more rows than the head's sample holds, so that first and last ones do not adjoin
ROWS, RATE_HZ = 900, 100.0


def values(rows: int = ROWS, channels: int = 3, seed: int = 1) -> Values:
    """Values of 4 decimals about 10, 20, 30, ..., shape (channels, rows); none repeats a row."""
    noise = np.random.default_rng(seed).standard_normal((channels, rows))
    return np.round(10.0 * np.arange(1, channels + 1)[:, None] + noise, 4)


V = values()
T = np.arange(ROWS) / RATE_HZ


def channel(name: str, source: str, *more: str) -> str:
    keys = "".join(f"{key}\n" for key in more or ('unit = "K"',))
    return f'[channels.{name}]\nkind = "temperature"\nsource = "{source}"\n{keys}'


def setup(*sources: str, log: str = "") -> str:
    """Channels a, b, c of these sources."""
    text = "".join(channel(name, source) for name, source in zip("abc", sources, strict=False))
    return text + (f"[log]\n{log}\n" if log else "")


def table(
    columns: Sequence[Sequence[object]], separator: str = ",", end: str = "\n", decimal: str = "."
) -> str:
    """Rows of text cells or numbers as they are."""
    rows = (separator.join(map(str, row)) for row in zip(*columns, strict=True))
    text = "".join(row + end for row in rows)
    return text if decimal == "." else text.replace(".", decimal)


def text_case(
    source: str,
    layout: str,
    text: str | bytes,
    setup: str,
    truth: dict[str, Values] | None = None,
    name: str = "log.csv",
    **more: object,
) -> Case:
    data = text if isinstance(text, bytes) else text.encode()
    truth = {"a": V[0]} if truth is None else truth
    return Case(source, layout, name, lambda path: path.write_bytes(data), setup, truth, **more)  # type: ignore[arg-type]


def _seconds(t: Values = T, digits: int = 2) -> list[str]:
    return [f"{x:.{digits}f}" for x in t]


def _in_time() -> Iterator[Case]:
    """Times and rates under other names, in other places."""
    a, b = ([f"{x:.4f}" for x in v] for v in V[:2])
    both = {"a": V[0], "b": V[1]}
    yield text_case(
        "rig of a thesis",
        "rate in words, '# t | name | name' over exponents, blanks",
        "bridge, sampled at 100\n# t | Mod8/ai0:4(bridge) | Mod8/ai1\n"
        + table(
            [[f"{x:.18e}" for x in T], [f"{x:.18e}" for x in V[0]], [f"{x:.18e}" for x in V[1]]],
            " ",
        ),
        setup("Mod8/ai0:4(bridge)", "Mod8/ai1"),
        both,
    )
    yield text_case(
        "rig of a thesis",
        "rate in words alone, no time column",
        "bridge, sampled at 100\n# ai0 | ai1\n" + table([a, b], " "),
        setup("ai0", "ai1"),
        both,
    )
    drift = np.floor(T * 0.99999 * 1e6) / 1e6
    counts = [["1"] * ROWS, ["1"] * ROWS, ["1"] * ROWS, ["0"] * ROWS]
    peaks = (
        V[:3] * 0.01 + np.array([1540.0, 1520.0, 1526.0])[:, None] - np.array([[0.1], [0.2], [0.3]])
    )
    grating = (
        '[channels.{0}]\nkind = "fbg_temperature"\nsource = "{1}"\nunit = "nm"\n'
        "reference_wavelength_nm = {2}\nwindow_nm = [{3}, {4}]\n"
    )
    yield text_case(
        "peak-count interrogator",
        "no header: time, 4 peak counts, wavelengths",
        table(
            [[f"{x:.6f}" for x in drift], *counts, *([f"{x:.5f}" for x in p] for p in peaks)], "\t"
        ),
        grating.format("a", "CH1", 1540.0, 1539.0, 1541.0)
        + grating.format("b", "CH2", 1520.0, 1519.0, 1521.0),
        {
            "a": (np.array([float(f"{x:.5f}") for x in peaks[0]]) - 1540.0) / 0.010,
            "b": (np.array([float(f"{x:.5f}") for x in peaks[1]]) - 1520.0) / 0.010,
        },
        times_s=T * 0.99999,
        time_error_s=2e-6,
        value_error=1e-6,
    )
    yield text_case(
        "materials tester",
        "times last, named 'Running Time', unit row without brackets",
        '"File Path: C:\\\\x.csv"\n"Test Run: Test Run 23"\n"Date: 7/9/2026 2:08:45 PM"\n\n'
        '"Axial Displacement","Axial Force","Running Time"\nm,K,sec\n' + table([b, a, _seconds()]),
        setup("Axial Force"),
    )
    yield text_case(
        "materials tester, processed",
        "'RunningTime_s' among others",
        "AxialForce_N,RunningTime_s\n" + table([a, _seconds()]),
        setup("AxialForce_N"),
    )
    for name in ("TestTime", "X_Value", "Elapsed", "elapsed_ms", "Zeit [ms]", "ms", "TimeStampMs"):
        slow = ["ms" in name.lower()] and "ms" in name.lower()
        stamps = [f"{1000 * x:.0f}" for x in T] if slow else _seconds()
        yield text_case(
            "loggers of many kinds",
            f"time named '{name}', last column",
            f"a,b,{name}\n" + table([a, b, stamps]),
            setup("a", "b"),
            both,
        )
    yield text_case(
        "inertial sensor dots",
        "'sep=,' line, preamble, SampleTimeFine [us], separator behind",
        "sep=,\nDeviceTag:,DOT 3,\nOutputRate:,100Hz,\n\n"
        "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,\n"
        + table(
            [range(7, 7 + ROWS), [f"{3_000_000_000 + round(1e6 * x)}" for x in T], a, b], end=",\n"
        ),
        setup("Acc_X", "Acc_Y"),
        both,
    )
    yield text_case(
        "inertial sensor dots",
        "'OutputRate: 100Hz' and a packet counter, no time",
        "sep=,\nOutputRate: 100Hz\nPacketCounter,Acc_X\n" + table([range(7, 7 + ROWS), a]),
        setup("Acc_X"),
    )
    yield text_case(
        "USB vibration sensor",
        "'# Config: data_rate = 100.0 Hz, ...', a count",
        "# Data\n# Time: 2026-04-21 15:54:46.333682, Device: D4\n"
        "# Num. samples: 900, Duration: 9.0 s\n"
        "# Config: data_rate = 100.0 Hz, filter = 488 Hz, acc_range = 4 g\n# Integrity: True\n"
        "count,a_x,a_y\n" + table([range(ROWS), a, b]),
        setup("a_x", "a_y"),
        both,
    )
    yield text_case(
        "LabVIEW, bare",
        "leading tab, no header, time in the second column",
        table([[""] * ROWS, [f"{315 + x:.6f}" for x in T], a], "\t"),
        setup("#3"),
        name="log.lvm",
    )
    lvm = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
        "Decimal_Separator\t{decimal}\nMulti_Headings\tNo\nX_Columns\t{x}\nTime_Pref\tAbsolute\n"
        "Date\t2026/03/04\nTime\t10:00:00{decimal}25\n***End_of_Header***\t\n\t\nChannels\t2\t\t\n"
        "Samples\t900\t900\t\nDate\t2026/03/04\t2026/03/04\t\nTime\t10:00:00{decimal}25\t10:00:00{decimal}25\t\n"
        "X_Dimension\tTime\tTime\t\nX0\t0{decimal}0000000000000000E+0\t0{decimal}0000000000000000E+0\t\n"
        "Delta_X\t0{decimal}010000\t0{decimal}010000\t\n***End_of_Header***\t\t\t\n"
        "X_Value\tVoltage\tVoltage_1\tComment\n"
    )
    for decimal in ".,":
        stamps = [x.replace(".", decimal) for x in _seconds(digits=6)]
        cells = [[x.replace(".", decimal) for x in v] for v in (a, b)]
        yield text_case(
            "LabVIEW",
            f"X_Value and a trailing comment column, decimal '{decimal}'",
            lvm.format(decimal=decimal, x="One") + table([stamps, *cells, [""] * ROWS], "\t"),
            setup("Voltage", "Voltage_1"),
            both,
            name="log.lvm",
        )
        yield text_case(
            "LabVIEW",
            f"no X_Value: a leading tab, Delta_X alone, decimal '{decimal}'",
            lvm.format(decimal=decimal, x="No") + table([[""] * ROWS, *cells, [""] * ROWS], "\t"),
            setup("Voltage", "Voltage_1"),
            both,
            name="log.lvm",
        )
    yield text_case(
        "statistics programs",
        "a row-name column without a name, times in the second",
        "Time,a,b\n" + table([range(1, ROWS + 1), _seconds(), a, b]),
        setup("a", "b"),
        both,
    )
    yield text_case(
        "arrays saved as text",
        "'# t a b' over rows of blanks",
        "# t a b\n" + table([_seconds(), a, b], " "),
        setup("a", "b"),
        both,
    )
    yield text_case(
        "no header at all",
        "time first",
        table([_seconds(), a, b]),
        setup("#2", "#3"),
        both,
    )
    yield text_case(
        "no header at all",
        "time between two channels",
        table([a, _seconds(), b]),
        setup("#1", "#3"),
        both,
        said="taken for the time",
    )
    yield text_case(
        "epoch stamps",
        "'timestamp' in ms since 1970",
        "timestamp,a\n" + table([[f"{1_772_600_000_000 + round(1e3 * x)}" for x in T], a]),
        setup("a"),
    )
    yield text_case(
        "no time at all",
        "two channels and nothing else",
        "a,b\n" + table([a, b]),
        setup("a", "b"),
        refused='time = "#1"',
    )


def _edges() -> Iterator[Case]:
    """Times of a wheel's edges, without any samples."""
    turns = np.arange(400) / 48.0
    times = np.sqrt(turns / 0.5 + 1.0) - 1.0  # speeds up from half a turn per second
    written = np.round(times * 1e6)
    encoder = '[channels.a]\nkind = "wheel_encoder"\nsource = "edges"\nsteps = 48\n'
    for layout, text, log in (
        (
            "one column of times in us",
            table([[f"{x + 53_005_368:.0f}" for x in written]]),
            'time = "#1"\ntime_unit = "us"\n',
        ),
        (
            "'edge_time_us' beside others",
            "edge_time_us,note\n" + table([[f"{x:.0f}" for x in written], ["1"] * 400]),
            "",
        ),
        ("one column of seconds", table([[f"{x / 1e6:.6f}" for x in written]]), ""),
    ):
        yield text_case(
            "edge timers",
            layout,
            text,
            encoder + (f"[log]\n{log}" if log else ""),
            {"a": np.arange(400.0)},
            times_s=written / 1e6,
            time_error_s=2e-9,
        )


def _rows() -> Iterator[Case]:
    """Rows, headers and separators that are not all alike."""
    a, b, c = ([f"{x:.4f}" for x in v] for v in V)
    t = _seconds()
    both = {"a": V[0], "b": V[1], "c": V[2]}
    good = table([t, a, b, c]).splitlines(keepends=True)
    head = "time,a,b,c\n"
    names = setup("a", "b", "c")

    def pollution(layout: str, text: str, use: str = names, **more: object) -> Case:
        return text_case("polluted tables", layout, text, use, both, **more)

    def row(k: int, new: str) -> str:
        return head + "".join(good[:k] + [new] + good[k + 1 :])

    yield pollution("nothing", head + "".join(good))
    yield pollution("carriage returns alone", (head + "".join(good)).replace("\n", "\r"))
    yield pollution("both line ends mixed", (head + "".join(good)).replace("\n", "\r\n", 100))
    yield pollution("header twice at the top", head + head + "".join(good))
    yield pollution("header again in the middle", head + "".join(good[:450] + [head] + good[450:]))
    yield pollution(
        "headers again at every hundredth row",
        head + "".join(line if k % 100 else head + line for k, line in enumerate(good)),
    )
    yield pollution("two header rows", "clock,sensor,sensor,sensor\n" + head + "".join(good))
    yield pollution("three lines of words above", "Report\nof,a,test,\n\n" + head + "".join(good))
    yield pollution("words below", head + "".join(good) + "end of log\n")
    yield pollution("blank rows inside", head + "".join(good[:50] + ["\n", "\n"] + good[50:]))
    yield pollution("rows of blank cells inside", head + "".join(good[:50] + [",,,\n"] + good[50:]))
    yield pollution(
        "a span of blank cells inside",
        head + "".join(good[:80] + [",,,\n"] * 10 + good[90:]),
        said="10 rows do not parse",
    )
    lines = ["Logger 7\n", "serial 12\n", "a drive\n", "by B\n", "\n", head]
    yield pollution(
        "preamble and header again, as of a logger that starts anew",
        "".join(lines + good[:70] + lines + good[70:]),
        said="5 rows do not parse",
    )
    yield text_case(
        "polluted tables",
        "many words inside, columns by #n",
        head + "".join(good[:70] + lines[:5] * 2 + good[70:]),
        setup("#2", "#3", "#4"),
        {name: v[70:] for name, v in both.items()},
        said="70 lines above line 82, where the rows are taken to begin, look like rows",
    )
    for k, name in ((0, "first"), (450, "middle"), (ROWS - 1, "last")):
        yield pollution(
            f"an unreadable stamp in the {name} row", row(k, good[k].replace(t[k], "noon", 1))
        )
        yield pollution(
            f"one separator too many in the {name} row", row(k, good[k].replace(",", ",,", 1))
        )
        yield pollution(
            f"one separator too few in the {name} row", row(k, good[k].replace(",", "", 1))
        )
        yield pollution(f"the {name} row has one cell more", row(k, good[k].rstrip() + ",7\n"))
        yield pollution(f"the {name} row is cut", row(k, good[k][:9] + "\n"))
    yield pollution("a separator behind every row", head + "".join(good).replace("\n", ",\n"))
    yield pollution("a separator behind every line", (head + "".join(good)).replace("\n", ",\n"))
    yield pollution(
        "every cell quoted",
        '"time","a","b","c"\n'
        + "".join('"' + x.rstrip().replace(",", '","') + '"\n' for x in good),
    )
    yield pollution(
        "every cell in single quotes",
        "'time','a','b','c'\n"
        + "".join("'" + x.rstrip().replace(",", "','") + "'\n" for x in good),
    )
    for mark, what in ((";", "semicolon"), ("\t", "tab"), ("|", "bar"), (", ", "comma and blank")):
        yield pollution(f"separator {what}", (head + "".join(good)).replace(",", mark))
    spoilt = "header with a separator {0}: the names are not used"
    yield pollution(
        spoilt.format("too many"), "time,,a,b,c\n" + "".join(good), refused="can be identified"
    )
    yield pollution(
        spoilt.format("too many in front"),
        ",time,a,b,c\n" + "".join(good),
        refused="can be identified",
    )
    yield pollution(
        spoilt.format("too few"), "time,ab,c\n" + "".join(good), refused="can be identified"
    )
    by_place = setup("#2", "#3", "#4")
    yield pollution(
        "header with a separator too many, columns by #n", "time,,a,b,c\n" + "".join(good), by_place
    )
    yield pollution(
        "header with a separator too many in front, by #n",
        ",time,a,b,c\n" + "".join(good),
        by_place,
    )
    yield pollution(
        "header with a separator too few, columns by #n", "time,ab,c\n" + "".join(good), by_place
    )
    for size in (1, 2, 3, 5, 12):
        short = {name: v[:size] for name, v in zip("abc", V, strict=True)}
        few = text_case(
            "short logs",
            f"{size} rows",
            head + "".join(good[:size]),
            names,
            short,
            times_s=T[:size],
        )
        if size > 1:
            yield few
        if size > 2:
            spoilt_row = good[1].replace(t[1], "noon", 1)
            yield text_case(
                "short logs",
                f"{size} rows, one unreadable stamp",
                head + "".join([good[0], spoilt_row, *good[2:size]]),
                names,
                short,
                times_s=T[:size],
            )


def _wandering() -> Iterator[Case]:
    """Clocks whose stamps are coarser than their samples."""
    rng = np.random.default_rng(5)
    rows = 9.4 * 1500
    period = 1.0 / 9.4
    for layout, wander, error in (
        ("whole seconds, constant rate", 0.0, 0.12),
        ("whole seconds, rate wanders by 2.6 %", 0.026, 0.12),
        ("whole seconds, rate steps by 5 %", -0.05, 0.3),
    ):
        k = np.arange(int(rows))
        if wander >= 0:
            rate = 1.0 + wander * np.sin(2 * np.pi * k / 9000.0) * np.sign(
                np.sin(2 * np.pi * k / 2600.0) + 2
            )
        else:
            rate = np.where(k < rows / 2, 1.0, 1.0 + wander)
        t = np.concatenate([[0.0], np.cumsum(period * rate)[:-1]])
        v = np.round(20.0 + rng.standard_normal(k.size), 4)
        stamps = np.floor(t + 0.4)
        text = "Timestamp\tTime [s]\tWL 1[nm]\t\n" + table(
            [[f"{int(s)}" for s in stamps], [f"{int(s)}" for s in stamps], [f"{x:.4f}" for x in v]],
            "\t",
            "\t\n",
        )
        yield text_case(
            "software-paced interrogator",
            layout,
            text,
            setup("#3"),
            {"a": v},
            times_s=t,
            time_error_s=error,
            **({"said": "wanders"} if wander else {}),
        )


def _matlab() -> Iterator[Case]:
    """MATLAB 5 files, as another program writes them."""
    from scipy.io import savemat

    both = {"a": V[0], "b": V[1]}
    cells = np.empty(2, dtype=object)
    cells[:] = [V[0], V[1]]

    def mat(layout: str, variables: dict, *sources: str, **more: object) -> Case:
        options = {"do_compression": bool(more.pop("packed", False))}
        return Case(
            "MATLAB 5", layout, "log.mat", lambda path: savemat(path, variables, **options),
            setup(*sources, log=str(more.pop("log", ""))), **{"truth": both, **more},  # type: ignore[arg-type]
        )  # fmt: skip

    yield mat(
        "row vectors and Fs", {"strain": V[0], "temp": V[1], "Fs": RATE_HZ}, "strain", "/temp"
    )
    yield mat(
        "column vectors, packed, t beside",
        {"strain": V[0][:, None], "temp": V[1][:, None], "t": T[:, None]},
        "strain",
        "temp",
        packed=True,
    )
    yield mat(
        "a matrix of columns",
        {"data": np.column_stack([T, V[0], V[1]]), "fs": RATE_HZ},
        "data[1]",
        "data[2]",
        packed=True,
    )
    yield mat(
        "a structure in a structure",
        {"run": {"tire": {"a": V[0], "b": V[1]}, "dt": 1 / RATE_HZ}},
        "/run/tire/a",
        "/run/tire/b",
    )
    yield mat(
        "single precision and whole numbers",
        {"a": V[0].astype(np.float32), "b": np.round(V[1]).astype(np.int16), "time": T},
        "a",
        "b",
        truth={"a": V[0].astype(np.float32).astype(float), "b": np.round(V[1])},
    )
    yield mat(
        "cells, and text, complex and empty arrays beside",
        {
            "a": cells,
            "note": "run 7",
            "z": V[0] + 1j,
            "none": np.zeros((0, 3)),
            "Fs": RATE_HZ,
        },
        "/a{1}",
        "/a{2}",
        said="/z is complex",
        truth=both,
    )
    yield mat(
        "no numbers at all", {"note": "run 7"}, "note", truth={}, refused="no signal over time"
    )


def _other_formats() -> Iterator[Case]:
    """Parquet, WAV and zip."""
    import pandas as pd

    both = {"a": V[0], "b": V[1]}
    frame = pd.DataFrame({"time_s": T, "strain [K]": V[0], "temp": V[1], "note": ["x"] * ROWS})
    dated = frame.assign(time_s=pd.date_range("2026-03-04 10:00", periods=ROWS, freq="10ms"))
    exact = np.random.default_rng(3).standard_normal(ROWS) * 10.0 ** np.arange(-150, 150).repeat(3)
    holes = np.where(np.arange(ROWS) % 7 == 3, np.nan, V[0])

    def parquet(layout: str, table: pd.DataFrame, use: str, **more: object) -> Case:
        return Case(
            "Parquet",
            layout,
            "log.parquet",
            lambda path: table.to_parquet(path),
            use,
            **{"truth": both, **more},
        )  # type: ignore[arg-type]

    use = setup("strain", "temp")
    yield parquet("columns by name, seconds", frame, use, said="note")
    yield parquet("dates in a column", dated.rename(columns={"time_s": "stamp"}), use)
    yield parquet("dates in pandas' index", dated.set_index("time_s"), use)
    yield parquet(
        "stamps in ns since 1970, whole numbers",
        frame.assign(time_s=1_772_600_000_000_000_000 + np.arange(ROWS) * 10_000_000).rename(
            columns={"time_s": "timestamp"}
        ),
        use,
    )
    yield parquet(
        "single precision, whole numbers, categories",
        pd.DataFrame(
            {"t": T, "a": V[0].astype(np.float32), "b": pd.Categorical(np.round(V[1]).astype(int))}
        ),
        setup("a", "b"),
        truth={"a": V[0].astype(np.float32).astype(float), "b": np.round(V[1])},
    )
    yield parquet(
        "doubles of any size",
        pd.DataFrame({"t": T, "a": exact}),
        setup("a"),
        truth={"a": exact},
        value_error=0.0,
    )
    yield parquet(
        "lost samples", pd.DataFrame({"t": T, "a": holes}), setup("a"), truth={"a": holes}
    )
    yield parquet(
        "no numbers at all", frame[["note"]], use, truth={}, refused="no column of numbers"
    )

    def wav(layout: str, dtype: str, full: float, sources: tuple[str, ...], **more: object) -> Case:
        from scipy.io import wavfile

        pair = np.round((V[:2] - 10.0 * np.arange(1, 3)[:, None]) / 5.0 * full).T
        stored = np.clip(pair, -full, full - 1)
        middle = 128.0 if dtype == "u1" else 0.0
        data = (stored + middle).astype(dtype) if dtype[0] != "f" else pair.astype(dtype)
        truth = data.astype(float) - middle
        truth = truth / full if dtype[0] != "f" else truth
        use = "".join(channel(n, s, "") for n, s in zip("ab", sources, strict=True))
        return Case(
            "WAV",
            layout,
            "log.wav",
            lambda path: wavfile.write(path, 100, data),
            use.replace("temperature", "signal"),
            {"a": truth[:, 0], "b": truth[:, 1]},
            **more,
        )  # type: ignore[arg-type]

    yield wav("16 bits, two channels", "i2", 2.0**15, ("left", "right"))
    yield wav("8 bits", "u1", 2.0**7, ("#1", "#2"))
    yield wav("32 bits", "i4", 2.0**31, ("channel_1", "channel_2"))
    yield wav("floats", "f4", 1.0, ("#1", "#2"))
    yield wav("doubles", "f8", 1.0, ("#1", "#2"))

    text = "time,a,b\n" + table([_seconds(), *([f"{x:.4f}" for x in v] for v in V[:2])])

    def zipped(layout: str, members: dict[str, str], **more: object) -> Case:
        def write(path: Path) -> None:
            with zipfile.ZipFile(
                path, "w", int(more.pop("packing", zipfile.ZIP_DEFLATED))
            ) as archive:
                for name, content in members.items():
                    archive.writestr(name, content)

        return Case(
            "zip",
            layout,
            "log.csv.zip",
            write,
            setup("a", "b"),
            **{"truth": both, **{k: v for k, v in more.items() if k != "packing"}},
        )  # type: ignore[arg-type]

    yield zipped("one file of text", {"log.csv": text})
    yield zipped("one file, stored", {"log.csv": text}, packing=zipfile.ZIP_STORED)
    yield zipped(
        "in a folder, with what a Mac adds",
        {"run/": "", "run/log.csv": text, "__MACOSX/run/._log.csv": "\0\5\x16\7"},
    )
    yield zipped(
        "two files of text", {"log.csv": text, "other.csv": text}, said="second file, 'other.csv'"
    )
    yield zipped("an office document", {"[Content_Types].xml": "<x/>"}, truth={}, refused="Excel")
    for name, magic in (
        ("pickle", b"\x80\x04\x95\0\0"),
        ("CAN log of Vector", b"LOGG\x90\0\0\0"),
        ("7-zip archive", b"7z\xbc\xaf\x27\x1c"),
    ):
        yield text_case(
            "formats that are not read",
            name,
            magic + bytes(500),
            setup("a"),
            {},
            refused="convert it first",
        )


def cases() -> Iterator[Case]:
    """All of them."""
    yield from _in_time()
    yield from _edges()
    yield from _rows()
    yield from _wandering()
    yield from _matlab()
    yield from _other_formats()
