"""Property: what is read from a channel in memory is what was stored, to the bit."""

import numpy as np
import pytest

from tirelog.data.recording import BLOCK_SAMPLES, Channel, Scaled, TimeAxis
from tirelog.runs import in_memory as module
from tirelog.runs.in_memory import in_memory, released, with_holes

LOST = int(np.iinfo(np.int32).min)
SIZE = BLOCK_SAMPLES + 1000


def channel(raw: np.ndarray, at_hand: bool = False) -> Channel:
    lost = LOST if raw.dtype.kind == "i" else None
    samples = Scaled(lambda a, b: raw[a:b], 1.27e-7, -0.5, lost)
    axis = TimeAxis.uniform(raw.size, 100.0)
    return Channel("c", "strain", "", axis, samples, at_hand=at_hand)


def cases() -> dict[str, np.ndarray]:
    steps = np.random.default_rng(2).integers(-30, 31, SIZE)
    counts = (15_500_000 + np.cumsum(steps)).astype(np.int32)
    some_lost = counts.copy()
    some_lost[[0, 5, 6, 7, 99, 640, SIZE - 1]] = LOST
    return {
        "counts": counts,
        "some_lost": some_lost,
        "all_lost": np.full(SIZE, LOST, np.int32),
        "floats": counts / 3.0,
    }


@pytest.mark.parametrize("at_hand", [False, True])
@pytest.mark.parametrize("name", cases())
def test_slices_are_those_of_the_stored_channel(name, at_hand):
    stored = channel(cases()[name], at_hand)
    holed = with_holes(stored, *np.array([[63, 700], [64, 720]]))
    random = np.random.default_rng(5)
    places = [(0, SIZE), (0, 0), (SIZE, 0), (63, 2), (64, 64)]
    places += random.integers(0, SIZE, (20, 2)).tolist()
    for known in (stored, holed):
        kept = in_memory(known)
        for start, length in places:
            got, wanted = kept.read(start, start + length), known.read(start, start + length)
            np.testing.assert_array_equal(got, wanted)
            assert got.dtype == wanted.dtype
        assert released(kept).samples is known.samples
        assert in_memory(kept) is kept


@pytest.mark.parametrize(("at_hand", "limit"), [(False, "HELD_SAMPLES"), (True, "HELD_FLOATS")])
def test_what_is_long_takes_no_memory(monkeypatch, at_hand, limit):
    stored = channel(cases()["counts"], at_hand)
    monkeypatch.setattr(module, limit, SIZE - 1)
    assert in_memory(stored) is stored
