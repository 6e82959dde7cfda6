"""Property: forces that a model exports come back, as a TYDEX table and as a Magic Formula."""

import numpy as np
import pandas as pd
import pytest

from benchmarks.goldens import tirelog
from tirelog.api.models import read_forces

ASKED = ("--speed", "20", "--load", "2000,4000,6000", "--slip=-0.2:0.2:0.1")
NAMES = ("longitudinal_N", "lateral_N", "aligning_moment_N_m")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a beam whose brush has less friction where it slides."""
    folder = tmp_path_factory.mktemp("forces")
    assert tirelog(folder, "model", "new", "--preset", "P2", "-o", "p2.toml").status == 0
    assert tirelog(folder, "model", "add", "p2.toml", "traction", "-o", "m.toml").status == 0
    return folder


def table(folder, *arguments):
    done = tirelog(folder, "model", "forces", "m.toml", *arguments, "-o", "table.csv")
    assert done.status == 0, done.err
    return pd.read_csv(folder / "table.csv"), done.err


def test_a_tydex_file_gives_the_rows_back(folder):
    asked = (*ASKED, "--slip-angle", "3", "--camber", "2")
    rows, _ = table(folder, *asked)
    assert tirelog(folder, "model", "forces", "m.toml", *asked, "-o", "rig.tdx").status == 0
    again, said = table(folder, "--against", "rig.tdx")
    for name in ("speed_m_s", "load_N", "slip", "slip_angle_deg", "camber_deg"):
        np.testing.assert_allclose(again[name], rows[name], rtol=1e-6)
    for name in NAMES:
        wanted = rows[name if name.startswith("aligning") else f"road_{name}"]
        np.testing.assert_allclose(again[f"reference_{name}"], wanted, rtol=1e-6, atol=1e-4)
    assert said.count("root mean square of 15 rows") == 3


def test_a_braked_wheel_is_pushed_back_in_iso_s_axes(folder):
    asked = ("--speed", "20", "--slip", "0.1", "--slip-angle", "3")
    assert tirelog(folder, "model", "forces", "m.toml", *asked, "-o", "one.tdx").status == 0
    lines = (folder / "one.tdx").read_text().splitlines()
    names = [line.split()[0] for line in lines[lines.index("**MEASURCHANNELS") + 1 :]]
    row = dict(zip(names, map(float, lines[-2].split()), strict=False))
    assert row["LONGSLIP"] == -0.1
    assert row["FX"] < 0.0 < row["SLIPANGL"]
    assert row["FYW"] < 0.0 < row["MZW"]


def test_a_fitted_magic_formula_is_the_brush_to_a_percent_of_its_peak(folder):
    done = tirelog(folder, "model", "forces", "m.toml", *ASKED, "-o", "tire.tir")
    assert done.status == 0
    assert "a Magic Formula leaves" in done.err
    for asked in (("--slip=-0.9:0.9:0.05",), ("--slip-angle", "6"), ("--slip-angle", "-15")):
        rows, _ = table(
            folder, "--speed", "20", "--load", "2000,3000,6000", *asked, "--against", "tire.tir"
        )
        for name in NAMES[:2]:
            off = rows[f"road_{name}"].fillna(0.0) - rows[f"reference_{name}"]
            assert np.abs(off / rows["load_N"]).max() < 0.02
    assert read_forces(folder / "tire.tir")["FNOMIN"] == 4000.0
