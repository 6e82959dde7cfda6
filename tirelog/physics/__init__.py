"""Forward models of what a sensor in a rolling tire reads.

A carcass on a contact pressure, and a list of effects.

What flows through it (n revolutions, K Fourier modes of the tread's circumference C = 2 pi R, m
angles):

    Conditions (n,)  speed, acceleration, time, temperature, load, ... (`tirelog.data.recording`)
      -> load        F (n, 1), half length L (n, 1) = L_ref (F / F_ref)^exponent
                     effects: load_transfer, aero_load
      -> pressure    P (n, K) [N/m], Fourier coefficients of p(xi); their sum carries F exactly
                     effects on contact_pressure
      -> structure   H (n, K), response of the carcass per unit of load
                     effects on structure
      -> sensor      S (n, K), transfer of grating and interrogator, and a gain
                     effects on sensor
      X = P H S -> values (n, m) at the angles asked + baseline (n, 1)
                     effects on baseline (an accelerometer's holds gravity and the vehicle's
                     acceleration too)

A column that is the same for all revolutions keeps one row, so what does not change is computed
once. The tread closes upon itself: every waveform is periodic over one revolution, and coefficient
n has the wave number q = n / R.

Composition. Effects are applied in the order of their ids, not in the order of the file. So two
files with the same effects agree to the last bit. Within each stage they commute: loads multiply,
structure terms add, sensor transfers multiply. On the contact pressure

    p = F K * [ p0 (1 - sum a_i xi/L) + sum_i A_i ] / integral

with p0 the parabola or the contact with the road, A_i the pressures that effects add, and K * the
convolutions. A_i depend on F, L and the conditions, not on p. There is one rescaling at the end.
With one effect this is the rescaling after that effect; with several it is the only reading in
which their order means nothing. An effect whose strength is zero is skipped: off is the base model
to the last bit.

Modules: `parameters` a number with unit and bounds; `spectral` Fourier tools and the evaluation at
angles; `pressure`, `brush` the load on the carcass; `carcass` its response (`structures`) and its
contact with the road (`contact`); `effects` the catalogue; `model` the model as an object, its TOML
(`file`), its stages, a user's own expressions; `moving` a tire that moves in time: `ring` its
equations, `contact` the road and the steps, `transient` the reading of a sensor.

Orientation: xi [m] and phi = xi / R [rad] grow in the direction in which tread material passes the
patch. The entry edge is at -L, the exit edge at +L. Displacement w is positive inward, slip is
positive in braking, y is positive toward the axle.

What a docstring calls the errata, in this package and all others, is docs/errata.md: what the
papers print, what is right, and how that was checked.
"""

from __future__ import annotations

from tirelog.physics.effects import BY_ID, CATALOGUE, Effect
from tirelog.physics.model.model import Model, ModelEffect
from tirelog.physics.spectral import Parameter

__all__ = ["BY_ID", "CATALOGUE", "Effect", "Model", "ModelEffect", "Parameter"]
