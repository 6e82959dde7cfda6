"""A long text log of 16 gratings at 2.5 kHz for the benchmarks: pulses at a changing speed, made
block by block.
"""

from pathlib import Path

import numpy as np

RATE_HZ, RADIUS_M, GRATINGS = 2500.0, 0.305, 16
SETUP_TIRE = (
    "[tire]\nrolling_radius_m = 0.305\nunloaded_radius_m = 0.3126\nsection_height_m = 0.018\n"
    "width_m = 0.215\n"
)


def write(path: Path, minutes: float, seed: int = 1) -> None:
    """`path` and its setup beside it; 0.48 GB for a quarter of an hour, 1.9 GB for an hour."""
    channels = [f"CH{i // 4 + 1}_FBG{i % 4 + 1}" for i in range(GRATINGS)]
    setup = SETUP_TIRE + '[log]\ntime = "time_s"\nsampling_rate_Hz = 2500.0\n'
    for name in channels:
        setup += f'[channels.{name}]\nkind = "fbg_strain"\nsource = "{name}"\nunit = "nm"\n'
        setup += "reference_wavelength_nm = 1550.0\nstrain_gain = 1.27\n"
    path.with_suffix(".toml").write_text(setup)
    rng = np.random.default_rng(seed)
    step, travelled = 50_000, 0.0
    with path.open("w") as out:
        out.write("time_s," + ",".join(channels) + "\n")
        for start in range(0, int(minutes * 60 * RATE_HZ), step):
            t = (start + np.arange(step)) / RATE_HZ
            speed = 14 + 6 * np.sin(2 * np.pi * t / 60)
            x = travelled + np.cumsum(speed) / RATE_HZ
            travelled = float(x[-1])
            table = np.empty((step, GRATINGS), dtype=np.int64)
            for i in range(GRATINGS):
                d = (np.mod(x / RADIUS_M + 2 * np.pi * i / GRATINGS, 2 * np.pi) - np.pi) * RADIUS_M
                strain = 1e-3 * (
                    0.35 * np.exp(-(((np.abs(d) - 0.09) / 0.04) ** 2)) - np.exp(-((d / 0.035) ** 2))
                )
                table[:, i] = np.rint(
                    (1550.0 * (1 + strain / 1.27) + 0.0008 * rng.standard_normal(step)) * 1e4
                )
            digits = [
                [f"{v // 10000}.{v % 10000:04d}" for v in column.tolist()] for column in table.T
            ]
            stamps = [f"{v:.4f}" for v in t.tolist()]
            out.writelines(",".join(row) + "\n" for row in zip(stamps, *digits, strict=True))
