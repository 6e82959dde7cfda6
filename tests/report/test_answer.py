"""Property: the page opens with the answer, its numbers are the commands', a log has one colour,
and the page is accessible by its text alone.
"""

import html
import json
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.diagnosis.planted import MODEL, ringing, stack
from tests.report.test_page import data, numbers
from tirelog.inference.measured import MeasuredLogs
from tirelog.physics.effects import BY_ID
from tirelog.report.build import model_story
from tirelog.report.page import (
    COLOURS,
    DARK_COLOURS,
    DARK_NEUTRALS,
    GREY,
    INK,
    PALE,
    PAPERS,
    ReportRequest,
)
from tirelog.report.sections import models

pytestmark = pytest.mark.xdist_group("model page")  # one worker makes what these tests share

ROOT = Path(__file__).parents[2]
#: elements without an end
_VOID = {"meta", "link", "br", "hr", "img", "input", "col", "wbr"}


class Tree(HTMLParser):
    """Every element of a page: (tag, attributes, tags that it is in)."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None], tuple[str, ...]]] = []
        self._open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs), tuple(self._open)))
        if tag not in _VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def of(self, *tags: str) -> list[dict[str, str | None]]:
        return [attributes for tag, attributes, _ in self.elements if tag in tags]


def markup(page: Path) -> str:
    """The page without its scripts."""
    return re.sub(r"<script.*?</script>", "", page.read_text(), flags=re.S)


def part(page: Path, section: str) -> str:
    found = re.search(rf'<section id="{section}"[^>]*>(.*?)</section>', markup(page), re.S)
    assert found
    return found[1]


def words(text: str) -> str:
    return html.unescape(re.sub(r"<[^>]+>", " ", text))


# ---- the answer ----------------------------------------------------------------------------------


def test_the_answer_comes_first_with_verdict_evidence_and_next_command(model_page: Path) -> None:
    sections = re.findall(r'<section id="([\w-]+)"', markup(model_page))
    assert sections[0] == "answer"
    text = words(part(model_page, "answer"))
    assert "Missing: hydrodynamic wedge ahead of the entry edge (water_film)" in text
    assert re.search(r"\d+ revolutions in \d+ manoeuvres, [\d.]+ to [\d.]+ m/s", text)
    assert "load 3434 to 3800 N; inflation pressure 220 kPa" in text
    assert re.search(
        r"water_film removes [\d.]+ % ± .*chance alone does so with p <?= [\d.e-]+", text
    )
    assert re.search(
        r"How sure\s+(\d+ of \d+ simulated cases of this kind|How often such a verdict)", text
    )
    assert re.search(r"tirelog model add '.+' water_film -o '.+' && tirelog model fit '", text)
    assert re.search(
        r"Made on 20\d\d-\d\d-\d\d \d\d:\d\d UTC by tirelog", words(markup(model_page))
    )


def test_the_rungs_are_the_diagnosis_s_and_the_steps_the_ladder_s(model_page: Path) -> None:
    rungs = re.findall(r"<li>(.*?)</li>", part(model_page, "answer"), re.S)
    said = re.search(r"Held-out error ([\d.]+) -> ([\d.]+) ", words(part(model_page, "diagnosis")))
    assert said
    assert [f"{error} microstrain" in words(rung) for rung, error in zip(rungs, said.groups())]
    lengths = [float(width) for width in re.findall(r"width:([\d.]+)%", "".join(rungs))]
    errors = np.array([float(error) for error in said.groups()])
    np.testing.assert_allclose(lengths, 100.0 * errors / errors.max(), rtol=0.01)
    assert words(rungs[1]).split("hydrodynamic wedge")[0].split() == ["+", "water_film"]
    climbed = json.loads((model_page.parent / "ladder.json").read_text())
    taken = [s for s in climbed["steps"] if s["outcome"] != "not_added"]
    drawn = data(model_page)["figures"]["ladder-steps"]["traces"]
    assert drawn[0]["x"] == [step["effect"] for step in taken]
    for trace, name in ((drawn[0], "rmse_heldout"), (drawn[2], "noise_floor")):
        expected = [1e6 * step[name] for step in taken]
        np.testing.assert_allclose(numbers(trace["y"]), expected, rtol=1e-6)
    for section, command in (("model", "compare"), ("ladder", "ladder")):
        made = f"Made with <code>tirelog {command} .*--model"
        assert re.search(made, part(model_page, section))


def test_where_it_fails_is_where_its_map_is_largest(model_page: Path) -> None:
    figures, text = data(model_page)["figures"], words(part(model_page, "answer"))
    drawn = figures["answer-left-0"]["traces"][0]
    angle = numbers(drawn["x"])
    size = np.sqrt(np.mean(numbers(drawn["z"]).reshape(-1, angle.size) ** 2, axis=0))
    said = re.search(r"fails most ([a-z ]+) \(([\d.]+) microstrain\), then", text)
    assert said
    assert float(said[2]) == pytest.approx(size.max(), rel=0.01)
    assert said[1] == ("ahead of the entry edge" if angle[size.argmax()] < -11.2 else "elsewhere")


def test_before_and_after_are_drawn_at_one_scale(model_page: Path) -> None:
    figures = data(model_page)["figures"]
    before, after = (figures[f"answer-left-{i}"]["traces"][0] for i in (0, 1))
    assert (before["zmin"], before["zmax"]) == (after["zmin"], after["zmax"])
    sizes = [np.sqrt(np.nanmean(numbers(one["z"]) ** 2)) for one in (before, after)]
    assert sizes[1] < 0.5 * sizes[0]
    assert np.nanmax(np.abs(numbers(before["z"]))) <= 2.0 * before["zmax"]
    for trace, size in zip(figures["answer-left-2"]["traces"], sizes, strict=True):
        rms = np.sqrt(np.mean(numbers(trace["y"]) ** 2))
        assert rms == pytest.approx(size, rel=0.05), trace["name"]
    assert len(figures["answer-left-2"]["layout"]["shapes"]) == 3  # the edges and the floor


def test_everything_but_the_answer_is_folded(model_page: Path) -> None:
    for tag, attributes, within in Tree(markup(model_page)).elements:
        if attributes.get("class") == "plot":
            unfolded = str(attributes["id"]).startswith("answer-")
            assert ("details" in within) is not unfolded, attributes["id"]
        if tag == "details":
            assert "open" not in attributes


def test_a_page_without_a_model_opens_with_what_was_measured(page_file: Path) -> None:
    text = words(part(page_file, "answer"))
    assert "No model was compared with these logs" in text
    assert re.search(r"Speed [\d.]+ to [\d.]+ m/s", text)
    assert re.search(r"Contact length [\d.]+ to [\d.]+ mm; \d+ passages without a mark", text)
    assert "tirelog model new --carcass beam" in text
    figures = data(page_file)["figures"]
    assert {"answer-speed-0", "answer-passage-0"} <= set(figures)


def colours_by_log(page: Path) -> dict[str, set[str]]:
    found: dict[str, set[str]] = {"hidden_1": set(), "hidden_2": set()}
    for figure in data(page)["figures"].values():
        for trace in figure["traces"]:
            style = trace.get("marker", trace.get("line", {}))
            said = [log for log in found if log in html.unescape(trace.get("name", ""))]
            alone = [log for log in found if log in figure["title"]]
            for log in said or (alone if "answer" not in figure["title"] else []):
                colour = str(style.get("color"))
                if colour in COLOURS:
                    found[log].add(colour)
    return found


def test_a_log_has_one_colour_throughout(model_page: Path) -> None:
    assert colours_by_log(model_page) == {"hidden_1": {COLOURS[0]}, "hidden_2": {COLOURS[1]}}
    rows = re.findall(r'background:var\(--c(\d)\)"></span>(\S+?)</th>', markup(model_page))
    assert rows == [("0", "hidden_1.csv.gz"), ("1", "hidden_2.csv.gz")]


def test_papers_are_on_the_page_as_in_the_errata(model_page: Path) -> None:
    text, about = (ROOT / "docs" / "errata.md").read_text("utf-8"), words(part(model_page, "about"))
    for name, paper in PAPERS.items():
        assert f"{name}: {paper}" in about
        there = re.search(rf"\* \*\*{name}\*\*: (.*?)\n(?=\*|\n)", text, re.S)
        assert there
        assert [word for word in re.findall(r"\w{4,}", paper) if word not in there[1]] == []


# ---- a page that everybody can read --------------------------------------------------------------


@pytest.fixture(params=["page_file", "model_page"])
def tree(request: pytest.FixtureRequest) -> Tree:
    return Tree(markup(request.getfixturevalue(request.param)))


def test_headings_and_landmarks_are_in_order(tree: Tree) -> None:
    levels = [int(tag[1]) for tag, _, _ in tree.elements if re.fullmatch(r"h\d", tag)]
    assert levels.count(1) == 1
    assert levels[0] == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    order = [tag for tag, _, _ in tree.elements if tag in ("header", "nav", "main")]
    assert order == ["header", "nav", "main"]
    (nav,) = tree.of("nav")
    assert nav["aria-label"]
    (page,) = tree.of("html")
    assert page["lang"] == "en"
    within = [ways for tag, _, ways in tree.elements if tag == "section"]
    assert within
    assert all("main" in ways for ways in within)


def test_what_names_or_describes_is_there_and_ids_are_used_once(tree: Tree) -> None:
    ids = [attributes["id"] for _, attributes, _ in tree.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    figures = tree.of("figure")
    assert len(figures) >= 8
    for figure in figures:
        assert figure["aria-labelledby"] in ids
        assert figure["aria-describedby"] in ids
    for link in tree.of("a"):
        assert str(link["href"])[1:] in ids
    for _, attributes, _ in tree.elements:
        assert not [name for name in attributes if name.startswith("on")]


def test_every_axis_has_a_unit(page_file: Path) -> None:
    for name, figure in data(page_file)["figures"].items():
        for axis in ("xaxis", "yaxis"):
            assert "[" in figure["layout"][axis]["title"]["text"], name


def test_tables_have_scopes_and_names_and_folds_a_summary(tree: Tree) -> None:
    assert len(tree.of("table")) == len(tree.of("caption")) > 3
    assert {th["scope"] for th in tree.of("th")} == {"row", "col"}
    assert len(tree.of("details")) == len(tree.of("summary")) > 3
    scrolled = [d for d in tree.of("div") if d.get("class") == "table"]
    assert all(d["tabindex"] == "0" and d["aria-label"] for d in scrolled)
    for tag, _, within in tree.elements:  # nothing that takes a click in what takes one
        assert not (tag in ("a", "button", "input", "details") and "summary" in within)


def luminance(colour: str) -> float:
    values = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def palettes(page: Path) -> Iterator[dict[str, str]]:
    """The style's variables on light and on dark paper."""
    found = re.findall(r":root \{(.*?)\}", markup(page))
    each = [dict(re.findall(r"--(\w+): (#[0-9a-fA-F]{6})", text)) for text in found]
    for paper, colour in (("#ffffff", COLOURS[0]), ("#14171a", DARK_COLOURS[0])):
        named = next(one for one in each if one.get("paper") == paper)
        yield named | next(one for one in each if one.get("c0") == colour)


