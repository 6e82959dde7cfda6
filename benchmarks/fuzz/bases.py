"""Small good files of every kind that a command reads, made anew in a folder."""

from __future__ import annotations

import gzip
import json
import lzma
import zipfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import zstandard
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray
from scipy.io import savemat, wavfile

from benchmarks.layouts import writers
from tirelog.cli import run

RATE_HZ = 1000.0
RADIUS_M = 0.305
SETUP = """[tire]
name = "fuzz"
unloaded_radius_m = 0.3126
rolling_radius_m = 0.305
section_height_m = 0.018
width_m = 0.215
[conditions]
load_N = 3434.0
inflation_pressure_Pa = 2.2e5
driven = true
[channels.strain_1]
kind = "fbg_strain"
source = "{strain}"
unit = "nm"
reference_wavelength_nm = 1550.0
strain_gain = 1.27
temperature_channel = "temp_1"
surface = "outer"
[channels.temp_1]
kind = "fbg_temperature"
source = "{twin}"
unit = "nm"
reference_wavelength_nm = 1542.0
temperature_sensitivity_nm_K = 0.010
[log]
{log}
"""
ENCODER_SETUP = """[tire]
name = "fuzz"
unloaded_radius_m = 0.3126
rolling_radius_m = 0.305
[conditions]
load_N = 3434.0
[channels.encoder]
kind = "wheel_encoder"
source = "/wheel/encoder"
unit = "V"
steps = 48
[channels.acceleration]
kind = "radial_acceleration"
source = "/wheel/acceleration"
unit = "g"
"""
SCENARIO = """seed = 3
truth = "beam"
[conditions]
load_N = 3600.0
inflation_pressure_Pa = 2.2e5
[[manoeuvres]]
duration_s = 1.0
speed_m_s = 12.0
regime = "cruise"
[channels.strain_1]
kind = "fbg_strain"
sampling_rate_Hz = 1000.0
noise = 0.0008
[[effects]]
name = "water_film"
form = "exact"
amplitude = 0.1
"""
CAMPAIGN = """[campaign]
name = "fuzz"
output = "results"
[[logs]]
glob = "logs/*.csv"
setup = "setup.toml"
conditions = "conditions.csv"
[tables.speed]
[tables.dissipation]
steady_step = 0.1
[[models]]
file = "model.toml"
commands = ["compare"]
"""


def strain_log(seconds: float = 3.0, speed_m_s: float = 12.0) -> tuple[NDArray[np.float64], ...]:
    """Time in s, a grating's and its twin's wavelength in nm of a wheel at constant speed."""
    t = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    x = (np.mod(speed_m_s * t / RADIUS_M, 2 * np.pi) - np.pi) * RADIUS_M
    flanks = 0.35 * np.exp(-(((np.abs(x) - 0.09) / 0.04) ** 2))
    strain = 1e-3 * (flanks - np.exp(-((x / 0.035) ** 2)))
    noise = np.random.default_rng(4).standard_normal((2, t.size))
    return t, 1550 * (1 + strain / 1.27) + 0.0008 * noise[0], 1542 + 0.0003 * noise[1]


def encoder_log(seconds: float = 2.0, rate_Hz: float = 5000.0) -> tuple[NDArray[np.float64], ...]:
    """Encoder in V and radial acceleration in g of a wheel at constant speed."""
    t = np.arange(int(seconds * rate_Hz)) / rate_Hz
    angle = 12.0 * t / RADIUS_M
    phi = np.mod(angle, 2 * np.pi) - np.pi
    level = 12.0**2 / RADIUS_M / 9.81
    inside = 0.5 * (np.tanh((phi + 0.18) / 0.02) - np.tanh((phi - 0.18) / 0.02))
    noise = np.random.default_rng(5).standard_normal((2, t.size))
    return 2.0 * np.sin(48 * angle) + 0.02 * noise[0], level * (1 - inside) + 0.5 * noise[1]


