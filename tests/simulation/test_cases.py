"""Property: every effect that can be planted shows in its log and is named by its truth."""

import pytest

from benchmarks.cases import IN_CATALOGUE, OUTSIDE, Case, case
from tirelog.simulation import simulate
from tirelog.simulation.scenario.schema import PLANTABLE


@pytest.mark.parametrize("name", [*IN_CATALOGUE, *OUTSIDE])
def test_every_effect_shows_and_is_told(name):
    """It moves the strain by more than its noise somewhere, in both forms."""
    for form in PLANTABLE[name].forms:
        how = Case(plan="short", logs=2, form=form, noise_nm=0.0, roughness=0.0, duration=0.35)
        with_effect, without = (simulate(case(e, seed=8, how=how)[1]) for e in ((name,), ()))
        change = 1.27 / 1550.0 * (with_effect.channels["strain_1"] - without.channels["strain_1"])
        assert 4e-6 < change.std() < 2e-4
        told = with_effect.truth["effects"]
        assert [(e["name"], e["form"], e["in_catalogue"]) for e in told] == [
            (name, form, name in IN_CATALOGUE)
        ]
        planted = with_effect.scenario.effects[0]
        assert told[0]["strength"] == planted[next(iter(planted.parameters))]
        if name in OUTSIDE:
            assert told[0]["where"] in ("entry", "patch", "exit", "away")
            assert told[0]["parity"] in ("even", "odd", "mixed")
