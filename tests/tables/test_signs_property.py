"""Property: every column whose sign tells drive from braking has it right, in every table."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tirelog
from tirelog.cli import run
from tirelog.vocabulary.columns import COLUMNS, TABLES

pytestmark = pytest.mark.xdist_group("signs")  # one worker makes what these tests share

SCENARIO = """
seed = {seed}
[tire]
flexural_stiffness_N_m2 = 4.0
line_mass_kg_m = 4.5
torsional_stiffness_N_m2 = 1.5e5
[conditions]
load_N = 3434.0
driven = {driven}
[road]
roughness = 0.005
[[effects]]
name = "traction"
slip_per_g = 0.4
lever_m = 0.018
"""
LOAD_TRANSFER = '[[effects]]\nname = "load_transfer"\ncoefficient = 0.25\n'
MANOEUVRES = (
    (3, 9.0), (1.8, 15.0), (1.5, 15.0), (1.8, 21.0), (2, 21.0), (3, 9.0), (2, 9.0),
)  # fmt: skip
CHANNELS = {
    "strain_1": {"kind": "fbg_strain", "surface": "outer", "reference_wavelength_nm": 1550.0,
                 "noise": 0.0001},
    "acceleration": {"kind": "radial_acceleration", "sampling_rate_Hz": 1e4, "noise": 1.2,
                     "bandwidth_Hz": 3000.0, "range": 500.0, "bits": 16, "angle_deg": 200.0},
    "encoder": {"kind": "wheel_encoder", "sampling_rate_Hz": 1e4, "steps": 48, "noise": 0.02,
                "offset": 0.1, "range": 2.0, "bits": 12},
    "vehicle_speed": {"kind": "vehicle_speed", "sampling_rate_Hz": 100.0, "noise": 0.01},
    "force": {"kind": "longitudinal_force", "sampling_rate_Hz": 100.0, "noise": 20.0},
}  # fmt: skip
#: tables of a log in which a sign can tell the two apart
OF_A_DRIVE = ("speed", "footprint", "phase-shift", "slip", "grip", "strain-shift")
OF_A_MODEL = ("predict", "predict-all", "forces")


def simulated(path, seed, driven):
    """The log of a wheel that something drives, with its force, or that nothing does."""
    channels = {key: CHANNELS[key] for key in CHANNELS if driven or key != "force"}
    parts = [SCENARIO.format(seed=seed, driven=json.dumps(driven))]
    parts += [f"[[manoeuvres]]\nduration_s = {s}\nspeed_m_s = {v}\n" for s, v in MANOEUVRES]
    for key, values in channels.items():
        lines = (f"{name} = {json.dumps(value)}\n" for name, value in values.items())
        parts += [f'[channels.{key}]\nsource = "/{key}"\n', *lines]
    scenario = path.with_suffix(".scenario.toml")
    scenario.write_text("".join(parts) + ("" if driven else LOAD_TRANSFER))
    return made(path, "simulate", str(scenario))


def made(path, *words):
    """The path of what a command writes."""
    assert run([*words, "-o", str(path), "--quiet"]) == 0
    return str(path)


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """Each table of the drive, its rows in acceleration and in braking as the column `drives`."""
    folder = tmp_path_factory.mktemp("signs")
    log = simulated(folder / "driven.h5", 5, True)
    other = simulated(folder / "undriven.h5", 6, False)
    onsets = Path(__file__).parents[2] / "sample_data" / "scenarios" / "slip_onset.toml"
    # in whose strain more passages show the onset of slip
    slips = made(folder / "slips.h5", "simulate", str(onsets))
    logs = dict.fromkeys(OF_A_DRIVE, log) | {"footprint": slips, "grip": slips}
    found = {name: getattr(tirelog, name.replace("-", "_"))(logs[name]) for name in OF_A_DRIVE}
    maps, forces = (["--calibrate", str(folder / f"{name}.toml")] for name in ("map", "forces"))
    shifts = pd.read_csv(made(folder / "both.csv", "phase-shift", log, other, *maps))
    forced = pd.read_csv(made(folder / "f.csv", "phase-shift", log, *forces, "--fit-forces"))
    found["phase-shift"] = shifts.query("log == @log").assign(
        longitudinal_force_N=forced["longitudinal_force_N"]
    )
    for name, table in found.items():
        motion = json.loads(Path(f"{logs[name]}.truth.json").read_text())["motion"]
        true = np.interp(table["time_s"], motion["time_s"], motion["acceleration_m_s2"])
        table["drives"] = np.select([true > 2.0, true < -2.0], ["drive", "braking"], "")
    model = made(folder / "model.toml", "model", "new", "--preset", "P3")
    traction = ("traction", "--set", "slip_per_g=0.2")
    grips = made(folder / "grips.toml", "model", "add", model, *traction)
    formula = made(folder / "grips.tir", "model", "forces", grips, "--speed", "10")
    asked = {"predict-all": ("predict", "--all"), "forces": ("forces", "--against", formula)}
    for name, (verb, *more) in asked.items():
        parts = []
        for drives, acceleration, slip in (("drive", "3", "-0.06"), ("braking", "-3", "0.06")):
            motion = ["--speed", "10", "--acceleration", acceleration, "--slip", slip]
            path = made(folder / f"{name}.csv", "model", verb, grips, *motion, *more)
            parts.append(pd.read_csv(path).assign(drives=drives))
        found[name] = pd.concat(parts, ignore_index=True)
    found["predict"] = found["predict-all"]
    return found


@pytest.mark.parametrize("name", [*OF_A_DRIVE, *OF_A_MODEL])
def test_a_sign_tells_drive_from_braking(tables, name):
    table = tables[name]
    for column in TABLES[name]:
        positive = COLUMNS[column].positive_in
        if not positive:
            continue
        values = table.loc[table[column].abs() > 0.0].groupby("drives")[column]
        assert values.count()[["drive", "braking"]].min() >= 1, column
        signs = np.sign(values.median())
        assert signs[positive] == 1.0, column
        assert signs[{"drive": "braking", "braking": "drive"}[positive]] == -1.0, column


def test_every_signed_column_is_tried():
    signed = {c for columns in TABLES.values() for c in columns if COLUMNS[c].positive_in}
    tried = {c for name in (*OF_A_DRIVE, *OF_A_MODEL) for c in TABLES[name]}
    assert signed <= tried
    assert {"acceleration_m_s2", "slip", "longitudinal_force_N", "phase_shift_deg"} <= signed
    assert {"shear_traction_N_m", "hub_longitudinal_N", "phase_shift_corrected_deg"} <= signed


def test_a_column_says_what_it_is_in_its_own_table():
    column = COLUMNS["longitudinal_force_N"]
    assert "phase shift" in column.meaning_in("phase-shift")
    assert "friction used" in column.meaning_in("grip")
    assert all(column.meaning_in(name).endswith("positive in drive") for name in TABLES)
