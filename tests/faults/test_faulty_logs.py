"""Faults: one fault in a clean log leaves no number that is wrong and `ok`.

Those of `make faults` that take least time and stand for one mechanism each.
"""

from __future__ import annotations

import pytest

from benchmarks.faults import FAULTS, TABLES, counted

FOUND = {
    "strain": (
        "none",
        "strain_1: spikes of 3 samples 0.3-2 x40",
        "strain_1: bursts 20 ms x15",
        "strain_1: hops 20-200 ms 0.3 x15",
        "strain_1: hum 50 Hz 0.03",
        "strain_1: steps 0.05",
        "temp_1: spikes 0.3-1 x60",
    ),
    "wheel": ("none", "encoder: held 1-4 ms x40"),
}


@pytest.mark.parametrize("kind", FAULTS)
def test_no_wrong_number_is_ok(kind: str) -> None:
    found = counted(kind, "tuning", 1, list(FOUND[kind]), seed=9, processes=1)
    assert {name for name, _ in found} == set(FOUND[kind])
    for (name, table), count in found.items():
        assert count.wrong == 0, (name, table, count)
        if name == "none":
            assert count.ok >= 0.98 * count.passages, (table, count)
            assert not count.refused
    most = {
        table: sum(c.ok for (_, own), c in found.items() if own == table) for table in TABLES[kind]
    }
    assert all(most.values())
