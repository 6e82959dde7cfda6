"""An encoder and an in-tire accelerometer with known truth, by code of their own."""

from dataclasses import dataclass, field

import h5py
import numpy as np

from tirelog.data.recording import Channel, Recording, TimeAxis
from tirelog.data.setup import parse_setup

RATE_HZ = 10_000.0
RADIUS_M = 0.305
GRAVITY = 9.81
BLUR_S = 1 / (2 * np.pi * 3000.0)  # a bandwidth of 3 kHz

SETUP = """[tire]
unloaded_radius_m = 0.3126
{radius}
[conditions]
driven = {driven}
[channels.encoder]
kind = "wheel_encoder"
source = "e"
unit = "{unit}"
steps = {steps}
[channels.acceleration]
kind = "radial_acceleration"
source = "a"
unit = "g"
"""


@dataclass
class Drive:
    """Speed [m/s] at corner times [s], linear between."""

    corners_s: tuple
    corners_m_s: tuple
    radius_m: float = RADIUS_M

    def __post_init__(self):
        self.time = np.arange(0.0, self.corners_s[-1], 1 / RATE_HZ)
        self.speed = np.interp(self.time, self.corners_s, self.corners_m_s)
        mean = 0.5 * (self.speed[1:] + self.speed[:-1])
        self.angle = np.concatenate([[0.0], np.cumsum(mean / RATE_HZ / self.radius_m)])
        self.acceleration = np.gradient(self.speed, self.time)


# P4 Fig. 8: constant low speed, acceleration, constant speed, strong braking, constant low speed
DYNAMIC = ((0, 8, 13, 21, 23.5, 30), (10, 10, 22, 22, 10, 10))
RAMP = ((0, 5, 65, 70, 130, 135), (10, 10, 25, 25, 10, 10))
STEADY = ((0, 30), (10, 10))


@dataclass
class Encoder:
    steps: int = 48
    noise: float = 0.02
    pitch_deg: float = 0.4
    offset: float = 0.3
    grows: bool = True  # amplitude with speed, as an inductive sensor's
    wobble: float = 0.15  # amplitude over a turn
    start_rad: float = 0.3
    seed: int = 1000

    def pitch(self):
        """Pitch error [rad] of each tooth, zero mean."""
        error = np.random.default_rng(self.seed).uniform(-1, 1, self.steps)
        error -= error.mean()
        return np.deg2rad(self.pitch_deg) * error / np.abs(error).max()

    def bend(self, angle):
        """Pitch error [rad] at wheel angles, linear between the teeth."""
        place = np.arange(-1, self.steps + 1) * 2 * np.pi / self.steps
        error = np.concatenate([self.pitch()[-1:], self.pitch(), self.pitch()[:1]])
        return np.interp(np.mod(angle + self.start_rad, 2 * np.pi), place, error)

    def clean(self, drive):
        return np.sin(self.steps * (drive.angle + self.start_rad - self.bend(drive.angle)))

    def signal(self, drive):
        amplitude = 1 + self.wobble * np.cos(drive.angle)
        if self.grows:
            amplitude = amplitude * drive.speed / 10
        noise = np.random.default_rng(self.seed + 1).standard_normal(drive.time.size)
        return amplitude * (self.clean(drive) + self.noise * noise) + self.offset


@dataclass
class Tread:
    """Patch middle `place_rad` on the wheel; shift and width of (speed, acceleration) [deg]."""

    place_rad: float = 1.0
    shift: object = field(default=lambda v, a: np.zeros_like(v))
    width: object = field(default=lambda v, a: np.full_like(v, 25.0))
    noise_g: float = 1.2
    sharp_deg: float = 0.8
    spike: float = 0.5
    sign: int = -1  # outward positive
    delay_s: float = 0.0
    gravity: bool = True
    blur_s: float = BLUR_S
    seed: int = 1000

    def signal(self, drive):
        """Acceleration [m/s^2] as recorded."""
        late = drive.time - self.delay_s
        known = (drive.angle, drive.speed, drive.acceleration)
        angle, v, a = (np.interp(late, drive.time, x) for x in known)
        place = np.mod(angle - self.place_rad + np.pi, 2 * np.pi) - np.pi
        phi = np.rad2deg(place) - self.shift(v, a)
        outside = np.abs(phi) - self.width(v, a) / 2
        far = np.maximum(outside, 0.0) / 8.0
        flank = 1 + np.exp(-np.clip(outside / self.sharp_deg, -50, 50))
        shape = (1 + self.spike * np.exp(-far) * np.cos(far)) / flank
        inward = v**2 / drive.radius_m * shape
        if self.gravity:
            inward = inward + GRAVITY * np.cos(np.deg2rad(phi)) + a * np.sin(np.deg2rad(phi))
        reach = np.arange(-8, 9) / RATE_HZ
        kernel = np.exp(-0.5 * (reach / max(self.blur_s, 1e-9)) ** 2)
        noise = np.random.default_rng(self.seed + 2).standard_normal(drive.time.size)
        inward = np.convolve(inward, kernel / kernel.sum(), mode="same")
        inward = inward + self.noise_g * GRAVITY * noise
        step = 500 * GRAVITY / 32768
        return np.clip(self.sign * np.rint(inward / step) * step, -500 * GRAVITY, 500 * GRAVITY)


def recording(
    drive, encoder_signal, *accelerations, unit="V", steps=48, driven="true", radius=True,
    rate=RATE_HZ, speed=None,
):  # fmt: skip
    """A Recording of these samples, as a reader would give it."""
    known = f"rolling_radius_m = {RADIUS_M}" if radius else ""
    text = SETUP.format(unit=unit, steps=steps, driven=driven, radius=known)
    axis, tone = TimeAxis.uniform(drive.time.size, rate), {"settings": {"steps": steps}}
    signals = {
        "encoder": Channel.of_array("encoder", "wheel_encoder", encoder_signal, axis, **tone)
    }
    for number, values in enumerate(accelerations):
        name = f"acceleration{number or ''}"
        signals[name] = Channel.of_array(name, "radial_acceleration", values, axis, unit="m/s^2")
    if speed is not None:
        slow = TimeAxis.uniform(speed.size, 100.0)
        signals["speed"] = Channel.of_array("speed", "vehicle_speed", speed, slow, unit="m/s")
    return Recording("log.h5", signals, parse_setup(text))


def write_hdf5(path, channels):
    """Channels as name: (values, unit, rate [Hz]), in single precision."""
    with h5py.File(path, "w") as file:
        for name, (values, unit, rate_Hz) in channels.items():
            data = file.create_dataset(name, data=values.astype("f4"))
            data.attrs["unit"], data.attrs["sampling_rate_Hz"] = unit, rate_Hz


def angle_errors(wheel, drive):
    """Errors [deg] of the wheel angle at every sample that it covers, without the constant."""
    error = np.rad2deg(wheel.angle.at(drive.time) - drive.angle)
    error = error[np.isfinite(error)]
    return error - error.mean()


def front_errors(passages, drive, tread):
    """(errors of shift and width [deg], true speed), the constants removed."""
    rows = np.isfinite(passages.width_deg)
    time = passages.time_s[rows] - tread.delay_s
    v, a = np.interp(time, drive.time, drive.speed), np.interp(time, drive.time, drive.acceleration)
    middle = passages.entry_deg[rows] + passages.width_deg[rows] / 2
    shift, width = middle - tread.shift(v, a), passages.width_deg[rows] - tread.width(v, a)
    return shift - np.median(shift), width - np.median(width), v
