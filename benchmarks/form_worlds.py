"""Tires whose form no model has: strain logs from a spectral truth in plain numpy.

    suite, form, effect, tire --> case_of(...) --> Case --> write_case(case, folder)
        --> two logs with setups, truth.json

Nothing of tirelog is imported here, so that the truth shares neither code nor basis with what is
fitted. A tire is a transfer function from the pressure's to the strain's wave numbers on a closed
circumference, and a pressure profile over u = xi / L:

    strain(xi) = sum_n  y kappa^2 / (K(kappa) - mu c^2 kappa^2 + losses)  P(kappa) exp(i kappa xi)

xi [m] along the material's way, entry edge at -L. K = EJ kappa^4 + k and what a form adds to it.
The pressure's transform is tabulated once over kappa L, so that L may vary without a grid's edge.
Tuning and reporting differ in forms, tires and drives; what a tire's number draws is the same for
each form and effect, so that cases are pairs.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Profile = Callable[[Array], Array]

#: points round the circumference, and modes kept: strain falls as kappa^-3 or faster
POINTS, MODES = 4096, 700
#: the pressure's transform: step in u, length of the transform, bins kept (up to q = 245)
_STEP, _LENGTH, _BINS = 1.0 / 1024, 2**19, 20000
#: waveforms per turn between which samples are interpolated linearly in time
PER_TURN = 8
SAMPLING_RATE_HZ = 2500.0
REFERENCE_NM, STRAIN_GAIN = 1550.0, 1.27
GRAVITY_M_S2 = 9.81
#: least critical speed of a drawn tire [m/s]; plans end at 24
LEAST_CRITICAL_M_S = 34.0

#: loss factors of waves that blocks and a soft sector make; the second is in the whole strain, and
#: a tenth of a squared floor there
BLOCK_LOSS, SECTOR_LOSS = 0.1, 0.01

# ---- forms of the contact pressure ---------------------------------------------------------------


def _power(n: float, outer: float = 1.0) -> Profile:
    return lambda u: (1.0 - np.abs(u) ** n) ** outer


def _trapezoid(u: Array) -> Array:
    return np.minimum(1.0, (1.0 - np.abs(u)) / 0.25)


def _humps(u: Array) -> Array:
    """Three ribs' worth of pressure: edges and the middle carry more."""
    return (1.0 - u**8) * (1.0 + 0.35 * np.cos(2.0 * np.pi * u / 0.75))


def _rounded_box(u: Array) -> Array:
    over = np.clip((np.abs(u) - 0.75) / 0.25, 0.0, 1.0)
    return np.sqrt(1.0 - over**2)


def _raised_cosine(u: Array) -> Array:
    over = np.clip((np.abs(u) - 0.45) / 0.55, 0.0, 1.0)
    return 0.5 * (1.0 + np.cos(np.pi * over))


def _saddle(a: float, n: float = 4.0, lean: float = 0.0) -> Profile:
    return lambda u: (1.0 - np.abs(u) ** n) * (1.0 + a * u**2) * (1.0 - lean * u)


def _parabola(u: Array) -> Array:
    return 1.0 - u**2


@dataclass(frozen=True)
class Form:
    """What is not the model's: the pressure at light and heavy load, and parts of the structure.

    `shear_N` adds T kappa^2. `wavelength_factor` f and `wavelength_m` l change the foundation:
    k (1 + f x / (1 + x)), x = (kappa l)^2. `lateral` is the share of strain of a second bending
    mode on a foundation of 4 k. `blocks` is the modulation of the pressure by a pattern of pitch
    `pitch_m` fixed in the tread. `soft` is the loss of foundation over `sector_deg` of the wheel.
    """

    light: Profile = _parabola
    heavy: Profile | None = None
    shear_N: float = 0.0
    wavelength_factor: float = 0.0
    wavelength_m: float = 0.02
    lateral: float = 0.0
    blocks: float = 0.0
    pitch_m: float = 0.03
    soft: float = 0.0
    sector_deg: float = 40.0