def _layouts(
    t: NDArray[np.float64], strain: NDArray[np.float64], twin: NDArray[np.float64]
) -> dict[str, tuple[bytes, str]]:
    """Text layouts: name -> (bytes, setup)."""
    rows = list(zip(t, strain, twin, strict=True))
    named = SETUP.format(strain="CH1", twin="CH2", log='time = "time_s"')
    numbered = SETUP.format(strain="#2", twin="#3", log='time = "#1"')
    plain = "time_s,CH1,CH2\n" + "".join(f"{a:.4f},{b:.4f},{c:.4f}\n" for a, b, c in rows)
    comma = "Messung 7\r\nGerät: A\r\n\r\ntime_s;CH1;CH2;\r\ns;nm;nm;\r\n" + "".join(
        f"{a:.4f};{b:.4f};{c:.4f};\r\n".replace(".", ",") for a, b, c in rows
    )
    iso = "stamp\tCH1\tCH2\n" + "".join(
        f"2026-03-04T10:00:{a:09.6f}\t{b:.4f}\t{c:.4f}\n" for a, b, c in rows
    )
    peaks = "Time\tCH 1\tCH 2\tpeaks\n" + "".join(
        f"{a:.4f}\t1\t1\t{b:.4f}\t{c:.4f}\n" for a, b, c in rows
    )
    windows = named.replace(
        "reference_wavelength_nm = 1550.0",
        "window_nm = [1546.0, 1554.0]\nreference_wavelength_nm = 1550.0",
    )
    windows = windows.replace('time = "time_s"', 'time = "#1"')
    return {
        "plain": (plain.encode(), named),
        "comma": (comma.encode("cp1252"), named),
        "iso": (iso.encode(), named.replace('time = "time_s"', 'time = "stamp"')),
        "bare": ("".join(f"{a:.4f} {b:.4f} {c:.4f}\n" for a, b, c in rows).encode(), numbered),
        "peaks": (peaks.encode(), windows),
    }


def _mcap(
    path: Path, compression: CompressionType, t: NDArray[np.float64], *values: NDArray[np.float64]
) -> None:
    with path.open("wb") as stream:
        writer = Writer(stream, compression=compression, chunk_size=20_000)
        writer.start()
        schema = writer.register_schema("tire", "jsonschema", b"{}")
        channel = writer.register_channel("/tire", "json", schema)
        for number, (at, a, b) in enumerate(zip(t, *values, strict=True)):
            stamp = 1_700_000_000_000_000_000 + round(at * 1e9)
            data = json.dumps({"strain": round(a, 4), "twin": round(b, 4)}).encode()
            writer.add_message(channel, stamp, data, stamp, number)
        writer.finish()


