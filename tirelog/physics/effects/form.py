"""The tire's own form: what its contact pressure and stiffness are beside the model's formulas.

It follows the load and nothing else. The pressure gets F / (2 L) times a sum of shapes on the
patch, none of which carries load. Differences of Legendre polynomials P_(n-1) - P_(n+1) vanish at
the edges; P_0 - P_2 is the parabola. P_1 and P_2 end there in a step. Each shape has a size at the
reference load and one that grows with the relative load beyond it. The static stiffness of the
carcass gets a factor by the number of waves in a turn, its logarithm a sum of bells. Each number
has a prior of mean zero: a form is learnt only as far as a log shows it.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from scipy.special import eval_legendre

from tirelog.data.setup import (
    FORM_BELLS,
    FORM_DEGREES,
    FORM_PRESSURE,
    FORM_STIFFNESS,
    FORM_WAVES,
    share_of_degree,
)
from tirelog.physics.effects.base import Drive, Site, Structure, effect, number
from tirelog.physics.spectral import MODES, ComplexArray, Parameter
from tirelog.vocabulary.arrays import FloatArray

#: degrees n of the shapes P_(n-1) - P_(n+1) beside the parabola
SMOOTH = tuple(range(2, FORM_DEGREES))
#: degrees of the shapes that end in a step at the edges
STEPS = (1, 2)
PRESSURE = (*(f"pressure_{n}" for n in SMOOTH), *(f"edge_{n}" for n in STEPS))
BY_LOAD = tuple(f"{name}_by_load" for name in PRESSURE)
STIFFNESS = tuple(f"stiffness_{i}" for i in range(1, FORM_BELLS + 1))


def _shares() -> FloatArray:
    """The coefficient (shapes, degrees) of each Legendre polynomial from P_1 on in each shape."""
    shares = np.zeros((len(PRESSURE), FORM_DEGREES))
    for row, n in enumerate(SMOOTH):
        shares[row, n - 2], shares[row, n] = 1.0, -1.0
    for row, n in enumerate(STEPS, len(SMOOTH)):
        shares[row, n - 1] = 1.0
    return shares


def _by_waves(waves: FloatArray) -> FloatArray:
    """The bells of the logarithm of the stiffness at numbers of waves in a turn, (n, 9)."""
    centres = np.linspace(np.log(FORM_WAVES[0]), np.log(FORM_WAVES[1]), FORM_BELLS)
    x = np.clip(np.log(np.maximum(waves, 1.0)), centres[0], centres[-1])
    return np.asarray(np.exp(-0.5 * ((x[:, None] - centres) / np.diff(centres)[0]) ** 2))


#: what turns a spherical Bessel function into the modes of P_1, P_2, ...: odd ones are imaginary
_TURNS = (-1j) ** np.arange(1, FORM_DEGREES + 1)
_SHARES, _BELLS = _shares(), _by_waves(np.arange(MODES, dtype=np.float64))


def pressure_shapes(u: FloatArray) -> FloatArray:
    """The shapes at xi / L (n,), in mean pressures F / (2 L), (n, shapes); zero off the patch."""
    degrees = np.arange(1, _SHARES.shape[1] + 1)
    inside = np.abs(u) <= 1.0
    shapes = eval_legendre(degrees, np.clip(u, -1.0, 1.0)[:, None]) @ _SHARES.T
    return np.where(inside[:, None], shapes, 0.0)


def _structure(drive: Drive, **numbers: float) -> Structure:
    """The factor on the stiffness by wavelength."""
    return Structure(by_waves=_BELLS @ np.array([numbers[name] for name in STIFFNESS]))


#: the road does not pull: standard deviation of a pressure below zero, in mean pressures, and at
#: how many places of the patch; with five times as much flat pressures end up 0.4 % longer
_PULL, _PLACES = 0.02, 24


@cache
def _no_pull() -> tuple[FloatArray, FloatArray]:
    """Pressure at places of the patch per number (q, p), and that of the parabola, in _PULL."""
    u = np.cos(np.pi * (np.arange(_PLACES) + 0.5) / _PLACES)
    rows = np.zeros((_PLACES, len(PRESSURE) + len(BY_LOAD) + len(STIFFNESS)))
    rows[:, : len(PRESSURE)] = pressure_shapes(u)
    return rows / _PULL, 1.5 * (1.0 - u**2) / _PULL


def _learnt(words: str, limit: float, size: float) -> Parameter:
    """A number of a form, with a prior of mean zero and this standard deviation."""
    return number(0.0, -limit, limit, "1", words, probe=0.1, prior=(0.0, size))


def _numbers() -> dict[str, Any]:
    """A number with a prior for each shape of pressure and each bell of stiffness."""
    share = [share_of_degree(n) for n in (*SMOOTH, *STEPS)]
    pressure = {
        name: _learnt(f"pressure of the shape {name} over the mean", 3.0, FORM_PRESSURE * size)
        for name, size in zip(PRESSURE, share, strict=True)
    }
    by_load = {
        name: _learnt(f"change of {shape} per relative change of the load", 10.0, size)
        for name, shape, size in zip(BY_LOAD, PRESSURE, share, strict=True)
    }
    words = "logarithm of the stiffness over the model's"
    stiffness = {name: _learnt(words, 2.0, FORM_STIFFNESS) for name in STIFFNESS}
    return pressure | by_load | stiffness


@effect("pressure", structure=_structure, constraints=_no_pull, tried=False, **_numbers())
def form(drive: Drive, site: Site, **numbers: float) -> ComplexArray:
    """The tire's own contact pressure over the patch, and stiffness over wavelength.

    Signature: anything within the patch and beside it that follows the load alone
    Valid: what is the same at all speeds and accelerations
    Source: Legendre series of a pressure on a strip; a factor by wavelength
    """
    sizes, by_load = (np.array([numbers[n] for n in names]) for names in (PRESSURE, BY_LOAD))
    more = site.load_N / site.reference_load_N - 1.0
    shares = (sizes + more * by_load) @ _SHARES * _TURNS
    odd, even = (
        np.einsum("ck,kcm->cm", part, site.legendre[first::2])
        for first, part in enumerate((shares[:, ::2].imag, shares[:, 1::2].real))
    )
    waves: ComplexArray = even + 1j * odd
    return site.load_N / (2.0 * np.pi * site.radius_m) * waves
