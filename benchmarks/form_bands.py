"""Bands of `tirelog form`, and errors of parameters with the form, against tires that are known.

    python -m benchmarks.form_bands --suite tuning|reporting [--forms all|flat,saddle,...]
                                    [--tires 1-2] [--keep DIR]

Per world of `benchmarks.form_worlds`: the contact pressure's rms error over its mean on the patch,
the share of its points within one and two errors, the same of the stiffness where each wave has one
of its own; then each parameter of a fitted beam: how far it is from the tire's by its error, and by
its error with the form. Stiffnesses and the lever arm are scaled to the model's line mass, as a
strain log shows them. Logs in DIR are used again.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.form_cases import command
from benchmarks.form_worlds import (
    FORMS,
    Array,
    Profile,
    SpectralTruth,
    Tire,
    case_of,
    write_case,
)

#: the line mass of a new model, to which what a strain log shows is scaled
MODEL_MASS_KG_M = 4.5
ERRORS = ("se", "se_with_form")


@dataclass
class World:
    """A world's bands (4,) by quantity, and how far off its parameters are (3,) by name."""

    bands: dict[str, Array] = field(default_factory=dict)
    off: dict[str, list[float]] = field(default_factory=dict)


def band(missed: Array, error: Array, mean: Array | float) -> Array:
    """(4,) rms error and rms band over the mean, share within one and two bands."""
    sizes = [float(np.sqrt(np.mean((x / mean) ** 2))) for x in (missed, error)]
    return np.array([*sizes, *(float(np.mean(np.abs(missed) <= n * error)) for n in (1, 2))])


def shown(figures: Array) -> str:
    return "".join(f"{100 * x:7.1f}%" for x in figures[:2]) + "".join(
        f"{100 * x:6.0f}%" for x in figures[2:]
    )


def answer(arguments: list[str], output: Path) -> dict[str, Any]:
    """What a command of tirelog writes as JSON."""
    status, _, _ = command([*arguments, "--format", "json", "--quiet"], output)
    if status:
        raise SystemExit(f"{arguments[0]} ended with {status}: see {output.with_suffix('.err')}")
    told: dict[str, Any] = json.loads(output.read_text("utf-8"))
    return told


def pressure_band(told: dict[str, Any], truth: dict[str, Any]) -> Array:
    """The band of the pressure on the patch, of the tire or of the model where that is longer."""
    tire, load = truth["tire"], told["load_N"]
    ratio = load / tire["load_N"]
    half = tire["half_length_m"] * ratio ** tire["load_exponent"]
    heavy = min(max((ratio - 0.7) / 0.7, 0.0), 1.0)
    light, loaded = (np.array(truth["pressure"][n]) for n in ("light", "heavy"))
    profile, u = (1.0 - heavy) * light + heavy * loaded, np.array(truth["pressure"]["u"])
    at, value, error = (np.array(told["pressure"][n]) for n in ("at", "value", "se"))
    place = at / half + np.trapezoid(u * profile, u) / np.trapezoid(profile, u)
    true = load / half * np.interp(place, u, profile, 0.0, 0.0)
    patch = np.abs(place) <= max(1.0, told["half_length_m"] / half)
    return band((value - true)[patch], error[patch], load / (2.0 * half))


def stiffness_band(told: dict[str, Any], truth: dict[str, Any], stiffness: Profile) -> Array:
    """The band of the stiffness from 2 to 120 waves in a turn."""
    at, value, error = (np.array(told["stiffness"][n]) for n in ("at", "value", "se"))
    waves = 2.0 * np.pi / at
    true = stiffness(waves) * MODEL_MASS_KG_M / truth["tire"]["mass_kg_m"]
    return band(value - true, error, true)


