"""Faults: error codes in a channel beside the sensor move no number."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

import tirelog

SAMPLES = Path(__file__).parents[2] / "sample_data"


@pytest.mark.parametrize(("code", "many"), [(9999.0, 30), (-99.0, 30), (65535.0, 1)])
def test_codes_in_the_vehicle_s_speed_move_no_slip(tmp_path: Path, code: float, many: int) -> None:
    hit = tmp_path / "encoder.h5"
    shutil.copy(SAMPLES / "encoder.h5", hit)
    with h5py.File(hit, "r+") as file:
        speed = file["vehicle/speed"]
        values = speed[()]
        values[np.random.default_rng(7301).choice(values.size, many, replace=False)] = code
        speed[...] = values
    own, clean = (
        tirelog.slip(log, setup=SAMPLES / "encoder.toml") for log in (hit, SAMPLES / "encoder.h5")
    )
    off = np.abs(own.slip - clean.slip) / clean.slip_se
    assert np.nanmax(off) < 2.0  # two samples of the thirteen of a turn are lost
    assert (own.quality == clean.quality).all()