FORMS: dict[str, dict[str, Form]] = {
    "tuning": {
        "parabola": Form(),
        "flat": Form(_power(6)),
        "trapezoid": Form(_trapezoid),
        "saddle": Form(_saddle(2.2, 2.0)),
        "box": Form(_power(20)),
        "smooth": Form(_power(2, 2.0)),
        "shifted": Form(lambda u: (1.0 - u**2) * (1.0 - 0.25 * u)),
        "flatter_by_load": Form(_power(2.4), _power(9)),
        "shear_layer": Form(shear_N=2500.0),
        "flat_shear": Form(_power(6), shear_N=2500.0),
        "hardening": Form(wavelength_factor=0.8),
        "blocks": Form(blocks=0.35),
        "soft_sector": Form(soft=0.5),
    },
    "reporting": {
        "parabola": Form(),
        "superellipse": Form(_power(2.5, 1 / 2.5)),
        "steep_ellipse": Form(_power(4, 0.25)),
        "three_humps": Form(_humps),
        "rounded_box": Form(_rounded_box),
        "raised_cosine": Form(_raised_cosine),
        "leaning_saddle": Form(_saddle(1.4, 4.0, 0.15)),
        "saddle_by_load": Form(_power(4), _saddle(1.8, 4.0)),
        "softening": Form(wavelength_factor=-0.4, wavelength_m=0.015),
        "lateral": Form(lateral=0.35),
        "flat_lateral": Form(_power(5), lateral=0.25),
        "fine_blocks": Form(_power(3), blocks=0.25, pitch_m=0.022),
        "wide_sector": Form(_power(3), soft=0.35, sector_deg=60.0),
    },
}

# ---- effects -------------------------------------------------------------------------------------

#: main parameters, before a tire's factor; all grow with it
EFFECTS: dict[str, dict[str, float]] = {
    "viscous_damping": {"damping_rate_1_s": 40.0},
    "hysteresis": {"loss_factor": 0.06},
    "load_transfer": {"coefficient": 0.5},
    "aero_load": {"coefficient": 0.4},
    "edge_impact": {"amplitude": 0.7},
    "water_film": {"amplitude": 0.13},
    "sensor_lag": {"lag_s": 1.8e-4},
    "pressure_offset": {"offset": 0.12},
    "wear": {"amplitude": 0.3, "lever_loss": 0.1},
}
#: factors of tires 1 to 5 (a higher number takes the median): 7 squared floors beside a refitted
#: beam on a parabola, by what is left of the effect's waveforms at 40 speeds and accelerations
FACTORS: dict[str, dict[str, tuple[float, ...]]] = {
    "tuning": {
        "viscous_damping": (1.7, 3.28, 2.65, 2.5, 2.75),
        "hysteresis": (0.94, 1.83, 1.44, 1.62, 1.33),
        "load_transfer": (0.39, 0.84, 0.57, 0.65, 0.56),
        "aero_load": (0.99, 1.22, 1.62, 1.75, 0.65),
        "edge_impact": (1.2, 1.62, 2.27, 1.95, 0.93),
        "water_film": (0.46, 0.88, 0.74, 0.79, 0.64),
        "sensor_lag": (4.69, 8.25, 5.49, 7.67, 6.31),
        "pressure_offset": (3.47, 4.21, 6.52, 5.34, 2.39),
        "wear": (0.47, 0.81, 0.78, 0.79, 0.54),
    },
    "reporting": {
        "viscous_damping": (1.8, 4.26, 2.49, 0.64, 2.97),
        "hysteresis": (1.24, 1.35, 1.05, 0.76, 1.25),
        "load_transfer": (0.59, 0.56, 0.44, 0.37, 0.51),
        "aero_load": (0.96, 1.14, 0.98, 0.8, 1.14),
        "edge_impact": (1.18, 1.29, 1.03, 1.26, 1.33),
        "water_film": (0.63, 0.68, 0.52, 0.44, 0.64),
        "sensor_lag": (6.17, 5.79, 4.94, 4.8, 6.2),
        "pressure_offset": (3.19, 3.46, 2.82, 3.86, 3.66),
        "wear": (0.84, 0.86, 0.67, 0.65, 0.83),
    },
}


