"""Faults: a measured shape in a model file that is no shape is refused with its line."""

from pathlib import Path

import pytest

from tirelog.errors import ModelError
from tirelog.physics.model.file import load_model
from tirelog.physics.model.user_effects import MOST_NODES

FILE = """[model]
observable = "strain"
carcass = "beam"

[parameters]
flexural_stiffness_N_m2 = { value = 4.0, min = 0.1, max = 100.0 }
foundation_stiffness_N_m2 = 2.0e6
line_mass_kg_m = 4.5
patch_half_length_m = 0.055
lever_arm_m = 3e-4
load_N = 3600.0

[[effects]]
name = "mine"
shape = "empirical"
acts_on = "strain"
frame = "time_since_exit"
law = "speed / 20"
nodes = [0.0, 0.002, 0.004]
values = [0.0, 8e-5, 0.0]
parameters = { amplitude = { value = 1.0, min = -10.0, max = 10.0 } }
"""


def test_the_file_itself_is_read(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text(FILE)
    assert load_model(tmp_path / "m.toml").values["mine.amplitude"] == 1.0


@pytest.mark.parametrize(
    ("old", "new", "says", "line"),
    [
        ('"empirical"', '"imperical"', "nearest: empirical", 15),
        ('"time_since_exit"', '"time_since_exits"', "nearest: time_since_exit", 17),
        ('"time_since_exit"', '"speed"', "acts on 'strain'", 14),
        ('acts_on = "strain"', 'acts_on = "contact_pressure"', "patch", 14),
        ('"speed / 20"', '"xi / 20"', "allowed here are", 14),
        ('"speed / 20"', "\"__import__('os')\"", "not allowed", 14),
        ('"speed / 20"', "20", "law = 20 in [[effects]] number 1; allowed is text", 18),
        ("[0.0, 0.002, 0.004]", "[0.0, 0.004, 0.002]", "ascending", 14),
        ("[0.0, 0.002, 0.004]", "[0.0, 0.002]", "2 nodes and 3 values", 14),
        ("[0.0, 0.002, 0.004]", "[0.0, nan, 0.004]", "finite", 14),
        ("[0.0, 8e-5, 0.0]", "[0.0, inf, 0.0]", "finite", 14),
        ("[0.0, 8e-5, 0.0]", "[0.0, true, 0.0]", "finite", 14),
        ("[0.0, 8e-5, 0.0]", '"8e-5"', "finite", 14),
        ("[0.0, 8e-5, 0.0]", "[[0.0], [8e-5], [0.0]]", "finite", 14),
        ("nodes = [0.0, 0.002, 0.004]\n", "", "finite", 14),
        ("[0.0, 8e-5, 0.0]", str([0.0] * (MOST_NODES + 1)), f"up to {MOST_NODES}", 14),
        ("amplitude = {", "amplitudes = {", "nearest: amplitude", 21),
        ("law =", "laws =", "nearest: law", 18),
    ],
)
def test_what_is_no_shape_is_refused_with_its_line(
    old: str, new: str, says: str, line: int, tmp_path: Path
) -> None:
    path = tmp_path / "m.toml"
    assert old in FILE
    path.write_text(FILE.replace(old, new, 1))
    with pytest.raises(ModelError) as caught:
        load_model(path)
    assert says in str(caught.value)
    assert caught.value.line == line
