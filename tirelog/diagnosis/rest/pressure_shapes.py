"""Free shapes of the contact pressure as columns of the observable.

What a cause in the patch looks like through the carcass.

    bells on the patch, one after the other -> the model's own response to each -> columns (C, m, k)

A carcass answers a pressure the more the faster it rolls (the beam near its critical speed doubles
it), so an exponent of speed that is read off the strain is not that of a cause in the patch. If
these few columns explain as much as free shapes of the strain do, they tell the exponent.
"""

from __future__ import annotations

import numpy as np

from tirelog.diagnosis.candidates.signatures import with_candidate
from tirelog.errors import ModelError
from tirelog.inference.base import Base, change_to
from tirelog.physics.effects import Drive, Effect, Site
from tirelog.physics.effects.base import Values
from tirelog.physics.parameters import Parameter
from tirelog.physics.pressure import bell
from tirelog.physics.spectral import ComplexArray
from tirelog.vocabulary.arrays import FloatArray

#: centres over L, width over L, height over the mean pressure
_CENTRES = np.linspace(-1.8, 1.8, 19)
#: half of it leaves gaps between the centres, twice as much tells neighbours apart half as well
_WIDTH = 0.15
#: twice as much doubles the share of the response that is not linear in it
_HEIGHT = 0.02


def _probe(centre: float) -> Effect:
    """A bell of pressure at `centre` (over L)."""

    def pressure(v: Values, drive: Drive, site: Site) -> ComplexArray:
        height = v["height"] * site.mean_pressure
        return bell(height, centre * site.half_length_m, _WIDTH * site.half_length_m, site.radius_m)

    return Effect(
        id="probe",
        mechanism="a bell of pressure",
        follows=(),
        acts_on=("contact_pressure",),
        parameters=(
            Parameter(
                "height", "1", "height over the mean pressure", 0.0, -1.0, 1.0, probe=_HEIGHT
            ),
        ),
        strength=("height",),
        source="",
        valid="",
        signature="",
        pressure=pressure,
    )


def pressure_columns(base: Base) -> FloatArray | None:
    """Changes of the prediction by a bell of pressure at each place of the patch, (C, m, 19).

    None if the model cannot be computed with one of them.
    """
    changes = []
    for centre in _CENTRES:
        pressed = with_candidate(base.model, _probe(float(centre)), {"height": _HEIGHT})
        change = change_to(base, pressed)
        if isinstance(change, ModelError):
            return None
        changes.append(change / _HEIGHT)
    return np.stack(changes, axis=-1)
