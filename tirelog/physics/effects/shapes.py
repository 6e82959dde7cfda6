"""Places behind an edge of the patch, for what rings or stands there."""

from __future__ import annotations

import numpy as np

from tirelog.physics.effects.base import Site
from tirelog.vocabulary.arrays import FloatArray

#: absolute temperature at which a rise of temperature counts as none [K]
ROOM_K = 293.0


def behind(site: Site, phi_rad: FloatArray, edge_m: FloatArray) -> FloatArray:
    """Distance behind an edge along the tread [m], from 0 to a whole turn."""
    return np.mod(phi_rad * site.radius_m - edge_m, 2.0 * np.pi * site.radius_m)


def faded(site: Site, behind_m: FloatArray) -> FloatArray:
    """One behind an edge, smoothly zero over the last third of the turn, where it comes again."""
    share = behind_m / (2.0 * np.pi * site.radius_m)
    return 0.5 + 0.5 * np.cos(np.pi * np.clip((share - 0.6) / 0.3, 0.0, 1.0))
