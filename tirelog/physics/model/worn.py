"""The model of a worn tire from that of a new one, by the physics of its tread (P3 Figs. 5, 6).

P3 gives no equation (errata). A block of rubber of depth d on the belt is stiff as 1 / d, across
and along the road; and a section whose outer part is gone has its neutral axis nearer to the liner.
"""

from __future__ import annotations

from tirelog.errors import UsageError
from tirelog.physics.model.model import Model

#: parameters that are in proportion to 1 / depth: the tread across the road, and along it
STIFF = ("tread_stiffness_N_m2", "bristle_stiffness_N_m2", "traction.slip_stiffness_ratio")
#: metres that the neutral axis moves per metre of tread worn off: half, of a section that is of one
#: material; a stiff belt holds it (0), and the lever arm of a grating on the liner keeps its length
NEUTRAL_AXIS_SHARE = 0.5
#: depths of a tread [m]: beyond them a number is in millimetres; twice as much lets 60 and 80 mm
#: of a tread pass, which no tire has
DEEPEST_M = 0.05


def worn_model(
    model: Model,
    new_depth_m: float,
    depth_m: float,
    neutral_axis_share: float = NEUTRAL_AXIS_SHARE,
) -> tuple[Model, dict[str, tuple[float, float]]]:
    """(The model with the tread worn to a depth, what changed: name -> (new, worn)).

    UsageError: depths that are none.  ModelError: a number leaves its bounds.
    """
    if not 0.0 < depth_m <= new_depth_m <= DEEPEST_M:
        raise UsageError(
            f"a tread worn from {new_depth_m:g} to {depth_m:g} m",
            allowed=f"allowed are depths above 0, the new one up to {DEEPEST_M:g} m and no less "
            "than the worn one",
            do="give both in metres",
        )
    if not 0.0 <= neutral_axis_share <= 1.0:
        raise UsageError(
            f"a neutral axis that moves by {neutral_axis_share:g} of what is worn off",
            allowed="0 to 1 is allowed",
            do="correct it",
        )
    values = model.values
    changed = {name: values[name] * new_depth_m / depth_m for name in STIFF if name in values} | {
        "lever_arm_m": max(
            values["lever_arm_m"] - neutral_axis_share * (new_depth_m - depth_m), 0.0
        )
    }
    worn = model.with_values(changed)
    return worn, {name: (values[name], value) for name, value in changed.items()}