def test_text_has_contrast_in_both_themes_and_graphics_too(page_file: Path) -> None:
    light, dark = palettes(page_file)
    neutrals = ((INK, GREY, PALE), DARK_NEUTRALS)
    for palette, aside in zip((light, dark), neutrals, strict=True):
        for ground in ("paper", "panel"):
            for text in ("ink", "quiet", "accent"):
                assert contrast(palette[text], palette[ground]) >= 4.5, (text, ground)
            drawn = [palette[f"c{i}"] for i in range(len(COLOURS))] + [*aside, palette["bar"]]
            assert min(contrast(colour, palette[ground]) for colour in drawn) >= 3.0
        assert contrast(palette["bar"], palette["rail"]) >= 3.0


def test_every_colour_of_a_trace_has_one_for_dark_paper(model_page: Path) -> None:
    content = data(model_page)
    known = {colour.lower() for colour in content["dark"]}
    for name, figure in content["figures"].items():
        for trace in figure["traces"]:
            for style in (trace.get("marker", {}), trace.get("line", {})):
                colour = style.get("color")
                assert colour is None or colour.lower() in known, name


# ---- what is proposed, and obstacles -------------------------------------------------------------


def test_what_is_unknown_is_named_with_the_command_that_writes_it_down(monkeypatch):
    log = SimpleNamespace(log="made", hits_s=np.ones(2), road=SimpleNamespace(kind="cleat"))
    measured = MeasuredLogs([stack(ringing, manoeuvres=9, revolutions=4, m=64)], (log,))
    monkeypatch.setattr("tirelog.report.build.measured_for", lambda *_, **__: measured)
    asked = ReportRequest(("made",), model=Path("M.toml"), setup=Path("s.toml"))
    (answer, *sections), missing = model_story([], MODEL, None, asked, lambda _: None)
    assert answer.card is not None
    assert answer.card.word == "Unknown effect"
    assert answer.card.command.startswith("tirelog propose made --model ")
    assert answer.card.command.endswith("--setup s.toml")
    assert [figure.id for figure in answer.figures] == ["answer-left-0", "answer-left-1"]
    assert [section.id for section in sections] == ["diagnosis", "model"]
    offered = [command for what, command in missing if "written down" in what]
    assert offered == [answer.card.command]
    (obstacles,) = (what for what, _ in missing if "obstacle" in what)
    assert obstacles.startswith("2 hits on an obstacle: a beam says nothing of them")
    assert 'carcass = "coupled_ring" does' in obstacles


