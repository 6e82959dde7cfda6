"""Whole kinds: names, units, blanks and codes over formats, and headers over ways to write text."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import product
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from benchmarks.layouts import meaning, writers
from benchmarks.layouts.generated import RATE_HZ, ROWS, T, V, channel, table, text_case
from benchmarks.layouts.judge import Case

Columns = Mapping[str, NDArray]
#: format -> (name of its files, library, writer of columns and their times, source of a column)
FORMATS: dict[str, tuple[str, str, Callable[..., None], Callable[[str], str]]] = {
    name: (file, needs, write, lambda column, source=source: source(0, column))
    for name, (file, needs, write, source) in meaning.FORMATS.items()
    if name not in ("a MATLAB matrix", "TDMS", "MDF")
}


def _mcap(path: Path, columns: Columns, times: NDArray, name: str) -> None:
    writers.json_messages(path, columns, times)


def _tdms(path: Path, columns: Columns, times: NDArray, name: str) -> None:
    writers.tdms(path, columns, 1.0 / (times[1] - times[0]), unit="")


def _mdf(path: Path, columns: Columns, times: NDArray, name: str) -> None:
    writers.mdf(path, columns, 1.0 / (times[1] - times[0]), unit="")


FORMATS |= {
    "MCAP": ("log.mcap", "", _mcap, lambda column: f"/log:{column}"),
    "TDMS": ("log.tdms", "nptdms", _tdms, lambda column: f"/run/{column}"),
    "MDF": ("log.mf4", "asammdf", _mdf, lambda column: f"/run/{column}"),
}

#: names of columns; what looks like a path, an index, a field or a unit is part of the name
NAMES = (
    "FBG 1 [nm]", "strain[0]", "strain[0:2]", "strain:left", "strain ", "strain/left",
    "Acc (Trigger)", "strain.1", "a,b", "strain (raw) [1]", "CH1.FBG2", "2", "#7", "ε außen",
    "Strain [µm/m]", "x" * 120,
)  # fmt: skip


def _names() -> Iterator[Case]:
    """Any name, by the source under which the log's own list has it."""
    for format, name in product(FORMATS, NAMES):
        file, needs, write, _ = FORMATS[format]
        if (format == "HDF5" and "/" in name) or (format == "MATLAB 5"):
            continue  # a path there; names of MATLAB are words
        if format == "MCAP" and (":" in name or name.endswith(" ")):
            continue  # no source can name them, and none is listed
        yield Case(
            format,
            f"name {name[:20]!r}, as info lists it",
            file,
            lambda path, write=write, name=name: write(path, {name: V[0]}, T, "time_s"),
            "",
            {"c0": V[0]},
            needs=needs,
        )


#: unit -> (kind of a channel, its factor to SI, its offset)
UNITS = {
    "g": ("radial_acceleration", 9.80665, 0.0),
    "km/h": ("vehicle_speed", 1.0 / 3.6, 0.0),
    "kN": ("vertical_load", 1e3, 0.0),
    "psi": ("inflation_pressure", 6894.757293168361, 0.0),
    "bar": ("inflation_pressure", 1e5, 0.0),
    "°C": ("temperature", 1.0, 273.15),
    "µm/m": ("strain", 1e-6, 0.0),
}


def _units() -> Iterator[Case]:
    """The unit that a file states for a channel, alone and against the setup's."""

    def attribute(name: str) -> Callable[[Path, str], None]:
        def write(path: Path, unit: str) -> None:
            with h5py.File(path, "w") as file:
                file.update({"a": V[0], "time_s": T})
                file["a"].attrs[name] = unit

        return write

    def lvm(path: Path, unit: str) -> None:
        head = (
            "LabVIEW Measurement\t\nX_Columns\tOne\n***End_of_Header***\t\n\t\nChannels\t1\t\n"
            f"Y_Unit_Label\t{unit}\t\nX_Dimension\tTime\t\nDelta_X\t0.01\t\n"
            "***End_of_Header***\t\t\nX_Value\ta\t\n"
        )
        cells = [[f"{x:.4f}" for x in values] for values in (T, V[0])]
        path.write_text(head + table(cells, "\t"), encoding="utf-8")

    def row(path: Path, unit: str) -> None:
        cells = [[f"{x:.4f}" for x in values] for values in (T, V[0])]
        path.write_text(f"time;a\ns;{unit}\n" + table(cells, ";"), encoding="utf-8")

    ways: dict[str, tuple[str, str, Callable[[Path, str], object], str]] = {
        "HDF5, attribute unit": ("log.h5", "", attribute("unit"), "/a"),
        "HDF5, attribute units": ("log.h5", "", attribute("units"), "/a"),
        "HDF5, attribute Unit": ("log.h5", "", attribute("Unit"), "/a"),
        "LVM, Y_Unit_Label": ("log.lvm", "", lvm, "a"),
        "text, a row of units": ("log.csv", "", row, "a"),
        "TDMS, unit_string": ("log.tdms", "nptdms", lambda path, unit: writers.tdms(
            path, {"a": V[0]}, RATE_HZ, unit=unit), "/run/a"),
        "MDF, unit": ("log.mf4", "asammdf", lambda path, unit: writers.mdf(
            path, {"a": V[0]}, RATE_HZ, unit=unit), "/run/a"),
    }  # fmt: skip
    for (way, (file, needs, write, source)), unit in product(ways.items(), UNITS):
        kind, factor, offset = UNITS[unit]
        plain = channel("a", source, "").replace("temperature", kind)
        given = '"K"' if unit == "°C" else '"strain"' if unit == "µm/m" else '"m/s^2"'
        own = {"vehicle_speed": '"m/s"', "vertical_load": '"N"', "inflation_pressure": '"Pa"'}
        other = plain + f"unit = {own.get(kind, given)}\n"
        for use, more in (
            (plain, {"truth": {"a": V[0] * factor + offset}}),
            (other, {"truth": {"a": V[0]}, "said": f"the file gives the unit {unit!r}"}),
        ):
            yield Case(
                way,
                f"{unit}{', against the setup' if 'said' in more else ''}",
                file,
                lambda path, write=write, unit=unit: write(path, unit),
                use,
                needs=needs,
                checked=False,
                **more,  # type: ignore[arg-type]
            )


