"""A real wheel: speeds by a sensor at its centre against its gyroscope and the car's GNSS track.

`python -m benchmarks.real_log [FOLDER]`: takes IMU1.csv and GNSS.csv of trial 2 of the Wheel
Inertial Dataset (Nemec, Versano et al., doi 10.6084/m9.figshare.27129999) from FOLDER, or fetches
them, and checks them by their checksums. They are not passed on here, as the repository names no
licence. Gravity turns once per revolution in the sensor's x axis: an encoder of one step. The
gyroscope's z axis is the axle, within some tenths of a percent. Positions come at 100 Hz, ten
times as often as their stamps say. Status 1 if turns or speeds leave the gyroscope by 2 %.
"""

from __future__ import annotations

import hashlib
import sys
import tempfile
import urllib.request
from pathlib import Path

import numpy as np
import pandas as pd

import tirelog

PLACE = (
    "https://raw.githubusercontent.com/ansfl/WID/9f15b32a26393c5870e83fc31948280eb41e5710"
    "/Datasets/trial02/"
)
SHA256 = {
    "IMU1.csv": "e53cee39172df95f4668c8721c13ef096821a76e86cd1d300fdeeb22c2d253bc",
    "GNSS.csv": "2bbd56d678b4f8fb218cc05b839ca469c40e79239185add749be5221ab7046ff",
}
RADIUS_M, EARTH_M = 0.288, 6_371_000.0
SETUP = f"""[tire]
rolling_radius_m = {RADIUS_M}
[channels.wheel]
kind = "wheel_encoder"
source = "Acc_X"
unit = "1"
steps = 1
"""


def fetched(name: str, folder: Path) -> Path:
    """The file in `folder`, fetched if it is not there.  SystemExit: it is another one."""
    path = folder / name
    if not path.exists():
        try:
            with urllib.request.urlopen(PLACE + name, timeout=60) as answer:
                path.write_bytes(answer.read())
        except OSError as problem:
            sys.exit(f"{PLACE}{name}: {problem}")
    if hashlib.sha256(path.read_bytes()).hexdigest() != SHA256[name]:
        sys.exit(f"{path}: not the file that the figures are of")
    return path


def main(folder: Path) -> int:
    log, track = fetched("IMU1.csv", folder), pd.read_csv(fetched("GNSS.csv", folder))
    setup = folder / "wheel.toml"
    setup.write_text(SETUP)
    table = tirelog.speed(log, setup=setup)
    gyro = pd.read_csv(log, skiprows=1, index_col=False)
    time_s = 1e-6 * (gyro.SampleTimeFine - gyro.SampleTimeFine[0]).to_numpy()
    rate_Hz = gyro.Gyr_Z.abs().to_numpy() / 360.0
    steps = 0.5 * (rate_Hz[1:] + rate_Hz[:-1]) * np.diff(time_s)
    turns = np.append(0.0, np.cumsum(steps))
    good = table[table.quality == "ok"]
    ends = [good.time_s + half * good.period_s for half in (-0.5, 0.5)]
    ratio = 1.0 / np.diff([np.interp(end, time_s, turns) for end in ends], axis=0)[0]
    north, east = np.deg2rad(track.Lat_GNSS), np.deg2rad(track.Long_GNSS)
    east *= np.cos(north.mean())
    distance_m = EARTH_M * np.hypot(np.diff(north), np.diff(east)).sum()
    near, radius_m = np.mean(np.abs(ratio - 1.0) < 0.02), distance_m / turns[-1] / (2.0 * np.pi)
    print(f"turns: {len(table)} rows, {turns[-1]:.1f} by the gyroscope")
    print(
        f"rows ok: {len(good)}; over the gyroscope: {np.median(ratio):.4f}, within 2 %: {near:.0%}"
    )
    print(f"GNSS: {distance_m:.0f} m, a rolling radius of {radius_m:.4f} m")
    off = max(abs(len(table) / turns[-1] - 1.0), abs(np.median(ratio) - 1.0))
    return int(off > 0.02)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else temporary)))
