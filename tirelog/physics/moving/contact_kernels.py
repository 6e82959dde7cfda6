"""Compiled loops of the coupled ring's contact.

Where the tread's nodes are, and what the road does to them.

Nodes of a stretch, (j,), stand in order of their angle; tables of cos(n theta), sin(n theta), (N -
1, 2 M), go twice around the belt, so that any stretch is one slice from `start`. Sums keep their
order whatever the machine.
"""

from __future__ import annotations

import numpy as np

from tirelog.runtime import compiled
from tirelog.vocabulary.arrays import FloatArray


@compiled
def places(
    cosines: FloatArray, sines: FloatArray, start: int, n: FloatArray, real: FloatArray,
    imag: FloatArray, radius: float, centre_s: float, centre_z: float, sin: FloatArray,
    cos: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:  # fmt: skip
    """s, z and w' - v of nodes at angles with these `sin`, `cos` (j,), from the modes 2 V e^(i n
    psi) as `real`, `imag` (N - 1,).
    """
    size = sin.size
    v, w, bend = np.zeros(size), np.zeros(size), np.zeros(size)
    for k in range(n.size):
        a, b, m = real[k], imag[k], n[k]
        turned = m * m - 1.0
        for i in range(size):
            c, d = cosines[k, start + i], sines[k, start + i]
            along = a * c - b * d
            v[i] += along
            w[i] += m * (a * d + b * c)
            bend[i] += turned * along
    return centre_s + (radius + w) * sin + v * cos, centre_z - (radius + w) * cos + v * sin, bend


@compiled
def press(
    s: FloatArray, z: FloatArray, height: FloatArray, slope: FloatArray, was: FloatArray,
    bristles: FloatArray, start: int, nodes: int, k_t: float, c_x: float, mu: float, now: float,
) -> tuple[FloatArray, FloatArray, float, float, float]:  # fmt: skip
    """Forces (f_s, f_z) [N/m] on nodes (j,), the energies of springs and bristles and what sliding
    took, in J per length of pitch.

    was (4, M): s, z, depth and the call `now` at which the node was seen last; bristles (M,) [m]. A
    node that came down since the last call has slid for a part of the way; one that was not looked
    at then has not.
    """
    size = s.size
    f_s, f_z = np.zeros(size), np.zeros(size)
    sprung = clung = lost = 0.0
    for i in range(size):
        j = (start + i) % nodes
        gap, steep = height[i] - z[i], slope[i]
        before, seen = bristles[j], was[3, j] == now - 1.0
        bristles[j] = 0.0
        if gap > 0.0:
            sprung += 0.5 * k_t * gap * gap
            f_s[i], f_z[i] = k_t * gap * steep, k_t * gap
        if mu > 0.0 and c_x > 0.0:
            long = np.sqrt(1.0 + steep * steep)
            limit = mu * k_t * max(gap, 0.0) * long / c_x
            slid = 0.0
            if seen:
                share = (
                    1.0
                    if was[2, j] >= 0.0
                    else min(max(gap / max(gap - was[2, j], 1e-12), 0.0), 1.0)
                )
                slid = share * ((s[i] - was[0, j]) - steep * (z[i] - was[1, j])) / long
            else:
                before = 0.0
            free = before + slid
            held = min(max(free, -limit), limit)
            lost += 0.5 * c_x * (before + held) * (free - held)
            clung += 0.5 * c_x * held * held
            bristles[j] = held
            f_s[i] -= c_x * held / long
            f_z[i] += c_x * held * steep / long
        was[0, j], was[1, j], was[2, j], was[3, j] = s[i], z[i], gap, now
    return f_s, f_z, sprung, clung, lost


@compiled
def modes_of(
    cosines: FloatArray,
    sines: FloatArray,
    start: int,
    f_t: FloatArray,
    f_r: FloatArray,
    n: FloatArray,
    nodes: int,
) -> tuple[FloatArray, FloatArray]:
    """Real and imaginary part of Q_v + i n Q_w (N - 1,) of forces [N/m] on nodes (j,), in the
    belt's own angle.
    """
    real, imag = np.zeros(n.size), np.zeros(n.size)
    for k in range(n.size):
        t_c = t_s = r_c = r_s = 0.0
        for i in range(f_t.size):
            if f_t[i] != 0.0 or f_r[i] != 0.0:
                c, d = cosines[k, start + i], sines[k, start + i]
                t_c += f_t[i] * c
                t_s -= f_t[i] * d
                r_c += f_r[i] * c
                r_s -= f_r[i] * d
        real[k] = (t_c - n[k] * r_s) / nodes
        imag[k] = (t_s + n[k] * r_c) / nodes
    return real, imag
