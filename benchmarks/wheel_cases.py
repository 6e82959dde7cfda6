"""Scenarios of a wheel with encoder and in-tire accelerometer (P4), by a few arguments.

    plan, driven or not, pressure, planted effects, seed --> wheel_scenario(...)
        --> Scenario, ready for `simulate`

The truth of every passage has the phase shift (wind-up by the longitudinal force, what is planted
of trend and cross-talk) and the patch width of the load. A telemetry delay moves the acceleration
in time and is no part of the shift.
"""

from __future__ import annotations

from dataclasses import dataclass

from tirelog.errors import UsageError, nearest
from tirelog.simulation.scenario.schema import (
    Manoeuvre,
    Planted,
    Road,
    Scenario,
    Sensor,
    TrueConditions,
    TrueTire,
)
from tirelog.storage.schema import Record

#: (seconds, speed at the end [m/s], regime or None)
WHEEL_PLANS: dict[str, tuple[tuple[float, float, str | None], ...]] = {
    # the five parts of P4 Fig. 8
    "dynamic": ((10, 10, None), (6, 23, None), (14, 23, None), (3, 9, None), (8, 9, None)),
    # quasi-static, up and down
    "ramp": ((5, 10, None), (28, 24, "drive"), (3, 24, None), (28, 10, "coast"), (4, 10, None)),
    "coast_down": ((3, 25, None), (40, 10, "coast"), (3, 10, None)),
}
#: the sidewalls' resistance to wind-up [N/m^2]: about a degree at the limit of grip
TORSIONAL_STIFFNESS_N_M2 = 1.5e5
NOMINAL_PRESSURE_PA = 2.0e5


@dataclass(frozen=True)
class Instruments:
    """Accelerometer and encoder of P4: noise in g and in parts of the amplitude, largest pitch
    error, telemetry delay, place.
    """

    acceleration_noise_g: float = 1.2
    encoder_noise: float = 0.02
    pitch_error_deg: float = 0.3
    delay_s: float = 0.0
    angle_deg: float = 200.0
    forces: bool = False


def wheel_channels(with_: Instruments) -> dict[str, Record]:
    """10 kHz accelerometer (3 kHz, +-500 g, 16 bit) and encoder (48 steps, 12 bit); vehicle
    channels and, where asked, forces at 100 Hz.
    """
    channels = {
        "acceleration": Sensor(
            "radial_acceleration",
            sampling_rate_Hz=1e4,
            angle_deg=with_.angle_deg,
            noise=with_.acceleration_noise_g,
            bandwidth_Hz=3000.0,
            range=500.0,
            bits=16,
            delay_s=with_.delay_s,
        ),
        "encoder": Sensor(
            "wheel_encoder",
            sampling_rate_Hz=1e4,
            noise=with_.encoder_noise,
            offset=0.1,
            range=2.0,
            bits=12,
            pitch_error_deg=with_.pitch_error_deg,
        ),
        "vehicle_speed": Sensor("vehicle_speed", sampling_rate_Hz=100.0, noise=0.02),
        "vehicle_acceleration": Sensor(
            "longitudinal_acceleration", sampling_rate_Hz=100.0, noise=0.05
        ),
    }
    if with_.forces:
        channels["vertical_load"] = Sensor("vertical_load", sampling_rate_Hz=100.0, noise=20.0)
        channels["longitudinal_force"] = Sensor(
            "longitudinal_force", sampling_rate_Hz=100.0, noise=20.0
        )
    return channels


def wheel_scenario(
    plan: str = "dynamic",
    *,
    seed: int,
    driven: bool = True,
    pressure_Pa: float = NOMINAL_PRESSURE_PA,
    effects: tuple[Planted, ...] = (),
    with_: Instruments | None = None,
    roughness: float = 0.01,
) -> Scenario:
    """One log.

    The patch is longer at lower pressure (effect `inflation`, exponent 0.3, unless planted
    otherwise).
    """
    if plan not in WHEEL_PLANS:
        raise UsageError(
            f"plan {plan!r}{nearest(plan, WHEEL_PLANS)}; allowed are {', '.join(WHEEL_PLANS)}; "
            "mend it"
        )
    softer = (
        ()
        if any(e.name == "inflation" for e in effects)
        else (Planted("inflation", "exact", {"exponent": 0.3}),)
    )
    return Scenario(
        manoeuvres=tuple(
            Manoeuvre(seconds, speed, regime) for seconds, speed, regime in WHEEL_PLANS[plan]
        ),
        channels=wheel_channels(with_ or Instruments()),
        tire=TrueTire(torsional_stiffness_N_m2=TORSIONAL_STIFFNESS_N_M2),
        conditions=TrueConditions(inflation_pressure_Pa=pressure_Pa, driven=driven),
        road=Road(roughness),
        effects=(*effects, *softer),
        seed=seed,
    )
