"""Property: models are made of presets and edited in their place, whole; nothing else is."""

import gzip
import re
import shutil
from itertools import islice
from pathlib import Path

import pytest

from tirelog.physics.model.file import load_model, preset_model

SAMPLES = Path(__file__).parents[2] / "sample_data"


@pytest.fixture
def model(folder, tirelog):
    """A model beside a log of eighty revolutions."""
    with gzip.open(SAMPLES / "hidden_1.csv.gz", "rt") as log:
        (folder / "log.csv").write_text("".join(islice(log, 25_000)))
    shutil.copy(SAMPLES / "hidden_1.toml", folder / "log.toml")
    assert tirelog("model", "new", "--setup", "log.toml", "-o", "m.toml").status == 0
    return folder / "m.toml"


def test_an_edited_model_may_keep_its_name(model, tirelog):
    assert tirelog("model", "add", "m.toml", "wear", "-o", "m.toml").status == 0
    assert 'name = "wear"' in model.read_text()
    assert tirelog("model", "remove", "m.toml", "wear", "-o", "./m.toml").status == 0
    assert 'name = "wear"' not in model.read_text()
    model.with_name("linked.toml").symlink_to("m.toml")
    assert tirelog("model", "set", "linked.toml", "wheel=on").status == 0
    assert 'wheel = "on"' in model.read_text()
    before = model.read_text()
    told = tirelog("model", "fit", "log.csv", "--model", "m.toml", "-o", "m.toml").ended(0).out
    assert model.read_text() != before
    for name, p in load_model(model).parameters.items():
        if p.free and p.se is not None:  # with six digits, and the error beside it
            line = next(line for line in told.splitlines() if line.split()[:1] == [name])
            assert line.split()[1:4] == [f"{p.value:.6g}", "+-", f"{p.se:.2g}"]
    assert not list(model.parent.glob(".*.part"))


def test_of_several_gratings_the_one_taken_is_named(model, tirelog, folder):
    rows = (folder / "log.csv").read_text().splitlines()
    setup = (folder / "log.toml").read_text()
    block = setup[setup.index("[channels.strain_1]") : setup.index("[log]")]
    own = [f"{row},{row.split(',')[1]}" if row[0].isdigit() else row for row in rows]
    own[2] = f"{rows[2]},CH1_FBG2"
    (folder / "log.csv").write_text("\n".join(own) + "\n")
    second = block.replace("strain_1", "strain_2").replace("CH1_FBG1", "CH1_FBG2")
    (folder / "log.toml").write_text(setup.replace("[log]", f"{second}[log]"))
    said = "strain_1 is one of 2 channels of strain; left out: strain_2 (--channel NAME takes"
    for words in ("compare", "propose"):
        outcome = tirelog(words, "log.csv", "--model", "m.toml")
        assert outcome.err.count(said) == 1, words
    fitted = ("model", "fit", "log.csv", "--model", "m.toml", "-o", "m2.toml")
    assert said in tirelog(*fitted).err
    for channel in ("strain_1", "strain_2"):
        named = tirelog("compare", "log.csv", "--model", "m.toml", "--channel", channel)
        assert "left out" not in named.err


CHANGES = (
    ("line_mass_kg_m=5.5", ("line_mass_kg_m", "value"), 5.5),
    ("line_mass_kg_m=free", ("line_mass_kg_m", "free"), True),
    ("lever_arm_m=fixed", ("lever_arm_m", "free"), False),
    ("lever_arm_m=0:0.01", ("lever_arm_m", "max"), 0.01),
    ("line_mass_kg_m=1:9", ("line_mass_kg_m", "free"), True),
    ("wear.amplitude=0.5", ("wear.amplitude", "value"), 0.5),
    ("wear.amplitude=-1:1", ("wear.amplitude", "min"), -1.0),
    ("patch_load_exponent=0.4", ("patch_load_exponent", "value"), 0.4),
)


@pytest.mark.parametrize(("change", "place", "value"), CHANGES, ids=[c[0] for c in CHANGES])
@pytest.mark.parametrize("bare", [False, True])
def test_a_change_is_read_back(model, tirelog, change, place, value, bare):
    """Also from a file that lacks bounds and fixed parameters; nothing else changes."""
    assert tirelog("model", "add", "m.toml", "wear", "-o", "m.toml").status == 0
    if bare:
        text = re.sub(r", min = [^}]*", "", model.read_text())
        model.write_text(re.sub(r"patch_load_exponent.*\n", "", text))
    before = load_model(model)
    assert tirelog("model", "set", "m.toml", change).status == 0
    after = load_model(model)
    name, field = place
    assert getattr(after.parameters[name], field) == value
    others = [n for n in before.parameters if n != name]
    assert [after.parameters[n] for n in others] == [before.parameters[n] for n in others]
    assert tirelog("model", "set", "m.toml", "wheel=on", "-o", "new.toml").status == 0
    assert [n.use for n in load_model("new.toml").nuisances if n.name == "wheel"] == ["on"]


# ---- presets ------------------------------------------------------------------------------------


def test_a_preset_is_written_as_it_is_with_its_sources(folder, tirelog):
    for name in ("P1", "P2", "P3"):
        outcome = tirelog("model", "new", "--preset", name, "-o", f"{name}.toml").ended(0)
        assert "a guess" not in outcome.err
        read = load_model(f"{name}.toml")
        assert (read.values, read.free) == (preset_model(name).values, preset_model(name).free)
        assert "Table" in (folder / f"{name}.toml").read_text()


def test_a_setup_goes_before_a_preset_and_set_before_both(folder, tirelog):
    line = ["model", "new", "--preset", "P2", "--setup", "log.toml", "-o", "m.toml"]
    assert tirelog(*line).status == 0
    assert load_model("m.toml").values["radius_m"] == 0.305
    assert load_model("m.toml").values["foundation_stiffness_N_m2"] == 7.79e6
    assert tirelog(*line, "--set", "radius_m=0.31").status == 0
    assert load_model("m.toml").values["radius_m"] == 0.31
