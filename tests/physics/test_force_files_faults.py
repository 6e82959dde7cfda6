"""Faults: files with forces, and plans, that cannot be used say what is allowed."""

import pytest

from benchmarks.goldens import tirelog
from tests.physics.test_force_files_closed_form import TYDEX
from tirelog.api.models import load_model, read_forces
from tirelog.errors import ReadError


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("kN        1         0", "kN        1         5", 7, "with an offset"),
        ("FZW       wheel load                    kN", "FZW       wheel load    kg", 7, "'kg'"),
        ("4.1    0    0    0.1   12.5", "4.1    0    0    0.1", 14, "4 cells"),
        ("4.1    0    0    0.1   12.5", "4.1    0    x    0.1 2", 14, "1 are no numbers"),
        ("4.1    0    0    0.1   12.5", "4.1    0    nan    0.1 2", 14, "1 are no numbers"),
        ("FX ", "FQ ", None, "no other force"),
        ("LONGVEL   speed                         km/h      72", "INCLANGL a deg 2", None, None),
        ("**MEASURDATA", "**MEASUREMENT", None, r"neither a \[MDI_HEADER\]"),
    ],
)
def test_what_a_tydex_file_lacks_is_named_with_its_line(tmp_path, old, new, line, says):
    path = tmp_path / "rig.tdx"
    path.write_text(TYDEX.replace(old, new))
    if says is None:  # camber in W axes
        assert read_forces(path)["camber_deg"] == pytest.approx([2.0, 2.0])
        path.write_text(TYDEX.replace(old, new).replace("FZW", "FZH"))
        says = "H or C axes"
    with pytest.raises(ReadError, match=says) as refusal:
        read_forces(path)
    assert refusal.value.line == line


def test_a_tir_file_of_other_units_or_formulas_is_refused(tmp_path):
    path = tmp_path / "tire.tir"
    for text, says in (
        ("[MDI_HEADER]\nFORCE = 'pound_force'", "export the file in SI units"),
        ("[MDI_HEADER]\nPCX1 = 1.6", "has no FNOMIN, PDX1, PKX1, PCY1"),
    ):
        path.write_text(text)
        with pytest.raises(ReadError, match=says):
            read_forces(path)


def test_a_model_without_a_free_number_is_refused(tmp_path):
    tirelog(tmp_path, "model", "new", "--preset", "P2", "-o", "m.toml")
    free = load_model(tmp_path / "m.toml").free
    tirelog(tmp_path, "model", "set", "m.toml", *(f"{name}=fixed" for name in free))
    done = tirelog(tmp_path, "model", "plan", "m.toml")
    assert done.status == 2
    assert "no free parameter" in done.err
