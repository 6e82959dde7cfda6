"""Property: cases by a few arguments can be repeated, are null with nothing planted, and are
dialled by strength.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.cases import IN_CATALOGUE, OUTSIDE, Case, case
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
