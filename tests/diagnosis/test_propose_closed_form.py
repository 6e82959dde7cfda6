"""Closed form: what forms are worth beside a base, how laws are written, what hats interpolate."""

from dataclasses import replace

import numpy as np
import pytest

from tests.diagnosis.planted import MODEL, stack
from tirelog.diagnosis.candidates.assessment import hats_on
from tirelog.diagnosis.compare import start
from tirelog.diagnosis.propose.formulas import polished, scan, strengths
from tirelog.diagnosis.propose.grammar import LAWS
from tirelog.diagnosis.propose.ground import Ground


def bump(xi, speed):
    """3e-5 (v/20)^2 at 2 rad of the wheel, 0.3 rad wide."""
    off = np.angle(np.exp(1j * (xi / 0.3 - 2.0)))
    return 3e-5 * (speed / 20.0) ** 2 * np.exp(-0.5 * (off / 0.3) ** 2)


def test_polishing_finds_the_law_and_the_size_of_a_planted_bump():
    """What is proposed of a ringing, fitted and by command: `test_propose_property.py`."""
    ground = Ground(start([stack(bump, m=64)], MODEL))
    atoms, _, _ = scan(ground)
    best = polished(ground, atoms)[0]
    assert best.law.text == "(speed / 20) ** n"
    assert best.law.numbers["n"] == pytest.approx(2.0, abs=0.15)
    size, explained = strengths(ground, best)
    assert size[0] == pytest.approx(3e-5, rel=0.05)
    assert explained > 0.9 * (ground.square - np.count_nonzero(ground.base.white.inverse_sd))
    before = next(atom for atom in atoms if atom.form_key == best.form_key)
    assert best.explained > strengths(ground, before)[1]


@pytest.mark.parametrize(
    ("law", "numbers", "free", "written"),
    [
        (0, {"n": 0.0}, (), ""),
        (0, {"n": 1.0}, (), "(speed / 20)"),
        (0, {"n": 1.5}, (), "(speed / 20) ** 1.5"),
        (0, {"n": 1.0}, ("n",), "(speed / 20) ** n"),
        (1, {"n": 0.0}, (), "(acceleration / 9.81)"),
        (3, {"m": 1.0, "n": 0.0}, (), "(load / 3500)"),
        (3, {"m": 0.0, "n": 2.0}, (), "(speed / 20) ** 2"),
        (4, {"tau": 25.0, "n": 0.0}, (), "(1 - exp(-time / 25))"),
        (4, {"tau": 25.0, "n": 0.0}, ("tau",), "(1 - exp(-time / tau))"),
    ],
)
def test_a_law_is_written_without_what_is_one(law, numbers, free, written):
    text = LAWS[law].text.format(load="3500")
    assert replace(LAWS[law], text=text, numbers=numbers).written(free) == written


def test_hats_interpolate_straight_lines_and_close_on_themselves():
    nodes, values = np.array([0.0, 0.1, 0.4, 1.0]), np.array([1.0, -2.0, 0.5, 3.0])
    x = np.linspace(-0.5, 1.5, 77)
    np.testing.assert_allclose(
        hats_on(x, nodes) @ values, np.interp(x, nodes, values, left=0.0, right=0.0), atol=1e-14
    )
    round_nodes = np.append(nodes, 1.5)
    found = hats_on(x, round_nodes, 1.5) @ np.append(values, values[0])
    np.testing.assert_allclose(found, np.interp(x, nodes, values, period=1.5), atol=1e-12)