def test_a_disturbance_that_came_in_is_a_rung_of_its_own() -> None:
    def one(error: float) -> SimpleNamespace:
        return SimpleNamespace(rmse=1.0, rmse_heldout=error, noise_floor=1e-6)

    search = SimpleNamespace(came_in=("wheel",))
    found = SimpleNamespace(
        found=search, before=one(4e-6), after=one(2e-6), selected=("water_film",)
    )
    rungs = models._rungs(one(9e-6), found, BY_ID, 1e6)
    assert [(rung["name"], round(rung["error"], 9)) for rung in rungs] == [
        ("your model", 9.0), ("+ wheel", 4.0), ("+ water_film", 2.0),
    ]  # fmt: skip
    assert rungs[1]["said"] == "the wheel's own run-out and force variation"


def test_options_of_the_page_are_in_its_commands() -> None:
    asked = ReportRequest(("a.csv",), Path("s.toml"), Path("m.toml"), channel="c 1")
    assert asked.report_command().endswith("--channel 'c 1' -o report.html")
    line = asked.with_options("tirelog propose a.csv --model m.toml")
    assert line == "tirelog propose a.csv --model m.toml --setup s.toml --channel 'c 1'"
    assert ReportRequest(("a.csv",)).with_options("tirelog x") == "tirelog x"
