"""Faults: mistaken models are refused in a sentence, with what is allowed."""

import numpy as np
import pytest

from tests.physics.commands import status
from tests.physics.test_model_file_property import CONTRACT
from tirelog.data.recording import Conditions
from tirelog.errors import ModelError
from tirelog.physics import Model
from tirelog.physics.model.file import as_toml, load_model, parse_model, save_model
from tirelog.physics.model.user_effects import (
    MOST_NODES,
    effects_of_file,
    parse_expression,
)

PHI = np.linspace(-1.0, 1.0, 9)


def test_an_expression_without_its_place_acts_on_the_contact_pressure():
    line = 'acts_on = "contact_pressure"\n'
    assert line in CONTRACT
    bare = parse_model(CONTRACT.replace(line, ""))
    assert bare.values == parse_model(CONTRACT).values
    assert bare.effects[-1].source["acts_on"] == "contact_pressure"


BEAM = Model.new("beam")


#: an effect of more numbers than one may have
MEASURED = f"""
[[effects]]
name = "mine"
shape = "empirical"
acts_on = "strain"
frame = "time_since_exit"
nodes = {list(range(MOST_NODES + 1))}
values = {[0] * (MOST_NODES + 1)}
"""


def predicted(model=BEAM, phi=PHI, **drive):
    return model.predict(Conditions.of(1, **drive), phi)


@pytest.mark.parametrize(
    ("said", "asked"),
    [
        ("already", lambda: parse_model(CONTRACT + '[[effects]]\nname = "viscous_damping"\n')),
        (f"at most {MOST_NODES} numbers", lambda: parse_model(CONTRACT + MEASURED)),
        ("no observable", lambda: Model.new("beam", ())),
        ("no speed", predicted),
        ("needs angles", lambda: predicted(phi=None, speed_m_s=8.0)),
    ],
)
def test_what_is_impossible_is_refused(said, asked):
    """What the commands refuse is golden: tests/golden/uses/models.toml, expressions.toml."""
    with pytest.raises(ModelError, match=said):
        asked()


def test_expressions_compute_what_numpy_computes():
    xi, v = np.linspace(-2.0, 2.0, 9), 3.0
    cases = {
        "xi ** 2 + v * sin(xi)": xi**2 + v * np.sin(xi),
        "(xi < 0) * v": (xi < 0) * v,
        "where(xi > 1, xi, -xi)": np.where(xi > 1, xi, -xi),
        "xi if -1 < xi <= 1 else 0": np.where((xi > -1) & (xi <= 1), xi, 0),
        "not (xi < 0 or xi > 1)": (~((xi < 0) | (xi > 1))).astype(float),
        "~(xi < 0) & (xi < 1)": ((xi >= 0) & (xi < 1)).astype(float),
        "2 ** -1 + pi % 3": np.full(9, 0.5 + np.pi % 3),
        "exp(xi < 0) + sign(xi < 0)": np.where(xi < 0, np.e + 1.0, 1.0),
    }
    for text, wanted in cases.items():
        got = np.broadcast_to(parse_expression(text, {"xi", "v"})({"xi": xi, "v": v}), xi.shape)
        assert np.allclose(got, wanted, atol=1e-15), text


PHASE = Model.new("beam", "phase_shift")
ON_LOAD = {
    "load_transfer": '[[effects]]\nname = "load_transfer"\n',
    "aero_load": '[[effects]]\nname = "aero_load"\n',
    "mine": """[[effects]]
name = "mine"
acts_on = "load"
expression = "q * speed"
parameters = { q = { value = 1.0, min = 0.0, max = 9.0 } }
""",
}
CROSSTALK = '[[effects]]\nname = "load_crosstalk"\nper_relative_load_rad = 0.1\n'


@pytest.mark.parametrize("name", ON_LOAD)
def test_an_effect_on_the_load_of_a_phase_shift_acts_through_crosstalk_or_is_refused(name):
    alone = as_toml(PHASE)
    line = len(alone.splitlines()) + 3
    says = f"model:{line}: effect '{name}' acts on load, which nothing in this model .* reads"
    with pytest.raises(ModelError, match=says) as refused:
        parse_model(f"{alone}\n{ON_LOAD[name]}")
    assert refused.value.do == f"add load_crosstalk as well, or leave {name} out"
    drive = Conditions.of(2, speed_m_s=[10.0, 20.0], acceleration_m_s2=[0.0, 3.0])
    before = parse_model(f"{alone}\n{CROSSTALK}").predict(drive)
    for effects in (ON_LOAD[name] + CROSSTALK, CROSSTALK + ON_LOAD[name]):
        both = parse_model(f"{alone}\n{effects}")
        strength = {"mine": "mine.q"}.get(name, f"{name}.coefficient")
        assert not np.allclose(both.with_values({strength: 0.1}).predict(drive), before, rtol=1e-6)
        with pytest.raises(ModelError, match=f"{name} would act on nothing"):
            both.without_effect("load_crosstalk")
        assert both.without_effect("load_crosstalk", name).effects == ()