def _blanks() -> Iterator[Case]:
    """A channel that has a value in each k-th row, and blanks between."""
    rows = 4 * ROWS
    values = 1e-5 * np.tile(V[0], 4) + 1e-6 * np.arange(rows)
    times = np.arange(rows) / RATE_HZ
    for format, every, first in product(FORMATS, (2, 3, 4, 5, 10), (0, 1)):
        file, needs, write, source = FORMATS[format]
        kept = np.arange(rows) % every == first
        columns = {"other": np.tile(V[1], 4), "s": np.where(kept, values, np.nan)}
        use = channel("other", source("other")) + channel(
            "s", source("s"), 'unit = "strain"'
        ).replace("temperature", "strain")
        yield Case(
            format,
            f"a value every {every} rows, from row {first} on",
            file,
            lambda path, write=write, columns=columns: write(path, columns, times, "time_s"),
            use,
            {"s": values[kept]},
            own_times_s={"s": times[kept]},
            said=f"the log has a value every {every} rows",
            needs=needs,
            checked=False,
        )


#: a wheel of 0.30 m at 20 m/s, strain at 2 kHz over 10 s
_WHEEL = """[tire]
rolling_radius_m = 0.30
[channels.s]
kind = "strain"
source = "{}"
unit = "microstrain"
surface = "{}"
"""


def wheel(seed: int = 1) -> tuple[NDArray, NDArray]:
    """(times, microstrain in a groove) of that wheel, (n,) each."""
    t = np.arange(20_000) / 2000.0
    turn = 2.0 * np.pi * 0.30
    x = (20.0 * t + turn / 3.0 + turn / 2.0) % turn - turn / 2.0
    bumps = ((-800.0, 0.0, 0.05), (150.0, 0.09, 0.03), (150.0, -0.09, 0.03))
    strain = sum(a * np.exp(-(((x - at) / w) ** 2)) for a, at, w in bumps)
    return t, np.round(strain + 2.0 * np.random.default_rng(seed).standard_normal(t.size), 2)


def _codes() -> Iterator[Case]:
    """Error codes once a second, of any length, on either side of the signal."""
    times, strain = wheel()
    codes = (-9999.0, -32768.0, -1e6, -2000.0, 9999.0, 32767.0, 65535.0, 1e6)
    lengths = (3, 20, 40, 100, 400)
    for format, code, length, surface in product(FORMATS, codes, lengths, ("outer", "inner")):
        if format not in ("text", "HDF5") and (length, abs(code)) != (40, 9999.0):
            continue
        file, needs, write, source = FORMATS[format]
        values = strain if surface == "outer" else -strain
        values = values.copy()
        for first in range(3333, values.size - 400, 2000):
            values[first : first + length] = code
        yield Case(
            format,
            f"code {code:g} for {length / 2:g} ms each second, {surface}",
            file,
            lambda path, write=write, values=values: write(path, {"s": values}, times, "time_s"),
            _WHEEL.format(source("s"), surface),
            speed_m_s=20.0,
            needs=needs,
        )


def _headers() -> Iterator[Case]:
    """Each header in each way to write text."""
    cells = [[f"{x:.2f}" for x in T], *([f"{x:.4f}" for x in values] for values in V[:2])]
    truth = {"a": V[0] + 273.15, "b": V[1]}
    headers = {
        "a row of names": [["time [s]", "a [degC]", "b [K]"]],
        "units below": [["time", "a", "b"], ["s", "degC", "K"]],
        "units above": [["s", "degC", "K"], ["time", "a", "b"]],
        "units and statistics below": [
            ["time", "a", "b"], ["s", "degC", "K"], ["Smp", "Avg", "Smp"]],
        "places above": [["0", "CH 1", "CH 2"], ["time", "a", "b"], ["s", "degC", "K"]],
        "a title above": [["Drum test 7", "", ""], ["time", "a", "b"], ["s", "degC", "K"]],
        "lines and a blank one above": [
            ["Logger 7", "", ""], ["serial", "12", ""], ["", "", ""],
            ["time [s]", "a [degC]", "b [K]"]],
    }  # fmt: skip
    ways = product((",", ";", "\t", "|"), ".,", ("utf-8", "utf-8-sig", "utf-16", "cp1252"),
                   ("\n", "\r\n"))  # fmt: skip
    use = channel("a", "a", "") + channel("b", "b", "")
    for (separator, decimal, encoding, end), (name, rows) in product(ways, headers.items()):
        if separator == decimal:
            continue
        text = table(list(zip(*rows, strict=True)), separator) + table(
            cells, separator, decimal=decimal
        )
        yield text_case(
            "headers",
            f"{name}; separator {separator!r}, decimal {decimal!r}, {encoding}, end {end!r}",
            text.replace("\n", end).encode(encoding),
            use,
            truth=truth,
        )


def cases() -> Iterator[Case]:
    """All of them, also those whose library is not installed."""
    yield from _names()
    yield from _units()
    yield from _blanks()
    yield from _codes()
    yield from _headers()
