"""Property: formulas of the grammar mean the same in other units; a parameter keeps its unit."""

import numpy as np
import pytest

from tests.physics.test_model_file_property import CONTRACT
from tirelog.diagnosis.propose.grammar import LAW_UNITS, LAWS, forms
from tirelog.errors import ModelError
from tirelog.physics.model.file import as_toml, parse_model
from tirelog.physics.model.user_effects import parse_expression
from tirelog.vocabulary.conditions import CONDITIONS

#: the base units in others, and what follows from them
OTHER = {"m": 2.0, "s": 3.0, "kg": 5.0, "K": 7.0, "rad": 1.0}
OTHER |= {"Hz": 1.0 / 3.0, "N": 5.0 * 2.0 / 9.0, "Pa": 5.0 / (2.0 * 9.0), "km": 2.0, "mm": 2.0}
#: quantities that formulas read or have as plain numbers: a value and its unit
KNOWN = {
    "xi": (0.06, "m"), "phi": (0.2, "rad"), "L": (0.05, "m"), "R": (0.3, "m"), "load": (3e3, "N"),
    "twenty": (20.0, "m/s"), "g": (9.81, "m/s^2"),
} | {c.symbol: (12.0, c.unit) for c in CONDITIONS.values() if c.symbol != "load"}  # fmt: skip


def size(unit):
    """A unit such as `N/m^2` in the other units."""
    return float(eval(unit.replace("^", "**").replace(" ", "*") or "1", {}, OTHER))


def test_a_formula_of_the_grammar_is_the_same_quantity_in_other_units():
    number = 0
    for form in forms():
        quantities = {name: (0.7, form.unit(name)) for name in form.profile.numbers}
        quantities |= {name: (1.5, unit) for name, unit in LAW_UNITS.items()} | KNOWN
        ours = {name: value for name, (value, _) in quantities.items()}
        theirs = {name: value * size(unit) for name, (value, unit) in quantities.items()}
        result = "N/m" if form.stage.prefix else "1"
        for law in LAWS:
            factor = law.text.replace("20", "twenty").replace("9.81", "g")
            factor = factor.format(**{c.symbol: c.symbol for c in CONDITIONS.values()})
            text = f"{factor} * {form.stage.prefix}{form.text.replace('@', 'sin')}"
            formula = parse_expression(text, set(quantities))
            np.testing.assert_allclose(
                formula(theirs), formula(ours) * size(result), rtol=1e-12, err_msg=text
            )
            number += 1
    assert number > 400


def test_a_parameter_s_unit_is_read_and_written():
    model = parse_model(CONTRACT.replace("{ value = 5e3,", '{ unit = "N/m^2", value = 5e3,'))
    assert model.parameters["my_wedge.q"].unit == "N/m^2"
    moved = parse_model(as_toml(model.with_values({"my_wedge.q": 6e3})))
    assert (moved.values["my_wedge.q"], moved.parameters["my_wedge.q"].unit) == (6e3, "N/m^2")
    with pytest.raises(ModelError, match="unit"):
        parse_model(CONTRACT.replace("{ value = 4.0,", '{ unit = "N", value = 4.0,', 1))
