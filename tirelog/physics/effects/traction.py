"""Brush friction under drive and brake torque, with its slip onset (P2 (13)-(18), errata)."""

from __future__ import annotations

import numpy as np

from tirelog.physics.brush import SLIDING_FRICTION, STATIC_FRICTION, Grip, traction_modes
from tirelog.physics.effects.base import CATALOGUE_G_M_S2, Drive, Effect, Site, Values
from tirelog.physics.parameters import Parameter
from tirelog.physics.spectral import ComplexArray
from tirelog.vocabulary.arrays import FloatArray


def slip(v: Values, drive: Drive) -> FloatArray:
    """The measured slip if the log has one, else -a acceleration/9.81; positive in braking."""
    return np.where(
        np.isfinite(drive.slip),
        drive.slip,
        -v["slip_per_g"] * drive.acceleration_m_s2 / CATALOGUE_G_M_S2,
    )


def _held(name: str, description: str, value: float, low: float, high: float) -> Parameter:
    """A number of the grip, held unless a model file frees it."""
    return Parameter(name, "1", description, value, low, high, probe=value, free=False)


def _traction(v: Values, drive: Drive, site: Site) -> tuple[ComplexArray, float] | None:
    sigma = slip(v, drive)
    if not np.any(sigma):
        return None
    grip = Grip(v["static_friction"], v["sliding_friction"], v["slip_stiffness_ratio"])
    modes = traction_modes(site.load_N, site.half_length_m, sigma, site.radius_m, grip)
    return modes, v["lever_m"]


EFFECT = Effect(
    id="traction",
    mechanism="brush friction under drive and brake torque, with its slip onset",
    follows=(("acceleration_m_s2", 1),),
    acts_on=("contact_pressure",),
    parameters=(
        Parameter(
            "lever_m",
            "m",
            "h in h d tau/d xi, of either sign (P2: the section height)",
            0.005,
            -0.05,
            0.05,
            probe=0.01,
        ),
        Parameter(
            "slip_per_g",
            "1",
            "a in slip = -a acceleration/9.81, if no slip is measured",
            0.1,
            0.0,
            1.0,
            probe=0.1,
        ),
        _held("static_friction", "f_s, of a tread that adheres", STATIC_FRICTION, 0.05, 3.0),
        _held("sliding_friction", "f_d, of a tread that slides", SLIDING_FRICTION, 0.05, 3.0),
        _held(
            "slip_stiffness_ratio",
            "C_x over 2 gamma L f_s, with which all slides at slip 1 only (P2 (17))",
            1.0,
            0.1,
            100.0,
        ),
    ),
    strength=("lever_m",),
    also_at_zero=(
        "ring",
    ),  # the belt is pulled along by the shear itself; the lever only adds its couple
    source="P2 (13)-(18), C_x by (17); errata: the jump at x_s, either sign of the lever",
    valid="slip up to 1; friction 0.8 sticking, 0.6 sliding unless the model says otherwise; on a "
    "ring the shear also pulls the belt along",
    valid_range={"slip": (-1.0, 1.0)},
    signature="odd, changes sign with the acceleration, a kink where adhesion ends",
    needs=("acceleration_m_s2",),
    instead={"acceleration_m_s2": "slip"},
    traction=_traction,
)
