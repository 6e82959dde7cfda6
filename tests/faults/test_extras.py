"""Faults: formats that a library reads: a sentence, bounded memory, no code of the file's."""

import io
import struct
import sys
import zipfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.feather
import pytest

from benchmarks.layouts import writers
from tests.readers.logs import spoilt
from tests.readers.other_files import outcome, refusal
from tirelog.readers.other import conversion as apart
from tirelog.readers.other.datasets import proper, unsafe_formula
from tirelog.readers.other.formats import FORMATS, name_of

N = 400
COLUMNS = {"inner": 10.0 + np.sin(np.arange(N) * 0.37), "outer": 1e-3 * np.arange(N)}


HEADS = {
    "TDMS": b"TDSm\x0e\0\0\0",
    "Excel": b"PK\3\4" + bytes(26) + b"[Content_Types].xml",
    "MDF": b"MDF     4.10    ",
}
OTHER_HEADS = {
    "MDF": [b"UnFinMF 4.10    "],
    "Excel": [b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", b"PK\3\4" + bytes(26) + b"_rels/.rels"],
}


@pytest.mark.parametrize("name", HEADS)
def test_without_its_library_the_line_that_installs_it(name, tmp_path, monkeypatch):
    monkeypatch.setattr(apart, "find_spec", lambda library: None)
    what = FORMATS[name]
    for head in (HEADS[name], *OTHER_HEADS.get(name, ())):
        assert name_of(head) == name
        message = refusal(head + bytes(500), tmp_path)
        assert f"is {what.name}, which {what.package} reads, and that is not installed" in message
        assert message.endswith(f"install it: pip install 'tirelog[{what.extra}]'")


def test_every_extra_is_one_that_can_be_installed():
    import tomllib

    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    for what in FORMATS.values():
        if what.library in sys.stdlib_module_names:
            continue
        wanted = extras[what.extra] if what.extra else project["dependencies"]
        assert any(one.startswith(what.package or what.library) for one in wanted)
    all_of_them = ",".join(what.extra for what in FORMATS.values() if what.extra)
    assert extras["formats"] == [f"tirelog[{all_of_them}]"]


def feather(table, **options):
    file = io.BytesIO()
    pyarrow.feather.write_feather(pa.table(table), file, **options)
    return file.getvalue()


FEATHER = feather({"time_s": np.arange(N) / 100.0, **COLUMNS})
LIMITS = {
    "MEMORY_BYTES": (32 << 20, "too much memory"),
    "DISK_BYTES": (1 << 12, "File too large|ended with status"),
    "_START_SECONDS": (0, "took too long"),
}


@pytest.mark.parametrize("limit", LIMITS)
def test_what_takes_too_much_is_ended_and_said(limit, tmp_path, monkeypatch):
    most, says = LIMITS[limit]
    small = feather({"inner": np.zeros(6_000_000)}, chunksize=6_000_000)  # one batch of 48 MB
    monkeypatch.setattr(apart, limit, most)
    monkeypatch.setattr(apart, "_BYTES_PER_SECOND", 1 << 40)
    message = refusal(small, tmp_path, "inner")
    assert any(part in message for part in says.split("|"))
    assert [one.name for one in tmp_path.iterdir()] == ["log"]


def test_a_child_that_fails_or_says_nothing(tmp_path, monkeypatch):
    run = apart._run
    monkeypatch.setattr(apart, "_run", lambda _, *files: run("no_such_format", *files))
    assert "no_such_format" in refusal(FEATHER, tmp_path, "inner")
    monkeypatch.setattr(apart, "_run", lambda *_: -11)
    assert "its library ended with status -11" in refusal(FEATHER, tmp_path, "inner")


@pytest.mark.parametrize("at", [60, 900, -300])
def test_a_feather_file_cut_or_changed(at, tmp_path):
    data = bytearray(FEATHER)
    if at < 0:
        del data[at:]
    else:
        data[at : at + 8] = b"\xff" * 8
    size, said = outcome(bytes(data), tmp_path, "inner")
    assert size == N or "is an Arrow or Feather file that cannot be read" in said


def conversion(formula, *inside):
    blocks = {f"text_{k}": one for k, one in enumerate(inside)}
    return SimpleNamespace(formula=formula, referenced_blocks=blocks or None)


@pytest.mark.parametrize("formula", ["", "X1 * 2.5e-3 + 1", "(x - 32) / 1.8", "-X"])
def test_a_formula_of_numbers_and_signs_is_used(formula):
    assert unsafe_formula(conversion(formula)) == ""
    assert unsafe_formula(conversion("", b"text", None, conversion(formula))) == ""


CODE = ["X ** 9 ** 9 ** 9", "sin(X)", "__import__('os')", "X.real", "X; X", "X[0]", "X # y"]


@pytest.mark.parametrize("formula", [*CODE, "1" * 300])
def test_a_formula_that_could_be_code_is_not_evaluated(formula):
    assert unsafe_formula(conversion(formula)) == formula[:40]
    assert unsafe_formula(conversion("", conversion("", conversion(formula)))) == formula[:40]


def test_conversions_without_end_end():
    endless = conversion("")
    endless.referenced_blocks = {"text_0": endless}
    assert unsafe_formula(endless) == "of formulas"


@pytest.mark.parametrize(
    ("name", "made"),
    [("a/b", "a_b"), ("temp [C]", "temp _C"), ("..", "unnamed"), ("", "unnamed"), ("x:y", "x_y")],
)
def test_a_name_is_one_that_a_setup_can_spell(name, made):
    assert proper(name).rstrip("_") == made


FILES = {
    "TDMS": ("nptdms", lambda path: writers.tdms(path, COLUMNS, 100.0), "/run/inner"),
    "Excel": (
        "python_calamine",
        lambda path: writers.xlsx(
            path, {"run": [["time", "inner"], *([0.01 * k, float(k % 7)] for k in range(N))]}
        ),
        "inner",
    ),
    "MDF": ("asammdf", lambda path: writers.mdf(path, COLUMNS, 100.0), "/run/inner"),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """(bytes, source) of a good file of a format; the test is skipped without its library."""
    folder, held = tmp_path_factory.mktemp("made"), {}

    def make(name):
        needs, write, source = FILES[name]
        pytest.importorskip(needs, reason=f"{needs} comes with an extra")
        if name not in held:
            write(folder / name)
            held[name] = (folder / name).read_bytes()
        return held[name], source

    return make


@pytest.mark.parametrize("name", FILES)
def test_flips_and_cuts_end_in_a_sentence_or_in_data(name, made, tmp_path):
    data, source = made(name)
    rng = np.random.default_rng(len(name))
    for _ in range(6):
        size, said = outcome(spoilt(data, rng, 16), tmp_path, source)
        assert size > 0 or str(tmp_path / "log") in said


@pytest.mark.parametrize("name", FILES)
def test_half_of_a_file_is_refused_or_said_to_be_half(name, made, tmp_path):
    data, source = made(name)
    size, said = outcome(data[: len(data) // 2], tmp_path, source)
    assert size <= N
    assert said


def sheet(rows):
    """A workbook whose sheet has these rows of XML."""
    file = io.BytesIO()
    writers.xlsx(file, {"run": [["time"], [1.0]]})  # type: ignore[arg-type]
    out = io.BytesIO()
    with zipfile.ZipFile(file) as old, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            text = old.read(name).decode()
            if name.endswith("sheet1.xml"):
                start, end = text.index("<sheetData>") + 11, text.index("</sheetData>")
                text = text[:start] + rows + text[end:]
            new.writestr(name, text)
    return out.getvalue()


FAR = '<row r="1"><c r="A1"><v>1</v></c></row><row r="1048576"><c r="XFD1048576"><v>2</v></c></row>'
MANY = "<row>" + "<c><v>1</v></c>" * 16_000 + "</row>"


@pytest.mark.parametrize("rows", [FAR, MANY * 4000], ids=["far apart", "very many"])
def test_a_small_workbook_of_very_many_cells(rows, tmp_path, monkeypatch):
    pytest.importorskip("python_calamine", reason="python_calamine comes with an extra")
    monkeypatch.setattr(apart, "MEMORY_BYTES", 1 << 28)
    assert "cannot be read" in refusal(sheet(rows), tmp_path)


def test_a_workbook_of_words_is_no_damage(tmp_path):
    pytest.importorskip("python_calamine", reason="python_calamine comes with an extra")
    words = '<row r="1"><c r="A1" t="str"><v>tread</v></c></row>'
    said = refusal(sheet(words), tmp_path)
    assert "document without a log in it: no sheet has rows of numbers" in said
    assert "cannot be read" not in said


def test_a_count_of_values_that_no_tdms_can_hold(made, tmp_path):
    data, source = made("TDMS")
    many = struct.pack("<Q", -(-N // 3))
    assert many in data
    size, said = outcome(data.replace(many, struct.pack("<Q", 1 << 60)), tmp_path, source)
    assert size <= N
    assert said
