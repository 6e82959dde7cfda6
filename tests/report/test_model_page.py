"""Property: numbers on a model's page are the commands'; hostile names are only text."""

import html
import json
import re
import shlex

import pytest

from tests.cli.conftest import tirelog as command
from tests.report.test_browser import unfold
from tests.report.test_page import data, numbers
from tirelog.cli import run
from tirelog.diagnosis.answer import AnswerTable
from tirelog.errors import UsageError
from tirelog.report.build import model_pages, read_stored, stored
from tirelog.report.page import Card, Figure, Section, packed_array

pytestmark = pytest.mark.xdist_group("model page")  # one worker makes what these tests share


def test_on_a_phone_in_the_dark_every_figure_has_a_name_and_its_width(browser, model_page):
    context = browser.new_context(viewport={"width": 390, "height": 900}, color_scheme="dark")
    page = context.new_page()
    page.goto(f"{model_page.as_uri()}#ladder")
    page.wait_for_selector("html[data-ready=true]", timeout=240_000)
    assert page.evaluate("[...document.querySelectorAll('details[open]')].length") == 1
    some = ["ladder-steps", "answer-left-2", "answer-left-1"]
    for name in some:
        figure = page.query_selector(f"#{name}")
        figure.scroll_into_view_if_needed()
        page.wait_for_function(
            "e => e.querySelector('svg[role=img]') !== null", arg=figure, timeout=240_000
        )
    drawn = page.evaluate(
        """names => names.map(name => {
            const place = document.getElementById(name);
            return {
                name: place.querySelector('svg[role=img]').getAttribute('aria-label'),
                title: document.getElementById(name + '-title').textContent,
                named: [...place.querySelectorAll('svg')].every(svg =>
                    svg.closest('[role=img], [aria-hidden=true]')),
                focus: place.querySelectorAll('svg [tabindex], svg a[href]').length,
                width: place.querySelector('.main-svg').getBoundingClientRect().width,
            };
        })""",
        some,
    )
    for figure in drawn:
        assert figure["name"] == figure["title"] != ""
        assert figure["named"]
        assert figure["focus"] == 0
        assert figure["width"] <= 390
    line = "#answer-left-2 .scatterlayer .js-line"
    stroke = page.evaluate(f"getComputedStyle(document.querySelector('{line}')).stroke")
    assert stroke == "rgb(255, 158, 74)"  # the first model's orange on dark paper
    unfold(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.keyboard.press("Tab")
    page.evaluate("document.querySelector('summary').focus()")
    page.keyboard.press("Shift+Tab")
    page.keyboard.press("Tab")
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    context.close()


__all__ = ["command"]


def said(page, section):
    """The text of a section of the page, and the command that it is made with."""
    found = re.search(rf'<section id="{section}".*?</section>', page.read_text(), re.S)
    assert found
    made = re.search(r"Made with <code>(.*?)</code>", found[0])
    assert made
    text = re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", " ", found[0])))
    return text, shlex.split(html.unescape(made[1]))[1:]


def answer(command, words):
    """What a command that the page prints gives."""
    outcome = command(*words, "--format", "json").ended(0)
    return dict(json.loads(outcome.out))


def test_the_comparison_is_the_command_s(model_page, command):
    text, words = said(model_page, "model")
    found = answer(command, words)
    beside = found["with_nuisances"]
    for errors in (found, beside):
        held, fitted, floor = (
            f"{1e6 * errors[name]:.3g}" for name in ("rmse_heldout", "rmse", "noise_floor")
        )
        assert (
            f"held out {held} microstrain, fit {fitted}, noise floor {floor}, reduced chi-square "
            f"{errors['reduced_chi2']:.3g}"
        ) in text
    assert f"held-out error {1e6 * found['rmse_heldout']:.3g}, noise floor" in text
    for name, parameter in found["parameters"].items():
        assert f"{name} {parameter['value']:.4g}" in text


def test_the_diagnosis_is_the_command_s(model_page, command):
    text, words = said(model_page, "diagnosis")
    found = answer(command, words)
    names = ("rmse_heldout_before", "rmse_heldout_after")
    before, after = (f"{1e6 * found[name]:.3g}" for name in names)
    assert f"Held-out error {before} -> {after} microstrain" in text
    assert found["sentence"] in text
    assert f"Next: {found['next_command']}" in text
    card, _ = said(model_page, "answer")
    assert f"your model {before} microstrain" in card
    assert f"{after} microstrain" in card
    ranked = data(model_page)["figures"]["ranking"]["traces"]
    drawn = {name: x for t in ranked for name, x in zip(t["y"], numbers(t["x"]), strict=True)}
    shares = {c["effect"]: 100 * c["excess_removed"] for c in found["effects"]}
    assert drawn == pytest.approx(shares, rel=1e-3, abs=1e-2)


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
