"""Property: what a seed draws is the same in every world, and rates count what they say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import nuisances
from benchmarks.nuisance_worlds import KINDS, WORLDS, CaseOf, kind_of, several
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


def test_a_wheel_is_the_same_in_every_log_and_another_for_another_seed() -> None:
    for world in ("run_out_30", "force_variation"):
        one, two = (
            [log.nuisances for log in CaseOf(world, seed).scenarios()] for seed in (20000, 20001)
        )
        assert one[0] == one[1]
        assert one[0] != two[0]
    grades = [log.nuisances for log in CaseOf("load_wander", 20000).scenarios()]
    assert grades[0] != grades[1]


def test_warm_worlds_are_warmer_by_what_they_say_at_their_end() -> None:
    for log in CaseOf("warming", 20000).scenarios():
        final, time = log.conditions.warm_up_K, log.conditions.warm_up_time_s
        assert final * -np.expm1(-log.duration_s / time) == pytest.approx(20.0, rel=1e-3)


def test_every_drive_is_below_the_critical_speed_of_its_beam() -> None:
    for seed in (*range(60), *range(20000, 20060)):
        for log in CaseOf("control", seed).scenarios():
            tire = log.tire
            bending = tire.flexural_stiffness_N_m2 or 4.0
            critical = np.sqrt(
                2.0 * np.sqrt(bending * tire.foundation_stiffness_N_m2) / tire.line_mass_kg_m
            )
            assert max(m.speed_m_s for m in log.manoeuvres) < 0.95 * critical
            assert 35.0 < log.duration_s < 80.0


def test_tuning_and_reporting_share_neither_tire_nor_plan() -> None:
    early, late = kind_of(999), kind_of(20000)
    assert early is not late
    assert early.radius_m[1] < late.radius_m[0]
    assert early.load_N[1] < late.load_N[0]
    assert early.bending_N_m2[1] < late.bending_N_m2[0]
    assert not set(early.plans) & set(late.plans)


def test_several_at_once_are_of_different_kinds() -> None:
    for seed in range(200):
        for count in (2, 4):
            parts = several(count, seed).split("+")
            of = [next(k for k, kind in enumerate(KINDS) if part in kind) for part in parts]
            assert len(set(of)) == count
    assert len({several(2, seed) for seed in range(200)}) > 30


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


def test_effect_of_another_size_is_left_out_and_said() -> None:
    sized = replace(ROW, planted="wear", size="small", named="wear", status="missing")
    rows = [replace(sized, planted_excess=3.0), replace(sized, planted_excess=7.0, seed=2)]
    said = "\n".join(nuisances.summary(rows))
    assert "1/1 = 100.0 %" in said
    assert "left out, since no strength gave the size: wear small (2)" in said
