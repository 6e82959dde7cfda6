"""What can be planted in a log: the effects of the catalogue and some that no catalogue has.

Each has a main parameter (its first, the strength) and shape parameters. `form = "exact"` follows
the catalogue's form; `form = "other"` is a second, equally honest one (another wedge, pulse,
kernel) of about the same size and 20 to 40 % another shape. What the other form of some effects
does to the strain is nearly the same once the model has been fitted; these, and effects that no
diagnosis tries, have a form "apart": another mechanism that is really another shape
(docs/second_forms.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

FORMS = ("exact", "other", "apart")
_USUAL, _ALL, _APART = ("exact", "other"), FORMS, ("exact", "apart")


@dataclass(frozen=True)
class Plantable:
    """One effect that a scenario can plant.

    Its parameters with their ordinary values, and for those that no diagnosis tries where they show
    (entry, patch, exit, away) and the parity about the patch centre; `fixed` is the name of the
    parameter that is a frequency, or ''; `forms`.
    """

    parameters: Mapping[str, float]
    in_catalogue: bool = True
    where: str = ""
    parity: str = ""
    fixed: str = ""
    forms: tuple[str, ...] = _USUAL


@dataclass(frozen=True)
class Planted:
    """An effect in a scenario: its name, form and all its parameters."""

    name: str
    form: str = "exact"
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __getitem__(self, parameter: str) -> float:
        return self.parameters[parameter]

    @property
    def other(self) -> bool:
        return self.form == "other"

    @property
    def apart(self) -> bool:
        return self.form == "apart"


def _outside(
    where: str,
    parity: str,
    parameters: Mapping[str, float],
    fixed: str = "",
    forms: tuple[str, ...] = ("exact",),
) -> Plantable:
    return Plantable(parameters, False, where, parity, fixed, forms)


PLANTABLE: dict[str, Plantable] = {
    "viscous_damping": Plantable({"damping_rate_1_s": 60.0}),
    "hysteresis": Plantable({"loss_factor": 0.15}),
    "belt_tension": Plantable({"tension_N": 0.0, "tension_mass_kg_m": 1.0, "stretch_s2_m2": 0.0}),
    "stiffening": Plantable({"cubic_1_m2": 1000.0}),
    "pressure_offset": Plantable({"offset": 0.15}),
    "traction": Plantable(
        {
            "slip_per_g": 0.3,
            "lever_m": 0.01,
            "static_friction": 0.8,
            "sliding_friction": 0.6,
            "slip_stiffness_ratio": 1.0,
        }
    ),
    "edge_impact": Plantable({"amplitude": 0.4, "position": 1.0, "width": 0.05}, forms=_ALL),
    "rough_contact": Plantable({"length": 0.1}, forms=_ALL),
    "water_film": Plantable({"amplitude": 0.1, "length": 0.4}),
    "wear": Plantable({"amplitude": 0.3, "lever_loss": 0.0, "position": 0.85, "width": 0.18}),
    "load_transfer": Plantable({"coefficient": 0.3}),
    "aero_load": Plantable({"coefficient": 0.15}),
    "thermal_drift": Plantable({"drift": 5.0e-5, "stiffness": 0.0, "time_constant_s": 30.0}),
    "gauge_length": Plantable({"length_m": 0.01}, forms=_ALL),
    "sensor_lag": Plantable({"lag_s": 2.0e-4}, forms=_ALL),
    "imbalance": Plantable({"force_N": 100.0}, forms=_APART),
    "tread_pitch": Plantable({"strain_m_N": 1.5e-9}, forms=_APART),
    "belt_extension": Plantable(
        {"strain_1_Pa": 2.0e-9, "reference_pressure_Pa": 2.0e5}, forms=_APART
    ),
    "warm_gain": Plantable({"gain_1_K": 1.0e-3}, forms=_APART),
    "sensor_tilt": Plantable({"tilt_rad": 0.05}, forms=_APART),
    "cavity_resonance": Plantable(
        {"amplitude": 6.0e-5, "frequency_Hz": 210.0, "decay_s": 0.03}, forms=_APART
    ),
    "speed_trend": Plantable({"linear_rad": 0.004, "quadratic_rad": 0.008}),
    "load_crosstalk": Plantable({"per_relative_load_rad": 0.02}),
    "telemetry_delay": Plantable({"delay_s": 5.0e-4}, forms=("exact",)),
    "tooth_pitch": Plantable({"error_deg": 0.3}, forms=("exact",)),
    "inflation": Plantable({"exponent": 0.3}),
    "ring_down": _outside(
        "exit",
        "mixed",
        {"amplitude": 6.0e-5, "frequency_Hz": 90.0, "decay_s": 0.015, "speed_exponent": 1.0},
        "frequency_Hz",
    ),
    "splice": _outside(
        "away",
        "mixed",
        {"amplitude": 6.0e-5, "angle_deg": 100.0, "width_deg": 6.0, "speed_exponent": 0.0},
    ),
    "pressure_saddle": _outside(
        "patch", "even", {"a": 0.3, "speed_exponent": 1.0, "load_exponent": 0.0}, forms=_APART
    ),
    "torsion": _outside(
        "patch", "odd", {"amplitude": 6.0e-5, "width_m": 0.12, "speed_exponent": 0.0}
    ),
    "exit_suction": _outside("exit", "mixed", {"a": 0.1, "s": 0.3, "speed_exponent": 1.0}),
    "standing_wave": _outside(
        "exit",
        "mixed",
        {"amplitude": 6.0e-5, "wavelength_m": 0.16, "decay_m": 0.2, "speed_exponent": 3.0},
        forms=_APART,
    ),
    "even_bulge": _outside(
        "away", "even", {"amplitude": 4.0e-5, "width_m": 0.25, "speed_exponent": 2.0}
    ),
}