def sizes_of(suite: str, effect: str, number: int) -> dict[str, float]:
    """Parameters of an effect on a tire; none for the effect ''."""
    if not effect:
        return {}
    factors = FACTORS[suite][effect]
    factor = factors[number - 1] if number <= len(factors) else float(np.median(factors))
    return {name: size * factor for name, size in EFFECTS[effect].items()}


# ---- tires and drives ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Tire:
    """Numbers of a tire that a suite and a number draw."""

    radius_m: float
    bending_N_m2: float
    foundation_N_m2: float
    mass_kg_m: float
    half_length_m: float
    load_N: float
    load_exponent: float
    lever_m: float
    inner: bool
    width_m: float = 0.205


@dataclass(frozen=True)
class LogConditions:
    load_N: float
    distance_km: float
    water_depth_mm: float


#: (seconds, speed at the end) of two logs each, 15 to 20 manoeuvres together
PLANS: dict[str, tuple[tuple[tuple[tuple[float, float], ...], ...], ...]] = {
    "tuning": (
        (
            ((6, 8), (4, 15), (6, 15), (5, 24), (6, 24), (4, 12), (6, 12), (2.5, 18), (6, 18),
             (4, 9)),
            ((5, 20), (3, 11), (6, 11), (5, 17), (6, 17), (6, 8), (6, 8), (6, 23), (5, 23),
             (3.5, 14)),
        ),
        (
            ((5, 10), (3, 16), (5, 16), (12, 8), (5, 8), (4, 21), (5, 21), (3, 14), (5, 14),
             (3, 9)),
            ((6, 13), (6, 23), (5, 23), (2.5, 15), (6, 15), (15, 8), (5, 8), (3, 14), (5, 14)),
        ),
    ),
    "reporting": (
        (
            ((5, 22), (14, 9), (5, 9), (2.5, 15), (5, 15), (2, 10), (5, 10), (5, 24), (4, 24),
             (3, 12), (4, 12)),
            ((5, 7.5), (3, 12), (5, 12), (3, 17), (5, 17), (3, 22), (5, 22), (4, 8), (5, 8),
             (10, 19), (5, 19)),
        ),
        (
            ((4, 14), (2, 20), (5, 20), (2.5, 11), (5, 11), (9, 24), (4, 24), (9, 13), (5, 13),
             (2, 8), (5, 8)),
            ((5, 18), (3, 9), (5, 9), (8, 21), (5, 21), (4, 7.5), (5, 7.5), (2.5, 14), (5, 14),
             (6, 24), (4, 24)),
        ),
    ),
}  # fmt: skip
#: of a log's load, tread age [km] and water depth [mm]
CONDITIONS = {
    "tuning": ((1.0, 2000.0, 0.0), (1.2, 30000.0, 1.0)),
    "reporting": ((0.85, 26000.0, 1.2), (1.12, 5000.0, 0.2)),
}
_SUITE_KEY = {"tuning": 31, "reporting": 47}