def off_by(told: dict[str, Any], truth: dict[str, Any]) -> Iterator[tuple[Any, ...]]:
    """Each fitted parameter: name, error over value, over its errors without and with form."""
    tire, found = truth["tire"], told["parameters"]
    scale = found["line_mass_kg_m"]["value"] / tire["mass_kg_m"]
    reference = found["reference_load_N"]["value"] / tire["load_N"]
    true = {
        "flexural_stiffness_N_m2": tire["bending_N_m2"] * scale,
        "foundation_stiffness_N_m2": tire["foundation_N_m2"] * scale,
        "lever_arm_m": tire["lever_m"] * scale,
        "patch_half_length_m": tire["half_length_m"] * reference ** tire["load_exponent"],
    }
    for name, value in true.items():
        one = found[name]
        yield (
            name,
            *((one["value"] - value) / x for x in (value, *(one[k] or np.inf for k in ERRORS))),
        )


def world(options: argparse.Namespace, folder: Path, name: str, number: int) -> World:
    """One world, written if it is not there, and what the commands say of it."""
    logs = sorted(folder.glob("*.csv.gz"))
    logs = logs or write_case(case_of(options.suite, name, "", number), folder)
    model, paths = folder / "model.toml", [str(log) for log in logs]
    new = ["model", "new", "--setup", f"{paths[0][:-3]}.toml", "-o", str(model)]
    if not model.exists() and command(new, folder / "new.txt")[0]:
        raise SystemExit(f"{folder}: no model")
    truth = json.loads((folder / "truth.json").read_text("utf-8"))
    asked, result, line = [*paths, "--model", str(model)], World(), f"{name:18s}{number:3d}"
    form = FORMS[options.suite][name]
    if options.only != "compare":
        told = answer(["form", *asked], folder / "form.json")
        result.bands["pressure"] = pressure_band(told, truth)
        line += f"  chi2 {told['reduced_chi2']:6.2f}  {shown(result.bands['pressure'])}"
        if not (form.lateral or form.blocks or form.soft):
            spectral = SpectralTruth(Tire(**truth["tire"]), form)
            result.bands["stiffness"] = stiffness_band(told, truth, spectral.stiffness)
            line += "   K " + shown(result.bands["stiffness"])
    if options.only != "form":
        told = answer(["compare", *asked], folder / "compare.json")
        result.off = {parameter: off for parameter, *off in off_by(told, truth)}
        for parameter, (share, plain, with_form) in result.off.items():
            line += f"\n    {parameter:30s}{100 * share:+7.1f} %{plain:+9.1f}{with_form:+7.2f}"
    print(line, flush=True)
    return result


def main() -> None:
    """All worlds of a suite, and their means."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--suite", choices=list(FORMS), default="tuning")
    parser.add_argument("--forms", default="all")
    parser.add_argument("--tires", default="1-2")
    parser.add_argument("--only", choices=("both", "form", "compare"), default="both")
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    forms = list(FORMS[options.suite]) if options.forms == "all" else options.forms.split(",")
    first, _, last = options.tires.partition("-")
    print(
        "world, chi-square; pressure and stiffness K: rms error, rms band, within one, within two"
    )
    with tempfile.TemporaryDirectory() as scratch:
        kept = options.keep or Path(scratch)
        worlds = [
            world(options, kept / f"{options.suite}_{name}_{number}", name, number)
            for name in forms
            for number in range(int(first), int(last or first) + 1)
        ]
    for quantity in ("pressure", "stiffness"):
        rows = [w.bands[quantity] for w in worlds if quantity in w.bands]
        if rows:
            print(f"{quantity:10s} mean of {len(rows):3d} worlds   {shown(np.mean(rows, axis=0))}")
    for parameter in worlds[0].off:
        offs = np.abs([w.off[parameter][1:] for w in worlds])
        within = [f"{100 * np.mean(offs[:, k] <= n):.0f} %" for k in (0, 1) for n in (1, 2)]
        print(
            f"{parameter:30s} {len(offs)} worlds within one, two errors: {', '.join(within[:2])}; "
            f"with the form: {', '.join(within[2:])}"
        )


if __name__ == "__main__":
    main()
