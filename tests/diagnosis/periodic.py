"""Strain logs of a waveform that no tire model has made: any shape that repeats with the wheel."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import redirect_stdout
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from tirelog.cli import run

Array = NDArray[np.float64]
Random = np.random.Generator
Shape = Callable[[Array], Array]

RATE_HZ = 2000.0
RADIUS_M = 0.31
REFERENCE_NM = 1550.0
GAIN = 1.27
SETUP = """[tire]
name = "somebody's"
unloaded_radius_m = 0.318
rolling_radius_m = {radius}
section_height_m = 0.018
width_m = 0.2
[conditions]
load_N = {load}
inflation_pressure_Pa = 2.3e5
[channels.strain_1]
kind = "fbg_strain"
source = "FBG_1"
unit = "nm"
reference_wavelength_nm = {reference}
strain_gain = {gain}
surface = "{surface}"
"""


def _bump(angle: Array, at: float, width: float) -> Array:
    return np.exp(-0.5 * ((angle - at) / width) ** 2)


def _box(random: Random, half: float) -> Shape:
    """A box with soft edges and a shoulder of its own on either side."""
    edge = half * random.uniform(0.1, 0.4)
    left, right = random.uniform(0.0, 0.5, 2)
    width = half * random.uniform(0.4, 1.0)
    return lambda x: (
        0.5 * (np.tanh((x + half) / edge) - np.tanh((x - half) / edge))
        - left * _bump(x, -half - 1.5 * width, width)
        - right * _bump(x, half + 1.5 * width, width)
    )


def _asymmetric(random: Random, half: float) -> Shape:
    """A bump with flanks of two widths, and one shoulder."""
    before, behind = half * random.uniform(0.3, 0.9, 2)
    share = random.uniform(0.1, 0.6)
    return lambda x: (
        np.where(x < 0.0, _bump(x, 0.0, before), _bump(x, 0.0, behind))
        - share * (_bump(x, 2.0 * half, 0.7 * half))
    )


def _fourier(random: Random, half: float) -> Shape:
    """A bump on a Fourier series by chance."""
    order = np.arange(1, 13)
    size = 0.12 / order ** random.uniform(0.5, 1.5) * random.standard_normal(12)
    phase = random.uniform(0.0, 2.0 * np.pi, 12)
    return lambda x: (
        _bump(x, 0.0, 0.6 * half) + (size * np.cos(order * x[..., None] + phase)).sum(axis=-1)
    )


def _spline(random: Random, half: float) -> Shape:
    """A periodic spline through values by chance, one of them large."""
    beside = np.linspace(-np.pi, np.pi, 17)
    beside = beside[np.abs(beside) > 2.0 * half]
    nodes = np.sort(np.r_[beside, -half, 0.0, half])
    values = 0.08 * random.standard_normal(nodes.size)
    values[np.abs(nodes) < 0.5 * half] = 1.0
    values[-1] = values[0]
    curve = CubicSpline(nodes, values, bc_type="periodic")
    return lambda x: np.asarray(curve(x), np.float64)


SHAPES: Mapping[str, Callable[[Random, float], Shape]] = MappingProxyType(
    {"box": _box, "asymmetric": _asymmetric, "fourier": _fourier, "spline": _spline}
)


def drive(random: Random, manoeuvres: int, seconds: float) -> Array:
    """Speed [m/s] at each sample: a stretch per manoeuvre, with short changes between them."""
    speeds = random.permutation(np.linspace(*sorted(random.uniform(6.0, 30.0, 2)), manoeuvres))
    if np.ptp(speeds) < 4.0:
        speeds += np.linspace(0.0, 6.0, manoeuvres)
    at, t = [0.0], 0.0
    value = [speeds[0]]
    for number, speed in enumerate(speeds):
        if number:
            t += 0.1 * seconds + abs(speed - value[-1]) / random.uniform(1.5, 4.0)
            at.append(t)
            value.append(speed)
        t += seconds * random.uniform(0.8, 1.3)
        at.append(t)
        value.append(speed)
    return np.interp(np.arange(0.0, t, 1.0 / RATE_HZ), at, value)


def write_log(
    path: Path, seed: int, shape: str = "", *, manoeuvres: int = 7, seconds: float = 4.0
) -> str:
    """The name of the shape of a log written at `path`, its setup beside it."""
    random = np.random.default_rng(seed)
    name = shape or str(random.choice(list(SHAPES)))
    of_angle = SHAPES[name](random, random.uniform(0.15, 0.3))
    speed = drive(random, manoeuvres, seconds)
    turned = np.cumsum(speed) / RATE_HZ / RADIUS_M + random.uniform(0.0, 2.0 * np.pi)
    turn = np.floor(turned / (2.0 * np.pi)).astype(int)
    angle = np.mod(turned, 2.0 * np.pi) - np.pi
    size = random.uniform(4e-4, 2e-3) * (1.0 + random.choice([0.0, 0.01]) * (speed - speed.mean()))
    level = 1.0 + random.choice([0.0, 0.01, 0.04]) * random.standard_normal(turn.max() + 1)
    surface = str(random.choice(["outer", "inner"]))
    strain = (1.0 if surface == "inner" else -1.0) * size * level[turn] * of_angle(angle)
    noise = random.uniform(3e-4, 2e-3) * random.standard_normal(strain.size)
    wavelength = REFERENCE_NM * (1.0 + strain / GAIN) + noise
    rows = (f"{k / RATE_HZ:.4f},{w:.4f}" for k, w in enumerate(wavelength))
    path.write_text("time_s,FBG_1\n" + "\n".join(rows) + "\n")
    path.with_suffix(".toml").write_text(
        SETUP.format(
            radius=RADIUS_M,
            load=f"{random.uniform(2500.0, 5000.0):.0f}",
            reference=REFERENCE_NM,
            gain=GAIN,
            surface=surface,
        )
    )
    return name


#: the commands that answer for a model, and a word of each answer
COMMANDS: Mapping[str, str] = MappingProxyType(
    {
        "compare": '"rmse_heldout"',
        "diagnose": '"verdict"',
        "ladder": '"decision"',
        "propose": '"status"',
        "report": 'section id="model"',
    }
)


def failures(
    folder: Path, carcass: str, log: str = "log.csv", commands: Iterable[str] = COMMANDS
) -> list[str]:
    """What went wrong with each command on a log in the folder, with a fresh model."""
    model, at = str(folder / "model.toml"), str(folder / log)
    setup = at.replace(".csv", ".toml")
    made = ["model", "new", "--carcass", carcass, "--setup", setup, "-o", model, "--quiet"]
    found = [] if run(made) == 0 else ["model new"]
    for name in commands:
        answer, page = folder / "answer.json", folder / "page.html"
        options = ["-o", str(page)] if name == "report" else ["--format", "json"]
        with answer.open("w", encoding="utf-8") as stream, redirect_stdout(stream):
            status = run([name, at, "--model", model, "--quiet", *options])
        told = page if name == "report" and page.is_file() else answer
        if status or COMMANDS[name] not in told.read_text(encoding="utf-8"):
            found.append(f"{name}: status {status}")
    return found
