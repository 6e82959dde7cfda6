"""How far a second form of an effect is from the first: the cosine of what the two leave.

    python -m benchmarks.forms          prints the tables of docs/second_forms.md, 5 s

    world with an effect in each form, less the world without it, at instants of one drive
        -> what the free numbers of a fitted beam, a shift of each revolution and an offset would
           take is taken out -> cosine of the two residuals, over all instants and angles

Cosine one: no analysis can tell the two forms apart by shape. The drive goes from 7 to 23 m/s
while the tire warms by 20 K.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.physics.effects import BY_ID
from tirelog.physics.model.model import Model
from tirelog.simulation import scenario_of
from tirelog.simulation.scenario.schema import PLANTABLE, Sensor
from tirelog.simulation.steady.waveforms import World, drive_of, roughness_of
from tirelog.vocabulary.arrays import FloatArray

#: the cruises of the drive [m/s], and points round the wheel
_SPEEDS = (7.0, 11.0, 15.0, 19.0, 23.0)
_POINTS = 2048
_TIMES_S = 1.5 + 3.0 * np.arange(2 * len(_SPEEDS))
STRAIN = "fbg_strain"
#: sizes at which a form shows that is hardly there at its ordinary one
_SIZES = {"rough_contact": {"length": 0.4}, "gauge_length": {"length_m": 0.06}}
#: effects that an accelerometer shows, and no strain
_OF_ACCELERATION = ("sensor_tilt",)
#: effects on a number per revolution, which no waveform shows
_SKIPPED = ("speed_trend", "load_crosstalk", "telemetry_delay", "tooth_pitch", "inflation")


@dataclass(frozen=True)
class Compared:
    """Cosine of an effect's second form with its first.

    `as_planted` of what they add; `left` of what remains of it beside the fitted model.
    """

    name: str
    form: str
    as_planted: float
    left: float


def world_of(name: str, form: str) -> World:
    """A beam on five cruises with one effect (none for the name '')."""
    manoeuvres = []
    for speed in _SPEEDS:
        manoeuvres += [
            {"duration_s": 3.0, "speed_m_s": speed},
            {"duration_s": 3.0, "speed_m_s": speed},
        ]
    scenario = scenario_of(
        {
            "grid_points": _POINTS,
            "manoeuvres": manoeuvres,
            "channels": {"s": {"kind": "fbg_strain"}},
            "conditions": {
                "distance_km": 20000.0,
                "water_depth_mm": 1.0,
                "warm_up_K": 20.0,
                "warm_up_time_s": 15.0,
            },
            "nuisances": {"warming": {"pressure_per_K": 0.01}},
            "effects": [{"name": name, "form": form, **_SIZES.get(name, {})}] if name else [],
        }
    )
    random = np.random.default_rng(1)
    drive = drive_of(scenario, random)
    length = float(drive.angle_at(drive.time_s[-1])) * drive.radius_m
    return World(scenario, drive, roughness_of(scenario, length, random))


def waveforms(name: str, form: str, kind: str) -> FloatArray:
    """What a sensor of a kind reads round the wheel at the instants, (instants, points)."""
    world = world_of(name, form)
    sensor = Sensor(kind, surface="outer")
    wave = world.waveform(world.solve(world.instants(_TIMES_S)), sensor)
    return wave + world.baseline(_TIMES_S, sensor)[:, None] if kind == STRAIN else wave


@cache
def plain(kind: str) -> tuple[FloatArray, FloatArray]:
    """Of the world without an effect: waveforms, and orthonormal columns (N, k) that a fit takes.

    The free numbers of a beam, the shift of each revolution, an offset.
    """
    world = world_of("", "exact")
    at, tire = world.instants(_TIMES_S), world.scenario.tire
    blank = Model.new("beam", observable="strain" if kind == STRAIN else kind)
    values = {
        "foundation_stiffness_N_m2": tire.foundation_stiffness_N_m2,
        "patch_half_length_m": tire.patch_half_length_m,
        "reference_load_N": tire.reference_load_N,
        "radius_m": tire.rolling_radius_m,
        "lever_arm_m": tire.lever_arm_m,
    }
    model = blank.with_values({n: v for n, v in values.items() if n in blank.values})
    drive = Conditions.of(
        _TIMES_S.size, speed_m_s=at.speed, acceleration_m_s2=at.acceleration, load_N=at.load
    )
    angles = world.ring.xi_m / tire.rolling_radius_m
    told, slopes = model.linearised(drive, angles, model.free, surface="outer")
    shifts = np.gradient(told, axis=1) * np.eye(_TIMES_S.size)[:, :, None]
    columns = [x.ravel() for x in (*slopes, *shifts, np.ones(told.shape))]
    sized = np.stack([c / np.linalg.norm(c) for c in columns if c.any()], axis=1)
    basis, sizes, _ = np.linalg.svd(sized, full_matrices=False)
    return waveforms("", "exact", kind), np.asarray(basis[:, sizes > 1e-7 * sizes[0]], np.float64)


def compared(name: str, form: str) -> Compared:
    """The cosines of one form with the exact one."""
    kind = "radial_acceleration" if name in _OF_ACCELERATION else STRAIN
    base, basis = plain(kind)
    first, second = ((waveforms(name, f, kind) - base).ravel() for f in ("exact", form))
    left = [x - basis @ (basis.T @ x) for x in (first, second)]
    return Compared(name, form, _cosine(first, second), _cosine(*left))


def _cosine(a: FloatArray, b: FloatArray) -> float:
    return float(a @ b / max(np.linalg.norm(a) * np.linalg.norm(b), 1e-300))


def pairs() -> Iterator[tuple[str, str]]:
    """Effects and their forms beside the exact one, of those that change a waveform."""
    for name, known in PLANTABLE.items():
        if name not in _SKIPPED:
            yield from ((name, form) for form in known.forms if form != "exact")


def table() -> list[Compared]:
    """All of them."""
    return [compared(name, form) for name, form in pairs()]


@dataclass(frozen=True)
class Nearest:
    """Of an effect that no diagnosis tries: what is left of it beside the fitted model, as a share.

    And the effect that is tried whose remainder is likest, with the cosine's size.
    """

    name: str
    left: float
    tried: str
    cosine: float


def nearest() -> list[Nearest]:
    """Those that act on a strain."""
    base, basis = plain(STRAIN)

    def left_of(name: str) -> tuple[FloatArray, float]:
        x = (waveforms(name, "exact", STRAIN) - base).ravel()
        y = x - basis @ (basis.T @ x)
        return y, float(np.linalg.norm(y) / np.linalg.norm(x))

    known = [n for n in PLANTABLE if n in BY_ID and n not in (*_SKIPPED, *_OF_ACCELERATION)]
    tried = {name: left_of(name)[0] for name in known if BY_ID[name].tried}
    found = []
    for name in known:
        if not BY_ID[name].tried:
            own, share = left_of(name)
            likeness = {other: abs(_cosine(own, shape)) for other, shape in tried.items()}
            best = max(likeness, key=lambda other: likeness[other])
            found.append(Nearest(name, share, best, likeness[best]))
    return found


def rows_of_nearest() -> list[str]:
    """The second table of the page as lines of Markdown."""
    head = [
        "| effect | left beside the model | nearest that is tried | cosine |",
        "| --- | --- | --- | --- |",
    ]
    return head + [
        f"| `{n.name}` | {n.left:.2f} | `{n.tried}` | {n.cosine:.2f} |" for n in nearest()
    ]


def rows() -> list[str]:
    """The table as lines of Markdown."""
    head = ["| effect | form | as planted | beside the model |", "| --- | --- | --- | --- |"]
    return head + [
        f"| `{one.name}` | {one.form} | {one.as_planted:.2f} | {one.left:.2f} |" for one in table()
    ]


if __name__ == "__main__":
    print("\n".join([*rows(), "", *rows_of_nearest()]))