OWN = """
from tirelog.physics import Effect, Parameter
import numpy as np

def baseline(v, drive):
    return v["a"] * drive.speed_m_s

EFFECT = Effect(
    id="mine", mechanism="m", follows=(("speed_m_s", 1),), acts_on=("baseline",),
    parameters=(Parameter("a", "s/m", "a", 0.0, -1.0, 1.0, probe=1e-6),),
    strength=("a",), source="s", valid="v", signature="s", baseline=baseline,
)
"""


def test_a_users_python_file(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(OWN)
    effect = effects_of_file(path)["mine"]
    model = Model.new("beam").with_effect(effect, a=2e-6)
    conditions = Conditions.of(1, speed_m_s=10.0)
    assert np.allclose(
        model.predict(conditions, PHI) - Model.new("beam").predict(conditions, PHI), 2e-5
    )
    save_model(model, tmp_path / "m.toml")
    with pytest.raises(ModelError, match=r"unknown effect 'mine'.* in Python give --effects FILE"):
        load_model(tmp_path / "m.toml")
    assert load_model(tmp_path / "m.toml", effects=path).values["mine.a"] == 2e-6


def test_what_a_users_python_raises_is_the_users_with_its_line(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(OWN.replace('v["a"]', 'v["b"]'))
    model = Model.new("beam").with_effect(effects_of_file(path)["mine"], a=2e-6)
    with pytest.raises(
        ModelError, match=r"mine\.py:6: baseline of the effect 'mine': KeyError: 'b'; .*correct it"
    ):
        model.predict(Conditions.of(1, speed_m_s=10.0), PHI)


def test_commands_take_own_effects_from_the_file_that_is_given_and_from_no_other(tmp_path, capsys):
    plain, model, own = (tmp_path / name for name in ("plain.toml", "m.toml", "mine.py"))
    own.write_text(OWN)
    given = ["--effects", str(own)]
    assert status("model new -o", str(plain), "--quiet") == 0
    assert status("model add", str(plain), "mine", *given, "-o", str(model)) == 0
    assert status("model show", str(model), *given) == 0
    assert f"own effects from {own}" in capsys.readouterr().out
    assert status("model show", str(model)) == 2
    assert "in Python give --effects FILE" in capsys.readouterr().err
    model.write_text(model.read_text().replace("[model]", '[model]\neffects_file = "mine.py"', 1))
    assert status("model show", str(model), *given) == 2
    assert "unknown key 'effects_file'" in capsys.readouterr().err


def test_a_form_is_kept_as_it_is_written():
    written = '[form]\nuse = "on" # flat\npressure = 0.5\npressure_3 = 0.4\n'
    model = parse_model(as_toml(Model.new("beam")) + "\n" + written)
    assert model.nuisances[-1].use == "on"
    assert model.nuisances[-1].size("pressure") == 0.5
    assert model.values["form.pressure_3"] == 0.4
    assert written in as_toml(model)
    bare = parse_model(as_toml(model.with_nuisance("form", "off")))
    assert "form.pressure_3" not in bare.values
    assert bare.nuisances[-1].use == "off"


def test_nuisances_are_kept_as_they_are_written():
    written = 'wheel = "off" # bad rig\ndrift = { use = "on", relative = 0.05 }\n'
    model = parse_model(as_toml(Model.new("beam")) + "\n[nuisances]\n" + written)
    assert [n.use for n in model.nuisances] == ["off", "on", "auto", "auto", "auto", "auto"]
    assert written in as_toml(model)
    again = parse_model(as_toml(model.with_nuisance("rolling", "on").with_nuisance("drift", "off")))
    assert [n.use for n in again.nuisances] == ["off", "off", "on", "auto", "auto", "auto"]
    assert again.nuisances[1].size("relative") == 0.05
    with pytest.raises(ModelError, match="wheel"):
        model.with_nuisance("weel", "on")
