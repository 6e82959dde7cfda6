"""Property: what is read from a channel in memory is what was stored, to the bit, in as few bytes
as its numbers need.
"""

from dataclasses import is_dataclass, replace

import numpy as np
import pytest

from tirelog.data.recording import Channel, Scaled, TimeAxis
from tirelog.runs import in_memory as module
from tirelog.runs.in_memory import in_memory, released

LOST = int(np.iinfo(np.int32).min)
SIZE = 1000


def channel(raw: np.ndarray) -> Channel:
    lost = LOST if raw.dtype.kind == "i" else None
    return Channel(
        "c",
        "strain",
        "",
        TimeAxis.uniform(raw.size, 100.0),
        Scaled(lambda a, b: raw[a:b], 1.27e-7, -0.5, lost),
    )


def walk(step: int, seed: int) -> np.ndarray:
    return (
        15_500_000 + np.cumsum(np.random.default_rng(seed).integers(-step, step + 1, SIZE))
    ).astype(np.int32)


def cases() -> dict[str, np.ndarray]:
    some_lost, ends = walk(30, 1), np.full(SIZE, -7, np.int32)
    some_lost[[0, 5, 6, 7, 99, 640, SIZE - 1]] = LOST
    ends[::2] = 65_534 - 7 - 1
    too_far = ends.copy()
    too_far[4] += 1
    return {
        "near": walk(30, 2), "some_lost": some_lost, "all_lost": np.full(SIZE, LOST, np.int32),
        "far": walk(3_000_000, 3), "as far as fits": ends, "one too far": too_far,
        "floats": walk(30, 4) / 3.0,
    }  # fmt: skip


@pytest.mark.parametrize("name", cases())
@pytest.mark.parametrize("piece", [64, 1000, 4096])
def test_slices_are_those_of_the_stored_channel(name, piece, monkeypatch):
    monkeypatch.setattr(module, "PIECE", piece)
    stored = channel(cases()[name])
    kept = in_memory(stored)
    random = np.random.default_rng(5)
    for start, length in [
        (0, SIZE),
        (0, 0),
        (SIZE, 0),
        (63, 2),
        (64, 64),
        *random.integers(0, SIZE, (20, 2)).tolist(),
    ]:
        got, wanted = kept.read(start, start + length), stored.read(start, start + length)
        np.testing.assert_array_equal(got, wanted)
        assert got.dtype == wanted.dtype
    assert released(kept).samples is stored.samples
    assert in_memory(kept) is kept


def test_what_is_quick_to_read_takes_no_memory_if_it_is_long(monkeypatch):
    stored = channel(walk(30, 2))
    quick = replace(stored, samples=replace(stored.samples, at_hand=True))
    kept = in_memory(quick)
    np.testing.assert_array_equal(kept.read(3, 700), stored.read(3, 700))
    assert kept.samples.values.size == SIZE
    assert released(kept).samples is quick.samples
    monkeypatch.setattr(module, "HELD_FLOATS", SIZE - 1)
    assert in_memory(quick) is quick


def test_two_bytes_a_sample_where_they_fit(monkeypatch):
    monkeypatch.setattr(module, "PIECE", 100)

    def kept(name: str) -> int:
        """Bytes of the arrays that the pieces hold."""
        total, waiting = 0, [*in_memory(channel(cases()[name])).samples.pieces]
        while waiting:
            piece = waiting.pop()
            if isinstance(piece, Scaled):
                piece = piece.raw
            kept = (
                vars(piece).values()
                if is_dataclass(piece)
                else [cell.cell_contents for cell in piece.__closure__]
            )
            total += sum(array.nbytes for array in kept if isinstance(array, np.ndarray))
        return total

    assert [kept(name) for name in ("some_lost", "far", "floats")] == [2 * SIZE, 4 * SIZE, 8 * SIZE]
