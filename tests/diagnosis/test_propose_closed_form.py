"""Closed form: how laws are written, and what hats interpolate."""

from dataclasses import replace

import numpy as np
import pytest

from tirelog.diagnosis.candidates.assessment import hats_on
from tirelog.diagnosis.propose.grammar import LAWS


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
