"""Property: what a seed draws is the same in every world, and rates count what they say."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks import nuisances
from benchmarks.nuisance_worlds import WORLDS, CaseOf
from benchmarks.nuisances import Row
from tirelog.errors import UsageError

SEEDS = (0, 7, 999, 20000, 20013)
ROW = Row(
    "control", 1, "beam", "", "", 0.0, 0.0, "nothing_missing", "", "[]", 0.0, 1.0, 1.0, 1.0, 1.0,
    0.0, 0.0, 20, 3.0, "",
)  # fmt: skip


@pytest.mark.parametrize("carcass", ["beam", "ring"])
@pytest.mark.parametrize("world", WORLDS)
def test_worlds_differ_by_their_nuisance_alone(world: str, carcass: str) -> None:
    for seed in SEEDS:
        case, control = CaseOf(world, seed, carcass), CaseOf("control", seed, carcass)
        for log, bare in zip(case.scenarios(), control.scenarios(), strict=True):
            assert (log.seed, log.manoeuvres) == (bare.seed, bare.manoeuvres)
            free = replace(
                log,
                nuisances=bare.nuisances,
                channels=bare.channels,
                road=replace(log.road, load_scatter=bare.road.load_scatter),
                tire=replace(
                    log.tire,
                    patch_load_exponent=bare.tire.patch_load_exponent,
                    contact=bare.tire.contact,
                ),
                conditions=replace(
                    log.conditions,
                    warm_up_K=bare.conditions.warm_up_K,
                    warm_up_time_s=bare.conditions.warm_up_time_s,
                ),
            )
            assert free == bare
            assert (log == bare) == (world == "control")


def test_unknown_world_is_refused_with_the_nearest() -> None:
    with pytest.raises(UsageError, match="nearest: run_out_3"):
        CaseOf("control+run_out3", 1).tables()


def test_rates_count_what_they_say() -> None:
    planted = replace(ROW, planted="wear", size="small", named="wear", status="missing")
    assert nuisances.right(planted)
    assert not nuisances.false_names(planted)
    in_a_set = replace(planted, named="edge_impact", sets='[["edge_impact", "wear"]]')
    assert nuisances.right(in_a_set)
    assert not nuisances.false_names(in_a_set)
    of_three = replace(in_a_set, sets='[["edge_impact", "wear", "traction"]]')
    assert not nuisances.right(of_three)
    second = replace(planted, named="wear+traction")
    assert nuisances.right(second)
    assert nuisances.false_names(second) == {"traction"}
    assert nuisances.contradicted(replace(ROW, heldout_after=1.06))
    assert nuisances.contradicted(replace(ROW, chi2_after=1.21))
    assert not nuisances.contradicted(ROW)
    assert not nuisances.contradicted(replace(ROW, status="scatter", chi2_after=3.0))
    said = "\n".join(nuisances.summary([ROW, replace(ROW, named="wear", status="missing")]))
    assert "control: wear x1" in said
    assert said.count("1/2 = 50.0 %") == 4  # nothing missing and false names; control and all