def tire_of(suite: str, number: int) -> Tire:
    """A tire's numbers, below its critical speed at all that is driven."""
    random = np.random.default_rng([_SUITE_KEY[suite], number])
    exponents = (0.5, 0.65, 0.5, 0.4, 0.8) if suite == "tuning" else (0.6, 0.5, 0.45, 0.7, 0.5)
    while True:
        bending, foundation = random.uniform(2.0, 8.0), random.uniform(1.2e6, 3.5e6)
        heaviest = 2.0 * np.sqrt(bending * foundation) / LEAST_CRITICAL_M_S**2
        if heaviest > 2.5:
            break
    return Tire(
        radius_m=round(random.uniform(0.285, 0.325), 4),
        bending_N_m2=bending,
        foundation_N_m2=foundation,
        mass_kg_m=random.uniform(2.5, min(6.0, heaviest)),
        half_length_m=random.uniform(0.045, 0.068),
        load_N=round(random.uniform(2900.0, 4100.0), 0),
        load_exponent=exponents[(number - 1) % len(exponents)],
        lever_m=random.uniform(2e-4, 6e-4),
        inner=bool(random.integers(2)),
    )


@dataclass(frozen=True)
class Drive:
    """A log's motion, sample by sample; the load follows at the instants."""

    time_s: Array
    speed_m_s: Array
    acceleration_m_s2: Array
    angle: Array


def drive_of(plan: tuple[tuple[float, float], ...], radius_m: float, random: Any) -> Drive:
    """Speeds joined by rounded ramps with a wander of some 0.2 %; plans are varied by up to 5 %."""
    knots_t, knots_v = [0.0], [plan[0][1]]
    factor = 1.0
    for number, (seconds, to) in enumerate(plan):
        if number == 0 or to != plan[number - 1][1]:
            factor = 1.0 + 0.05 * random.uniform(-1.0, 1.0)
        if number == 0:
            knots_v[0] = to * factor
        knots_t.append(knots_t[-1] + seconds * (1.0 + 0.05 * random.uniform(-1.0, 1.0)))
        knots_v.append(min(to * factor, 24.5))
    time = np.arange(int(knots_t[-1] * SAMPLING_RATE_HZ)) / SAMPLING_RATE_HZ
    half = int(0.2 * SAMPLING_RATE_HZ)
    wide = np.interp(
        np.arange(-half, time.size + half) / SAMPLING_RATE_HZ, np.array(knots_t), np.array(knots_v)
    )
    window = np.hanning(2 * half + 1)
    speed = np.convolve(wide, window / window.sum(), mode="valid")
    for hertz in random.uniform(0.05, 0.5, 4):
        speed = speed + 0.02 * np.sin(2 * np.pi * (hertz * time + random.uniform()))
    step = 1.0 / SAMPLING_RATE_HZ
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * step)])
    angle = random.uniform(0.0, 2 * np.pi) + turned / radius_m
    return Drive(time, speed, np.gradient(speed, step), angle)


# ---- the spectral truth --------------------------------------------------------------------------


@dataclass(frozen=True)
class Instants:
    """What a waveform depends on, at n instants."""

    speed_m_s: Array
    acceleration_m_s2: Array
    scatter: Array  # load over that of the log, less one
    log: LogConditions


class Truth(Protocol):
    """A tire that gives waveforms of strain, (n, POINTS) from xi = -pi R, with inner sign."""

    def load_N(self, at: Instants) -> Array: ...
    def half_length_m(self, at: Instants) -> Array: ...
    def waveforms(self, at: Instants) -> Array: ...
    def described(self) -> dict[str, Any]: ...


