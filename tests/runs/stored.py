"""Values of three channels whose strain has a temperature twin, and a run that holds them."""

from pathlib import Path

import numpy as np

from tirelog.data.recording import TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.readers.base import Group, RawBlock
from tirelog.runs.store import write_file
from tirelog.runs.temporary import CHUNK, RunWriter
from tirelog.vocabulary.quality import Quality

SETUP = """[tire]
unloaded_radius_m = 0.3
[channels.s]
kind = "fbg_strain"
source = "a"
reference_wavelength_nm = 1550.0
strain_gain = 1.25
thermal_expansion_1_K = 2e-6
temperature_channel = "t"
[channels.t]
kind = "fbg_temperature"
source = "b"
reference_wavelength_nm = 1540.0
[channels.v]
kind = "vehicle_speed"
source = "c"
unit = "km/h"
"""

SIZE = 2 * CHUNK + 777


def source() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    s = np.round(1550 + 0.5 * rng.standard_normal(SIZE), 4)
    s[rng.random(SIZE) < 0.01] = np.nan
    t = np.round(1540 + 0.01 * rng.standard_normal(SIZE), 4)
    v = rng.random(SIZE).astype(np.float32).astype(float)
    return {"s": s, "t": t, "v": v}


def write(
    path: Path,
    values: dict[str, np.ndarray],
    *,
    block: int = CHUNK,
    times_s: np.ndarray | None = None,
) -> None:
    """The run of `values` in `path`, with flags, a remark and a loss; `times_s`: of all samples."""
    group = Group("g", ("s", "t", "v"))
    folder = path.with_suffix(".samples")
    folder.mkdir()
    writer = RunWriter(folder, parse_setup(SETUP), (group,))
    for start in range(0, SIZE, block):
        part = {name: v[start : start + block] for name, v in values.items()}
        flags = (("s", 1, 3, Quality.SPURIOUS_PEAK),) if start == 0 else ()
        writer.append(RawBlock("g", part, flags=flags))
    axis = TimeAxis(SIZE, 2500.0, np.array([0, 5000]), np.array([0.0, 3.0]), np.array([4e-4, 4e-4]))
    axis = axis if times_s is None else TimeAxis.of_times(times_s)
    run = writer.finish(
        {"g": axis},
        {"g": [(5000, 5001, Quality.GAP)]},
        {"sha256": "00", "remarks": ["a remark"], "losses": ["a loss"]},
    )
    write_file(run, path)
