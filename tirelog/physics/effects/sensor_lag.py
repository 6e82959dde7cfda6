"""First-order lag of interrogator or telemetry, 1 / (1 + i omega tau) (P2 2)."""

from __future__ import annotations

import numpy as np

from tirelog.physics.effects.base import Drive, Effect, Site, Values
from tirelog.physics.parameters import Parameter
from tirelog.physics.spectral import ComplexArray


def _transfer(v: Values, drive: Drive, site: Site) -> ComplexArray:
    x = (v["lag_s"] * drive.speed_m_s) * site.q
    weight = 1.0 / (1.0 + x * x)
    transfer = np.empty(x.shape, dtype=np.complex128)
    transfer.real = weight
    np.multiply(x, -weight, out=transfer.imag)
    return transfer


EFFECT = Effect(
    id="sensor_lag",
    mechanism="first-order lag or delay of interrogator or telemetry",
    follows=(("speed_m_s", 1),),
    acts_on=("sensor",),
    parameters=(Parameter("lag_s", "s", "tau in 1/(1 + i omega tau)", 0.0, 0.0, 0.05, probe=2e-4),),
    strength=("lag_s",),
    source="P2 2",
    valid="lags shorter than a revolution",
    signature="the waveform comes later and its exit side is drawn out, in proportion to speed",
    transfer=_transfer,
)