def _transform(profile: Callable[[Array], Array]) -> ComplexArray:
    """Integral of profile(u) exp(-i q u) over u, at q = 2 pi j / 512."""
    u = (np.arange(_LENGTH) - _LENGTH // 2) * _STEP
    values = np.zeros(_LENGTH)
    inside = np.abs(u) < 8.0
    values[inside] = profile(u[inside])
    return np.asarray(np.fft.fft(np.fft.ifftshift(values))[:_BINS] * _STEP, np.complex128)


def _on_patch(profile: Profile, times: Profile | None = None) -> Callable[[Array], Array]:
    def clipped(u: Array) -> Array:
        inside = np.clip(u, -1.0, 1.0)
        values = np.where(np.abs(u) < 1.0, profile(inside), 0.0)
        return values if times is None else values * times(inside)

    grid = np.linspace(-1.0, 1.0, 8193)
    total = float(np.trapezoid(profile(grid), grid))
    return lambda u: clipped(u) / total


#: pulses of pressure beside the profile, over u
_PULSES: dict[str, Callable[[Array], Array]] = {
    "edge_impact": lambda u: np.exp(-0.5 * ((u + 1.0) / 0.05) ** 2),
    "water_film": lambda u: np.where(
        u < -1.0, (-1.0 - u) / 0.4 * np.exp(1.0 - (-1.0 - u) / 0.4), 0.0
    ),
    "wear": lambda u: np.exp(-0.5 * ((u - 0.85) / 0.18) ** 2),
}


@dataclass
class SpectralTruth:
    """A linear tire of any K(kappa) under a pressure of any profile."""

    tire: Tire
    form: Form
    effect: str = ""
    sizes: Mapping[str, float] = field(default_factory=dict)
    phase: float = 0.0

    def __post_init__(self) -> None:
        self.kappa = np.arange(MODES) / self.tire.radius_m
        heavy = self.form.heavy or self.form.light
        profiles = [self.form.light, heavy]
        lean = [lambda u: u] if self.effect == "pressure_offset" else []
        self.tables = [_transform(_on_patch(p)) for p in profiles]
        self.leaning = [_transform(_on_patch(p, x)) for p in profiles for x in lean]
        self.pulse = _transform(_PULSES[self.effect]) if self.effect in _PULSES else None
        self._sector = self._sector_table() if self.form.soft else None

    def size(self, name: str) -> float:
        return self.sizes.get(name, 0.0)

    # load and length
    def load_N(self, at: Instants) -> Array:
        load = at.log.load_N * (1.0 + at.scatter)
        if self.effect == "load_transfer":
            load = load * (1.0 + self.size("coefficient") * at.acceleration_m_s2 / GRAVITY_M_S2)
        if self.effect == "aero_load":
            load = load * (1.0 + self.size("coefficient") * (at.speed_m_s / 30.0) ** 2)
        return load

    def half_length_m(self, at: Instants) -> Array:
        ratio = self.load_N(at) / self.tire.load_N
        return np.asarray(self.tire.half_length_m * ratio**self.tire.load_exponent)

    # structure
    def stiffness(self, kappa: Array) -> Array:
        """K(kappa) of the first mode [N/m^2]."""
        form, tire = self.form, self.tire
        x = (kappa * form.wavelength_m) ** 2
        foundation = tire.foundation_N_m2 * (1.0 + form.wavelength_factor * x / (1.0 + x))
        return np.asarray(tire.bending_N_m2 * kappa**4 + form.shear_N * kappa**2 + foundation)

    def _losses(self, at_kappa: Array, speed: Array) -> ComplexArray:
        """Loss terms of harmonics in time kappa, (n, modes)."""
        out = np.zeros((speed.size, at_kappa.size), np.complex128)
        if self.effect == "viscous_damping":
            rate = 2.0 * self.tire.mass_kg_m * self.size("damping_rate_1_s")
            out += 1j * rate * speed[:, None] * at_kappa
        if self.effect == "hysteresis":
            out += 1j * self.size("loss_factor") * self.tire.foundation_N_m2 * np.sign(at_kappa)
        return out

    def transfer(self, speed: Array) -> ComplexArray:
        """Strain per pressure at each harmonic of the passage, (n, modes)."""
        if self._sector is not None:
            return np.asarray(self._sector(speed), np.complex128)
        moving = -self.tire.mass_kg_m * speed[:, None] ** 2 * self.kappa**2
        moving = moving + self._losses(self.kappa, speed)
        form, k = self.form, self.tire.foundation_N_m2
        pitches = max(1.0, np.round(2 * np.pi * self.tire.radius_m / form.pitch_m))
        offset = pitches / self.tire.radius_m
        turn = 0.5 * form.blocks * np.exp(1j * self.phase)
        out = np.zeros(moving.shape, np.complex128)
        for shift, weight in ((0.0, 1.0), (offset, turn), (-offset, np.conj(turn))):
            if weight:
                at = self.kappa + shift
                stiffness = self.stiffness(at) + moving
                if shift:
                    # blocks make waves that run round the wheel, and only a loss ends them
                    stiffness = stiffness + BLOCK_LOSS * 1j * self.stiffness(at)
                first = at**2 / stiffness
                second = at**2 / (stiffness + 3.0 * k) if form.lateral else 0.0
                out += weight * ((1.0 - form.lateral) * first + form.lateral * second)
        return out

    def _sector_table(self) -> CubicSpline:
        """Transfer over speed of a foundation that depends on the place in the wheel.

        EJ d^4 + k(X) has eigenvectors in the material; each harmonic in time of the passage only
        shifts its eigenvalues, so one decomposition serves all speeds and harmonics.
        """
        points = 4 * MODES
        place = 2 * np.pi * np.arange(points) / points
        apart = np.abs((place - self.phase + np.pi) % (2 * np.pi) - np.pi)
        half = np.radians(self.form.sector_deg) / 2
        lost = self.form.soft * 0.5 * (1.0 - np.tanh((apart - half) / 0.05))
        spectrum = np.fft.fft(lost) / points * self.tire.foundation_N_m2
        few = 400  # modes of the coupled part; those beyond feel the mean foundation
        n = np.arange(-few, few + 1)
        matrix = -spectrum[(n[:, None] - n) % points]
        matrix[np.diag_indices(n.size)] += self.stiffness(n / self.tire.radius_m)
        values, vectors = np.linalg.eigh(matrix)
        products = ((n / self.tire.radius_m) ** 2 @ vectors)[:, None] * vectors.conj().T[:, few:]
        speeds = np.linspace(5.0, 26.0, 43)
        moving = -self.tire.mass_kg_m * speeds[:, None] ** 2 * self.kappa**2
        moving = moving + self._losses(self.kappa, speeds)
        table = self.kappa**2 / (self.stiffness(self.kappa) + moving)
        for row, shift in zip(table, moving, strict=True):
            damped = values * (1.0 + SECTOR_LOSS * 1j)
            inverse = 1.0 / (damped[:, None] + shift[None, : few + 1])
            row[: few + 1] = np.einsum("jm,jm->m", products, inverse)
        return CubicSpline(speeds, table)

    # pressure
    def pressure(self, at: Instants) -> ComplexArray:
        """Transform of the pressure [N] at each harmonic, (n, modes)."""
        load = self.load_N(at)
        q = self.half_length_m(at)[:, None] * self.kappa * (512.0 / (2 * np.pi))
        bins = np.arange(_BINS)

        def read(table: ComplexArray) -> ComplexArray:
            return np.asarray(np.interp(q.ravel(), bins, table).reshape(q.shape))

        heavy = np.clip((load / self.tire.load_N - 0.7) / 0.7, 0.0, 1.0)[:, None]

        def mixed(light: ComplexArray, loaded: ComplexArray) -> ComplexArray:
            return (1.0 - heavy) * read(light) + heavy * read(loaded)

        out = read(self.tables[0]) if self.form.heavy is None else mixed(*self.tables)
        if self.leaning:
            out = out - self.size("offset") * mixed(*self.leaning)
        if self.pulse is not None:
            fast = {
                "edge_impact": at.speed_m_s / 20.0,
                "water_film": (at.speed_m_s / 20.0) ** 2 * at.log.water_depth_mm,
                "wear": np.full(load.size, at.log.distance_km / 40000.0),
            }[self.effect]
            out = out + 0.5 * self.size("amplitude") * fast[:, None] * read(self.pulse)
        return np.asarray(load[:, None] * out / out[:, :1].real)

    def waveforms(self, at: Instants) -> Array:
        lever = self.tire.lever_m
        if self.effect == "wear":
            lever *= 1.0 - self.size("lever_loss") * at.log.distance_km / 40000.0
        around = 2 * np.pi * self.tire.radius_m
        spectrum = np.zeros((at.speed_m_s.size, POINTS // 2 + 1), np.complex128)
        spectrum[:, :MODES] = self.pressure(at) * self.transfer(at.speed_m_s) * lever / around
        if self.effect == "sensor_lag":
            swing = 1j * at.speed_m_s[:, None] * self.kappa * self.size("lag_s")
            spectrum[:, :MODES] /= 1.0 + swing
        waves = np.fft.irfft(spectrum, POINTS, axis=1) * POINTS
        return np.asarray(np.fft.fftshift(waves, axes=1))

    def described(self) -> dict[str, Any]:
        u = np.linspace(-1.0, 1.0, 201)
        kappa = np.linspace(0.0, 400.0, 81)
        return {
            "pressure": {
                "u": u.tolist(),
                "light": _on_patch(self.form.light)(u).tolist(),
                "heavy": _on_patch(self.form.heavy or self.form.light)(u).tolist(),
            },
            "half_length_m": self.tire.half_length_m,
            "load_exponent": self.tire.load_exponent,
            "stiffness": {
                "kappa_1_m": kappa.tolist(),
                "K_N_m2": self.stiffness(kappa).tolist(),
            },
        }


# ---- logs ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """One world: a truth, and two drives of it."""

    suite: str
    form: str
    effect: str
    number: int
    tire: Tire
    truth: Truth
    strength: Mapping[str, float]


def _instants(drive: Drive, scatter: Array, log: LogConditions) -> tuple[Array, Instants]:
    """Times of the waveforms, and what they depend on."""
    turns = drive.angle / (2 * np.pi)
    at = np.arange(np.floor(turns[0]) - 1, np.ceil(turns[-1]) + 2, 1.0 / PER_TURN)
    time = np.interp(at, turns, drive.time_s)
    time, first = np.unique(time, return_index=True)
    loads = CubicSpline(np.arange(scatter.size) - 2 + np.floor(turns[0]), scatter)(at[first])
    return time, Instants(
        np.interp(time, drive.time_s, drive.speed_m_s),
        np.interp(time, drive.time_s, drive.acceleration_m_s2),
        np.asarray(loads),
        log,
    )


def _at(instants: Instants, some: slice) -> Instants:
    return Instants(
        instants.speed_m_s[some],
        instants.acceleration_m_s2[some],
        instants.scatter[some],
        instants.log,
    )


def sampled(truth: Truth, drive: Drive, time: Array, instants: Instants) -> Array:
    """Strain at the sensor, sample by sample: cubic in xi, linear between two waveforms."""
    place = ((drive.angle + np.pi) % (2 * np.pi)) * POINTS / (2 * np.pi)
    out = np.empty(drive.time_s.size)
    block = 256
    for start in range(0, time.size - 1, block):
        stop = min(start + block, time.size - 1)
        waves = truth.waveforms(_at(instants, slice(start, stop + 1)))
        last = stop == time.size - 1
        inside = (drive.time_s >= time[start]) & ((drive.time_s < time[stop]) | last)
        moment = np.interp(
            drive.time_s[inside], time[start : stop + 1], np.arange(stop - start + 1)
        )
        row = np.minimum(moment.astype(int), stop - start - 1)
        share = moment - row
        x = place[inside]
        base = np.floor(x).astype(int)
        f = x - base
        weights = (
            -f * (f - 1) * (f - 2) / 6,
            (f + 1) * (f - 1) * (f - 2) / 2,
            -(f + 1) * f * (f - 2) / 2,
            (f + 1) * f * (f - 1) / 6,
        )
        value = np.zeros(x.size)
        for step, weight in zip((-1, 0, 1, 2), weights, strict=True):
            column = (base + step) % POINTS
            value += weight * ((1 - share) * waves[row, column] + share * waves[row + 1, column])
        out[inside] = value
    return out


def write_case(case: Case, folder: Path) -> list[Path]:
    """Two logs with a setup beside each, and truth.json.  -> the logs."""
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng([_SUITE_KEY[case.suite], case.number, 5])
    plans = PLANS[case.suite][case.number % len(PLANS[case.suite])]
    noise_nm, offset_nm = random.uniform(0.8e-3, 4e-3), random.uniform(-0.2, 0.2)
    scatter = random.uniform(0.01, 0.02)
    sign = 1.0 if case.tire.inner else -1.0
    logs, histories = [], []
    for number, plan in enumerate(plans):
        share, distance, depth = CONDITIONS[case.suite][number]
        log = LogConditions(round(case.tire.load_N * share, 0), distance, depth)
        drive = drive_of(plan, case.tire.radius_m, random)
        loads = scatter * random.standard_normal(int(drive.angle[-1] / (2 * np.pi)) + 8)
        time, at = _instants(drive, loads, log)
        strain = sign * sampled(case.truth, drive, time, at)
        nm = REFERENCE_NM * (1.0 + strain / STRAIN_GAIN) + offset_nm
        nm = nm + noise_nm * random.standard_normal(nm.size)
        path = folder / f"log_{number + 1}.csv.gz"
        rows = "\n".join(f"{t:.4f},{x:.4f}" for t, x in zip(drive.time_s, nm, strict=True))
        with gzip.open(path, "wt", compresslevel=3) as stream:
            stream.write(f"time_s,CH1\n{rows}\n")
        (folder / f"log_{number + 1}.csv.toml").write_text(_setup(case.tire, log), "utf-8")
        logs.append(path)
        histories.append(
            {
                "log": path.name,
                "time_s": time.tolist(),
                "speed_m_s": at.speed_m_s.tolist(),
                "load_N": case.truth.load_N(at).tolist(),
                "length_m": (2.0 * case.truth.half_length_m(at)).tolist(),
            }
        )
    told = {
        "suite": case.suite,
        "form": case.form,
        "tire": vars(case.tire),
        "planted": {"effect": case.effect, **case.strength},
        "noise_nm": noise_nm,
        "load_scatter": scatter,
        **case.truth.described(),
        "logs": histories,
    }
    (folder / "truth.json").write_text(json.dumps(told), "utf-8")
    return logs


def _setup(tire: Tire, log: LogConditions) -> str:
    """The setup file of a log."""
    return f"""[tire]
name = "form world"
unloaded_radius_m = {1.02 * tire.radius_m:.4f}
rolling_radius_m = {tire.radius_m:.4f}
section_height_m = 0.018
width_m = {tire.width_m}

[conditions]
load_N = {log.load_N}
inflation_pressure_Pa = 2.2e5
distance_km = {log.distance_km}
water_depth_mm = {log.water_depth_mm}

[channels.strain_1]
kind = "fbg_strain"
source = "CH1"
unit = "nm"
reference_wavelength_nm = {REFERENCE_NM}
strain_gain = {STRAIN_GAIN}
surface = "{"inner" if tire.inner else "outer"}"

[log]
sampling_rate_Hz = {SAMPLING_RATE_HZ}
time = "time_s"
"""


def case_of(suite: str, form: str, effect: str, number: int) -> Case:
    """A case of a suite; KeyError for a form or effect that it does not have."""
    tire = tire_of(suite, number)
    sizes = sizes_of(suite, effect, number)
    phase = float(np.random.default_rng([number, 3]).uniform(0.0, 2 * np.pi))
    truth = SpectralTruth(tire, FORMS[suite][form], effect, sizes, phase)
    return Case(suite, form, effect, number, tire, truth, sizes)
