"""Property: every name, unit and size gives a likely kind whose unit a setup takes."""

import numpy as np
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st

from tirelog.drafts.setup import _ALONG, _WORDS, contents, guessed
from tirelog.vocabulary.kinds import KINDS
from tirelog.vocabulary.units import UNITS

NAMES = sorted({word for words, _ in _WORDS for word in words} | _ALONG | {"voltage", "W-N-01", ""})


@given(
    st.lists(st.sampled_from(NAMES), max_size=3).map("_".join),
    st.sampled_from(["", "furlong", *UNITS]),
    st.sampled_from([0.0, 1e-9, 1e-4, 0.3, 2.0, 40.0, 900.0, 1550.0, 2.2e5, 1e30]),
    st.sampled_from([0.0, 1e-6, 0.1, 3.0]),
)
@settings(max_examples=120, deadline=None)
def test_a_guess_is_a_kind_with_a_unit_of_it(name, unit, size, moves):
    samples = size * (1.0 + moves * np.sin(np.arange(50.0)))
    guess = guessed(name, unit, samples)
    KINDS[guess.kind].to_si(guess.unit)
    assert guess.reason
    lost = guessed(name, unit, np.full(5, np.nan))
    assert lost.kind == "signal"


def test_the_name_of_a_matrix_that_holds_the_time_is_not_that_of_its_rows(tmp_path):
    t = np.arange(2000) / 2000.0
    rows = np.vstack([t, np.sin(40.0 * t), np.cos(40.0 * t)])
    scipy.io.savemat(tmp_path / "log.mat", {"accel": rows})
    found = contents(str(tmp_path / "log.mat"))
    assert found.time == "/accel[0]"
    assert {one.guess.kind for one in found.found} == {"signal"}
    scipy.io.savemat(tmp_path / "log.mat", {"accel": rows[1:]})
    kinds = {one.guess.kind for one in contents(str(tmp_path / "log.mat")).found}
    assert kinds == {"radial_acceleration"}
