"""Golden: the notebook runs and shows what its cells give; its page of the site is made of it."""

import re
import runpy
from pathlib import Path

import pytest

pytestmark = pytest.mark.xdist_group("notebook")  # one worker runs it

ROOT = Path(__file__).parents[2]
TOOL = runpy.run_path(str(ROOT / "docs" / "notebook" / "run.py"))
NOTEBOOK = TOOL["read"]()
CODE = [cell for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]
RUN = [cell for cell in CODE if not TOOL["stored"](cell)]
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@pytest.fixture(scope="module")
def session():
    """Outputs of the cells, and the names that they made."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MPLBACKEND", "Agg")
        outputs, names = TOOL["run"](RUN)
    return outputs, names


def text_of(output):
    """What an output says, without the tags of its HTML."""
    data = output.get("data", {"text/plain": output.get("text", ())})
    return re.sub(r"<[^>]*>", " ", "".join(data.get("text/html", data["text/plain"])))


def test_it_tells_the_whole_story_and_runs_most_of_it():
    source = "".join(line for cell in CODE for line in cell["source"])
    for name in ("open_log", "footprint", "measure", "compare", "diagnose", "propose"):
        assert f"tirelog.{name}(" in source
    assert [bool(TOOL["stored"](cell)) for cell in CODE].count(True) == 2
    assert "tirelog.diagnose(" in "".join(line for cell in RUN for line in cell["source"])


@pytest.mark.slow
def test_the_cells_give_what_is_stored(session):
    for cell, made in zip(RUN, session[0], strict=True):
        stored = cell["outputs"]
        assert [o["output_type"] for o in made] == [o["output_type"] for o in stored], cell["id"]
        assert [set(o.get("data", ())) for o in made] == [set(o.get("data", ())) for o in stored]
        for now, then in zip(map(text_of, made), map(text_of, stored), strict=True):
            assert NUMBER.sub("0", now).split() == NUMBER.sub("0", then).split(), cell["id"]
            numbers = [float(n) for n in NUMBER.findall(then)]
            assert [float(n) for n in NUMBER.findall(now)] == pytest.approx(numbers, rel=0.02)


@pytest.mark.slow
def test_what_it_finds_is_the_truth_of_its_logs(session):
    names = session[1]
    assert names["found"].selected == ("water_film",)
    json = names["found"].to_json()
    assert json["rmse_heldout_before"] == pytest.approx(names["before"].rmse_heldout)
    assert names["after"].excess_heldout < 0.1 * names["before"].excess_heldout


def test_what_is_not_run_is_what_the_page_of_the_command_shows():
    shown = (ROOT / "docs" / "missing_effect.md").read_text(encoding="utf-8")
    cell = next(cell for cell in CODE if "tirelog.propose(" in "".join(cell["source"]))
    said = text_of(cell["outputs"][0]).replace("&gt;", ">")
    sentence = said[said.index("Proposed:") : said.index("microstrain at a floor") + 30].strip()
    assert sentence[:-1] in shown


def test_its_page_and_pictures_are_made_of_it():
    page, pictures = TOOL["page"](NOTEBOOK)
    assert (ROOT / "docs" / "notebook" / "first_hour.md").read_text(encoding="utf-8") == page, (
        "run: make outputs"
    )
    assert len(pictures) == 5
    for name, picture in pictures.items():
        assert (ROOT / "docs" / "pictures" / name).read_bytes() == picture
