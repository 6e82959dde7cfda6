"""Property: who follows the how-tos for a condition, an observable and a table has them all."""

import re
import shutil
from pathlib import Path

from tests.processes import python
from tirelog.physics.model.user_effects import effects_of_file

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^<!-- (\S+), (?:new|before `([^`]+)`) -->\n```\w+\n(.*?)^```$", re.M | re.S)

USED = """
import runpy
from types import SimpleNamespace
import numpy as np
import tirelog
from tirelog.data.recording import Conditions, Recording
from tirelog.data.setup import parse_setup
from tirelog.diagnosis.residual_structure import factors_of
from tirelog.diagnosis.candidates.separation import ALLOWED
from tirelog.diagnosis.answer import not_varied
from tirelog.errors import ModelError, SetupError
from tirelog.inference.stacks.manoeuvres import conditions_of
from tirelog.inference.stacks.manoeuvres import MEASURED
from tirelog.physics import BY_ID, Model
from tirelog.physics.model.user_effects import effect_by_expression
from tirelog.vocabulary.observables import SCALARS, shown

assert tirelog.__file__.startswith(FOLDER), tirelog.__file__
setup = "[conditions]\\ncamber_deg = %s\\n[channels.s]\\nkind = 'strain'\\nsource = 's'\\n"
assert parse_setup(setup % 3).conditions.camber_deg == 3.0
log = Recording("a.csv", {}, parse_setup(setup % 3))
revolutions = conditions_of(log, np.arange(3.0), np.ones(3), np.zeros(3))
assert np.array_equal(revolutions.camber_deg, [3.0, 3.0, 3.0])
two = Conditions.of(2, speed_m_s=10.0, camber_deg=[0.0, 5.0])
cells = SimpleNamespace(conditions=two, log=np.zeros(2, int))
assert "camber" in factors_of(SimpleNamespace(cells=cells, fit=SimpleNamespace(stuck=False)))
try:
    parse_setup(setup % 30)
except SetupError as problem:
    assert "from -20 to 20" in str(problem), problem
else:
    raise AssertionError("30 degrees are allowed")

phi = np.linspace(-3.0, 3.0, 50)
beam = Model.new("beam")
leans = beam.with_effect("camber_load", per_degree=0.01)
conditions = Conditions.of(2, speed_m_s=10.0, camber_deg=[0.0, 5.0])
upright, leaning = leans.predict(conditions, phi) / beam.predict(conditions, phi)
assert np.allclose(upright, 1.0) and not np.allclose(leaning, 1.0)
try:
    leans.predict(Conditions.of(2, speed_m_s=10.0), phi)
except ModelError as problem:
    assert "needs camber_deg" in str(problem), problem
else:
    raise AssertionError("predicted without its condition")
said = not_varied(Conditions.of(2, camber_deg=3.0), [BY_ID["camber_load"]])
assert said.startswith("Constant: camber 3 deg. Effects that follow them (camber_load)"), said
assert any("camber" in manoeuvre.name for manoeuvre in ALLOWED)
own = effect_by_expression("own", "baseline", "camber * 1e-6", ())
assert own.followed == (("camber_deg", 1.0),) and own.needs == ("camber_deg",)
pages = runpy.run_path(DOCS)
assert "camber_load" in pages["conditions_page"]() and "camber 0" not in pages["effects_page"]()

timed = Model.new("beam", "contact_time")
length = Model.new("beam", "patch_length").predict(conditions)
assert np.allclose(timed.predict(conditions), length / 10.0)
assert shown("contact_time", "") == (1e3, "ms")
assert set(SCALARS) == set(MEASURED)
assert "contact_time" in BY_ID["camber_load"].reaches

import json
from inspect import signature
from pathlib import Path
import pandas as pd
from tirelog.campaign.manifest import load_manifest
from tirelog.cli import run
import h5py
with h5py.File("a.h5", "w") as file:  # a text log would have its kernels compiled in the copy
    file["s"] = 1e-4 * np.sin(np.arange(400) / 7.0)
lines = ("[log]", "sampling_rate_Hz = 100.0", "[channels.s]", "kind = 'strain'", "source = '/s'")
Path("a.toml").write_text("\\n".join(lines))
# no csv either, whose writer is a kernel
assert run(["strain-range", "a.h5", "-o", "r.parquet"]) == 0
row = pd.read_parquet("r.parquet").iloc[0]
assert abs(row.strain_least + 1e-4) < 1e-7 and abs(row.strain_largest - 1e-4) < 1e-7, row
frame = tirelog.strain_range("a.h5", outside=0.25)
assert frame.strain_largest[0] < 0.8e-4 and frame.attrs["units"]["duration_s"] == "s"
named = ["logs", "setup", "outside", "start", "stop"]
assert list(signature(tirelog.strain_range).parameters) == named
assert "Share left out" in tirelog.strain_range.__doc__ and "strain_range" in dir(tirelog)
assert run(["strain-range", "a.h5", "--outside", "0.7", "-o", "x.parquet"]) == 2
assert not Path("x.parquet").exists()
all_of_it = ["tables", "a.h5", "-o", "t", "--format", "parquet"]
assert run([*all_of_it, "--table", "strain-range"]) == 0
assert pd.read_parquet("t/strain-range.parquet").equals(pd.read_parquet("r.parquet"))
assert run(["check", "t/strain-range.parquet", "--against", "r.parquet"]) == 0
lines = ("[campaign]", "name = 'm'", "[[logs]]", "glob = 'a.h5'", "[tables.strain-range]")
Path("m.toml").write_text("\\n".join((*lines, "outside = 0.1")))
assert load_manifest(Path("m.toml")).tables == {"strain-range": {"outside": 0.1}}
assert "## strain-range" in pages["tables_page"]() and "`--outside`" in pages["tables_page"]()
"""


def follow(page, copy):
    """Make the changes of a how-to in the copy; the files that it touched."""
    text = (ROOT / "docs" / "howto" / page).read_text(encoding="utf-8")
    touched = set()
    for name, anchor, code in BLOCK.findall(text):
        path = copy / name
        if not anchor:
            assert not path.exists()
            path.write_text(code)
        else:
            before, found = path.read_text(), anchor.replace("\\n", "\n")
            assert before.count(found) == 1, (name, anchor)
            path.write_text(before.replace(found, code + found))
        assert f"`{name}`" in text.replace(f"<!-- {name}", "")
        touched.add(name)
    return touched


def test_a_condition_with_its_effect_is_two_files_an_observable_and_a_table_are_three(tmp_path):
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "tirelog", tmp_path / "tirelog", ignore=ignored)
    assert len(follow("condition.md", tmp_path)) == 2
    assert len(follow("observable.md", tmp_path)) == 3
    assert len(follow("table.md", tmp_path)) == 3
    script = USED.replace("FOLDER", repr(str(tmp_path)))
    script = script.replace("DOCS", repr(str(ROOT / "docs" / "generate.py")))
    python(script, folder=tmp_path, PYTHONPATH=str(tmp_path))


def test_the_page_s_own_effect_is_read(tmp_path):
    text = (ROOT / "docs" / "python_effects.md").read_text(encoding="utf-8")
    [code] = re.findall(r"^```python\n(from tirelog\.physics import.*?)^```$", text, re.M | re.S)
    (tmp_path / "mine.py").write_text(code)
    [effect] = effects_of_file(tmp_path / "mine.py").values()
    assert effect.follows_said == "speed"
    assert effect.valid_range == {"speed_m_s": (0.0, 40.0)}
