"""Closed form: formulas whose units agree, and those of which a part does not fit."""

from pathlib import Path

import pytest

from tests.physics.test_model_file_property import CONTRACT
from tirelog.diagnosis.propose.grammar import LAW_UNITS, LAWS, forms
from tirelog.errors import ModelError
from tirelog.physics.model.expression import RESULT_UNITS, dimension_of, disagreement, said
from tirelog.physics.model.file import as_toml, load_model, parse_model, unit_remarks
from tirelog.physics.model.user_effects import EXPRESSION_ACTS_ON
from tirelog.vocabulary.conditions import CONDITIONS

SINCE = "((xi - L) % (2 * pi * R))"


@pytest.mark.parametrize(
    ("unit", "powers"),
    [
        ("1", (0, 0, 0, 0)),
        ("N/m^2", (-1, 1, -2, 0)),
        ("N m^2", (3, 1, -2, 0)),
        ("1/s", (0, 0, -1, 0)),
        ("m/s^2", (1, 0, -2, 0)),
        ("K", (0, 0, 0, 1)),
        ("km", (1, 0, 0, 0)),
    ],
)
def test_a_unit_is_its_powers(unit: str, powers: tuple[float, ...]) -> None:
    found = dimension_of(unit)
    assert found is not None
    assert tuple(found) == powers


@pytest.mark.parametrize("unit", ["furlong", "m^", "m^x", "N/", "2 m"])
def test_what_is_no_unit_is_none(unit: str) -> None:
    assert dimension_of(unit) is None


@pytest.mark.parametrize(
    ("text", "units", "result"),
    [
        (f"A * (speed / 20) * exp(-{SINCE} / speed * rate)", {"A": "1", "rate": "1/s"}, "1"),
        (f"A * sin(2 * pi * f * {SINCE} / speed + psi)", {"A": "1", "f": "Hz", "psi": "rad"}, "1"),
        ("load / (2 * L) * A * (speed / 20) ** n", {"A": "1", "n": "1"}, "N/m"),
        ("A * exp(-abs(xi - L) * rate)", {"A": "", "rate": ""}, "1"),
        ("A * (xi > 0.05) * (1 - exp(-time / 30))", {"A": "1"}, "1"),
        ("A * sqrt(speed ** 2 + acceleration * xi)", {"A": "s/m"}, "1"),
        ("where(xi > L, A, B) if speed > 10 else 0", {"A": "1", "B": ""}, "1"),
        ("2e6", {}, "N/m^2"),
        ("-A", {"A": "N"}, "N"),
        ("A * arctan2(xi, L) * hypot(xi, R) / L", {"A": "1"}, "1"),
    ],
)
def test_units_that_agree(text: str, units: dict[str, str], result: str) -> None:
    assert disagreement(text, units, result) == ""


@pytest.mark.parametrize(
    ("text", "units", "wrong"),
    [
        ("A * exp(-abs(xi - L) * rate)", {"A": "1", "rate": "1/s"}, "exp() of -abs(xi - L) * rate, "
         "which is m s^-1 and no number"),
        ("A * sin(xi + 1.0)", {"A": "1"}, "sin() of xi + 1.0, which is m and no number"),
        ("A * speed", {"A": "1"}, "the whole is m s^-1, and a number is wanted"),
        ("A * speed ** n", {"A": "1", "n": "1"}, "a fitted power of speed"),
        ("A * (xi + speed)", {"A": ""}, "xi + speed mixes m and m s^-1"),
        ("A * where(xi > 0, speed, time)", {"A": ""}, "mixes m s^-1 and s"),
        ("A ** xi", {"A": "1"}, "a power of xi, which is m"),
        ("A * (xi > time)", {"A": "1"}, "xi > time mixes m and s"),
    ],
)  # fmt: skip
def test_the_part_that_does_not_fit_is_named(text: str, units: dict[str, str], wrong: str) -> None:
    assert wrong in disagreement(text, units, "1")


def test_every_form_of_the_grammar_has_units_that_agree() -> None:
    number = 0
    for form in forms():
        result = RESULT_UNITS.get(form.stage.acts_on, "1")
        units = {name: form.unit(name) for name in form.profile.numbers}
        amplitude = form.stage.unit or "1"
        for law in LAWS:
            typical = {c.symbol: "3.5" for c in CONDITIONS.values()}
            factor = law.text.format(**typical)
            text = f"A * {factor} * {form.stage.prefix}{form.text.replace('@', 'sin')}"
            assert disagreement(text, units | dict(LAW_UNITS) | {"A": amplitude}, result) == "", (
                text
            )
            number += 1
    assert number > 400


def test_every_place_that_an_expression_acts_on_has_a_unit() -> None:
    assert set(EXPRESSION_ACTS_ON) - set(RESULT_UNITS) == {"baseline"}  # the observable's
    assert said(dimension_of("N/m")) == "kg s^-2"


def test_a_user_s_own_formula_is_remarked_on_with_its_place(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(CONTRACT)
    assert unit_remarks(load_model(path)) == []
    path.write_text(CONTRACT.replace("exp((xi + L) / 0.02)", "exp(xi + L)"))
    (remark,) = unit_remarks(load_model(path))
    assert remark.startswith(f"{path}:23: the units of effect 'my_wedge' do not agree: exp() of")


def test_a_parameter_s_unit_is_read_checked_and_written(tmp_path: Path) -> None:
    given = CONTRACT.replace("{ value = 5e3,", '{ unit = "N/m^2", value = 5e3,')
    given = given.replace("q * (speed / 20)**2 * exp((xi + L) / 0.02)", "q * exp(-xi / L)")
    model = parse_model(given)
    assert model.parameters["my_wedge.q"].unit == "N/m^2"
    (remark,) = unit_remarks(model)
    assert "N/m" not in remark
    assert "the whole is m^-1 kg s^-2, and kg s^-2 is wanted" in remark
    moved = parse_model(as_toml(model.with_values({"my_wedge.q": 6e3})))
    assert (moved.values["my_wedge.q"], moved.parameters["my_wedge.q"].unit) == (6e3, "N/m^2")
    with pytest.raises(ModelError, match="unit = 'furlong'"):
        parse_model(given.replace("N/m^2", "furlong"))
    with pytest.raises(ModelError, match="unit"):
        parse_model(CONTRACT.replace("{ value = 4.0,", '{ unit = "N", value = 4.0,', 1))
