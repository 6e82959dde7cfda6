"""Property: the benchmarks' cases can be repeated, differ by what is asked alone, show what is
planted in them, and their rates count what they say.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks import nuisances
from benchmarks.cases import IN_CATALOGUE, OUTSIDE, Case, case
from benchmarks.nuisance_worlds import WORLDS, CaseOf
from benchmarks.nuisances import Row
from tirelog.errors import UsageError
from tirelog.simulation import simulate
from tirelog.simulation.scenario.schema import PLANTABLE

QUICK = Case(plan="short", logs=2)


def test_planting_changes_nothing_else() -> None:
    null, full = case((), seed=5, how=QUICK), case(("wear", "traction"), seed=5, how=QUICK)
    assert [replace(s, effects=()) for s in full] == null
    assert all(not s.effects for s in null)


@pytest.mark.parametrize("name", [*IN_CATALOGUE, *OUTSIDE])
def test_every_effect_shows_and_is_told(name: str) -> None:
    """Each planted effect moves the strain by more than its noise somewhere, in both forms, and the
    truth names it.
    """
    for form in PLANTABLE[name].forms:
        how = Case(plan="short", logs=2, form=form, noise_nm=0.0, roughness=0.0, duration=0.35)
        with_effect, without = (simulate(case(e, seed=8, how=how)[1]) for e in ((name,), ()))
        change = 1.27 / 1550.0 * (with_effect.channels["strain_1"] - without.channels["strain_1"])
        assert 4e-6 < change.std() < 2e-4
        told = with_effect.truth["effects"]
        assert [(e["name"], e["form"], e["in_catalogue"]) for e in told] == [
            (name, form, name in IN_CATALOGUE)
        ]
        assert (
            told[0]["strength"]
            == with_effect.scenario.effects[0][
                next(iter(with_effect.scenario.effects[0].parameters))
            ]
        )
        if name in OUTSIDE:
            assert told[0]["where"] in ("entry", "patch", "exit", "away")
            assert told[0]["parity"] in ("even", "odd", "mixed")


@pytest.mark.parametrize(
    ("effects", "how", "said"),
    [
        (("watr_film",), QUICK, "water_film"),
        (("wear",), Case(form="another"), "other"),
        ((), Case(plan="mixt"), "mixed"),
    ],
)
def test_unknown_words_are_refused(effects: tuple[str, ...], how: Case, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        case(effects, seed=1, how=how)
    with pytest.raises(UsageError, match="nearest: run_out_3"):
        CaseOf("control+run_out3", 1).tables()


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
            own = {"channels": bare.channels, "nuisances": bare.nuisances}
            for table, keys in (
                ("road", ["load_scatter"]),
                ("tire", ["patch_load_exponent", "contact"]),
                ("conditions", ["warm_up_K", "warm_up_time_s"]),
            ):
                control_s = {key: getattr(getattr(bare, table), key) for key in keys}
                own[table] = replace(getattr(log, table), **control_s)
            free = replace(log, **own)
            assert free == bare
            assert (log == bare) == (world == "control")


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