def _other_formats(folder: Path, t: NDArray, strain: NDArray, twin: NDArray, plain: bytes) -> None:
    """MATLAB, Parquet, WAV, zip and LabVIEW logs with their setups."""
    named = SETUP.format(strain="CH1", twin="CH2", log="")
    columns = {"time_s": t, "CH1": strain, "CH2": twin}
    for name, packed in (("matlab", False), ("matlabpacked", True)):
        savemat(folder / f"{name}.mat", {"run": columns}, do_compression=packed)
        setup = SETUP.format(strain="/run/CH1", twin="/run/CH2", log="")
        (folder / f"{name}.toml").write_text(setup)
    pd.DataFrame(columns).to_parquet(folder / "columns.parquet")
    (folder / "columns.toml").write_text(named)
    frames = np.stack([(strain - 1550.0) / 4.0, (twin - 1542.0) / 4.0], axis=1)
    wavfile.write(folder / "frames.wav", int(RATE_HZ), np.int16(np.round(frames * 32768)))
    scaled = SETUP.format(strain="left", twin="right", log="").split("unit = ")
    scaled[1] = f"scale = 4.0\noffset = 1550.0\nunit = {scaled[1]}"
    scaled[2] = f"scale = 4.0\noffset = 1542.0\nunit = {scaled[2]}"
    (folder / "frames.toml").write_text("".join(scaled))
    with zipfile.ZipFile(folder / "archive.csv.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("plain.csv", plain)
    (folder / "archive.toml").write_text((folder / "plain.toml").read_text())
    rows = (f"{a:.4f}\t{b:.4f}\t{c:.4f}\t\n" for a, b, c in zip(t, strain, twin, strict=True))
    head = "LabVIEW Measurement\t\nX_Columns\tOne\n***End_of_Header***\t\nDelta_X\t0.001\t0.001\t\n"
    text = head + "***End_of_Header***\t\nX_Value\tCH1\tCH2\tComment\n" + "".join(rows)
    (folder / "labview.lvm").write_text(text)
    (folder / "labview.toml").write_text(named)


#: family: (library, file, source of the grating, source of its twin)
EXTRA_LOGS = {
    "tdms": ("nptdms", "waves.tdms", "/run/CH1", "/run/CH2"),
    "excel": ("python_calamine", "sheet.xlsx", "CH1", "CH2"),
    "mdf": ("asammdf", "bus.mf4", "/run/CH1", "/run/CH2"),
    "feather": ("pyarrow", "batches.feather", "CH1", "CH2"),
}


def has_library(family: str) -> bool:
    """True if the library that a family's files need is installed."""
    return find_spec(EXTRA_LOGS[family][0]) is not None


def _extra_logs(folder: Path, t: NDArray, strain: NDArray, twin: NDArray) -> None:
    """Logs that a library reads, as far as it is installed, with their setups."""
    columns = {"CH1": strain, "CH2": twin}
    rows = [["time_s", *columns], *np.column_stack([t, strain, twin]).tolist()]
    frame = pd.DataFrame({"time_s": t, **columns})
    write: dict[str, Callable[[Path], object]] = {
        "tdms": lambda path: writers.tdms(path, columns, RATE_HZ, unit="nm"),
        "excel": lambda path: writers.xlsx(path, {"run": rows}),
        "mdf": lambda path: writers.mdf(path, columns, RATE_HZ, unit="nm"),
        "feather": lambda path: frame.to_feather(path),
    }
    for family, (_, name, grating, second) in EXTRA_LOGS.items():
        if has_library(family):
            write[family](folder / name)
            setup = SETUP.format(strain=grating, twin=second, log="")
            (folder / name).with_suffix(".toml").write_text(setup)


_PARAMETER = {"value": 4.0, "se": 0.1, "unit": "1"}
_STEP = {"rmse_fit": 2e-6, "rmse_heldout": 2e-6, "noise_floor": 2e-6, "excess_heldout": 5e-7}
#: a ladder as its command keeps it
LADDER = {
    "observable": "strain",
    "unit": "1",
    "verdict": "at_the_floor",
    "rmse_untouched": None,
    "floor_untouched": None,
    "logs": ["plain.csv"],
    "remarks": ["one"],
    "manoeuvres": 8,
    "manoeuvres_locked": 0,
    "steps": [
        {
            **_STEP,
            "step": k,
            "effect": effect,
            "p_adjusted": None,
            "outcome": outcome,
            "decision": outcome,
            "sentence": f"{effect}.",
            "parameters": {"k": _PARAMETER},
        }
        for k, (effect, outcome) in enumerate((("base", "start"), ("water_film", "added")))
    ],
}


def make(folder: Path) -> None:
    """Write every base file and its setup (`NAME.toml`) into `folder`.

    Raises RuntimeError if one of tirelog's own commands refuses a good file.
    """
    t, strain, twin = strain_log()
    for name, (data, setup) in _layouts(t, strain, twin).items():
        (folder / f"{name}.csv").write_bytes(data)
        (folder / f"{name}.toml").write_text(setup)
    plain = (folder / "plain.csv").read_bytes()
    packed = {
        "gz": gzip.compress(plain),
        "zst": zstandard.compress(plain),
        "xz": lzma.compress(plain),
    }
    for suffix, data in packed.items():
        (folder / f"packed.csv.{suffix}").write_bytes(data)
    (folder / "packed.toml").write_text((folder / "plain.toml").read_text())
    _other_formats(folder, t, strain, twin, plain)
    _extra_logs(folder, t, strain, twin)
    for name, compression in (
        ("none", CompressionType.NONE),
        ("zstd", CompressionType.ZSTD),
        ("lz4", CompressionType.LZ4),
    ):
        _mcap(folder / f"messages_{name}.mcap", compression, t, strain, twin)
        setup = SETUP.format(strain="/tire:strain", twin="/tire:twin", log="")
        (folder / f"messages_{name}.toml").write_text(setup)
    with h5py.File(folder / "samples.h5", "w") as file:
        for name, values in (("strain", strain), ("twin", twin)):
            made = file.create_dataset(
                f"/fbg/{name}", data=values, chunks=(500,), compression="gzip"
            )
            made.attrs["sampling_rate_Hz"] = RATE_HZ
    (folder / "samples.toml").write_text(
        SETUP.format(strain="/fbg/strain", twin="/fbg/twin", log="")
    )
    with h5py.File(folder / "encoder.h5", "w") as file:
        for name, values in zip(("encoder", "acceleration"), encoder_log(), strict=True):
            file.create_dataset(f"/wheel/{name}", data=values).attrs["sampling_rate_Hz"] = 5000.0
    (folder / "encoder.toml").write_text(ENCODER_SETUP)
    (folder / "scenario.toml").write_text(SCENARIO)
    (folder / "m.ladder.json").write_text(json.dumps(LADDER))
    (folder / "campaign.toml").write_text(CAMPAIGN)
    (folder / "conditions.csv").write_text("log,load_N,driver\na.csv,3300,ben\nb.csv,3400,anna\n")
    plain_log, setup = str(folder / "plain.csv"), str(folder / "plain.toml")
    for arguments in (
        ["ingest", plain_log, "-o", str(folder / "run_text.h5")],
        ["ingest", str(folder / "encoder.h5"), "-o", str(folder / "run_encoder.h5")],
        ["speed", plain_log, "-o", str(folder / "table.csv")],
        ["speed", plain_log, "-o", str(folder / "table.parquet")],
        ["speed", plain_log, "-o", str(folder / "table.ndjson")],
        ["speed", plain_log, "-o", str(folder / "table.json")],
        [
            "model",
            "new",
            "--carcass",
            "beam",
            "--setup",
            setup,
            "-o",
            str(folder / "model_beam.toml"),
        ],
        [
            "model",
            "new",
            "--carcass",
            "ring",
            "--setup",
            setup,
            "-o",
            str(folder / "model_ring.toml"),
        ],
        [
            "model",
            "add",
            str(folder / "model_beam.toml"),
            "water_film",
            "-o",
            str(folder / "model_water.toml"),
        ],
        *(
            [
                *("model", "forces", str(folder / "model_beam.toml"), "--speed", "12"),
                *("--slip=-0.1:0.1:0.1", "--slip-angle", "2", "-o", str(folder / f"forces.{kind}")),
            ]
            for kind in ("tdx", "tir")
        ),
    ):
        status = run([*arguments, "--quiet"] if arguments[0] in ("ingest", "speed") else arguments)
        if status:
            raise RuntimeError(f"status {status} for good input: tirelog {' '.join(arguments)}")
    own = """
[[effects]]
name = "my_wedge"
acts_on = "contact_pressure"
expression = "q * (speed / 20)**2 * exp((xi + L) / 0.02) * (xi < -L)"
parameters = { q = { value = 0.0, min = -1e6, max = 1e6 } }
"""
    (folder / "model_own.toml").write_text((folder / "model_beam.toml").read_text() + own)
