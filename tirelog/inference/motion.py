"""Parameters that only a motion tells.

Masses, damping and bristles of a coupled ring that meets an obstacle.
"""

from __future__ import annotations

from tirelog.physics.carcass.numbers import MOTION
from tirelog.physics.model.model import Model


def motion_names(model: Model) -> tuple[str, ...]:
    """The free parameters that only a motion tells."""
    return tuple(name for name in model.free if name in MOTION and model.carcass == "coupled_ring")


def without_motion_parameters(model: Model) -> Model:
    """The model as the steady waveform is fitted: without what only a motion tells."""
    return model.with_parameters(
        {name: model.parameters[name].fixed() for name in motion_names(model)}
    )
