"""Rate-independent loss of the foundation, k (1 + i eta sign(kappa)) (P1 1, 3.2)."""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Structure, Values
from tirelog.physics.parameters import Parameter


def _structure(v: Values, drive: Drive) -> Structure:
    return Structure(loss=v["loss_factor"])


EFFECT = Effect(
    id="hysteresis",
    mechanism="rate-independent loss, k (1 + i eta sign(kappa))",
    follows=(),
    acts_on=("structure",),
    parameters=(
        Parameter(
            "loss_factor", "1", "eta, loss factor of the foundation", 0.0, 0.0, 1.0, probe=0.1
        ),
    ),
    strength=("loss_factor",),
    source="P1 1, 3.2",
    valid="loss factors of rubber, up to about 0.5; on a ring the radial foundation loses",
    valid_range={"loss_factor": (0.0, 0.5)},
    signature="odd about the patch centre like viscous damping, but the same at every speed",
    structure=_structure,
)
