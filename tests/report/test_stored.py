"""Property: sections that a campaign stored are those that are shown; several models are told
apart; a hostile file is refused.
"""

import json

import pytest

from tirelog.cli import run
from tirelog.diagnosis.answer import AnswerTable
from tirelog.errors import UsageError
from tirelog.report.build import model_pages, read_stored, stored
from tirelog.report.page import Card, Figure, Section, packed_array

pytestmark = pytest.mark.xdist_group("model page")  # one worker makes what these tests share


def section(name="effects"):
    figure = Figure(
        "map",
        "Map",
        "A map.",
        [{"type": "heatmap", "z": packed_array([[1.0, 2.0], [3.0, 4.0]])}],
        {"height": 300},
    )
    rung = {"name": "r", "said": "s", "error": 2.0, "floor": 1.0}
    card = Card("Missing", "x is.", [["a", "b"]], "tirelog y", ["z"], [rung])
    return Section(
        name,
        "Effects",
        "tirelog x",
        ["said"],
        [figure],
        [AnswerTable("T", ["a"], [["1"]], [0])],
        folded=False,
        card=card,
        sources=(("wear", "P3"),),
    )


def write(folder, model, *sections):
    page = folder / "models" / model / "page.json"
    page.parent.mkdir(parents=True)
    page.write_text(json.dumps(stored(sections, [("what", "tirelog y")])))
    return page


def test_what_is_read_is_what_was_stored(tmp_path):
    page = write(tmp_path, "beam", section())
    assert read_stored(page) == ([section()], [("what", "tirelog y")])
    assert list(model_pages(tmp_path)) == [([section()], [("what", "tirelog y")])]


def test_several_models_are_told_apart(tmp_path):
    write(tmp_path, "beam", section())
    write(tmp_path, "ring", section())
    (first,), (second,) = (sections for sections, _ in model_pages(tmp_path))
    assert (first.id, second.id) == ("effects-1", "effects-2")
    assert (first.title, second.title) == ("Effects: beam", "Effects: ring")
    assert [one.figures[0].id for one in (first, second)] == ["map-1", "map-2"]


@pytest.mark.parametrize(
    "content",
    [
        "",
        "[]",
        "{}",
        '{"sections": [{}], "missing": []}',
        json.dumps(stored([section('"><b>')], [])),
        json.dumps(stored([section()], [])).replace("2.0, ", '"x", '),
    ],
)
def test_a_file_that_is_none_is_refused(tmp_path, content, capfd):
    page = write(tmp_path, "beam")
    page.write_text(content)
    with pytest.raises(UsageError, match="no page of a campaign's model"):
        read_stored(page)
    (tmp_path / "summary.csv").write_text("log,status\na,done\n")
    assert (
        run(["report", "--campaign", str(tmp_path), "-o", str(tmp_path / "x.html"), "--quiet"]) == 2
    )
    assert "Traceback" not in capfd.readouterr().err
    assert not (tmp_path / "x.html").exists()
