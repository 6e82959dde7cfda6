"""Property: with a model the page says where it fails, what is missing, how the ladder fell."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.report.test_page import data, numbers
from tirelog.cli import run

pytestmark = pytest.mark.xdist_group("model page")  # one worker makes what these tests share


@pytest.fixture(scope="module")
def opened(browser: Any, model_page: Path) -> Any:
    """(page, what went wrong)."""
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    page = context.new_page()
    problems: list[str] = []
    page.on(
        "console", lambda m: problems.append(m.text) if m.type in ("error", "warning") else None
    )
    page.on("pageerror", lambda e: problems.append(str(e)))
    page.goto(model_page.as_uri())
    page.wait_for_selector("html[data-ready=true]", timeout=240_000)
    yield page, problems
    context.close()


def test_sections_and_their_commands(model_page: Path) -> None:
    text = model_page.read_text()
    for section, command in (
        ("model", "compare"),
        ("diagnosis", "diagnose"),
        ("ladder", "ladder"),
    ):
        part = re.search(rf'<section id="{section}">(.*?)</section>', text, re.S)
        assert part
        assert re.search(rf"Made with <code>tirelog {command} .*--model", part[1])


def test_the_ladder_s_numbers_are_the_file_s(model_page: Path) -> None:
    steps = json.loads((model_page.parent / "M.ladder.json").read_text())["ladders"][-1]["steps"]
    climbed = [s for s in steps if s["outcome"] != "not_added"]
    drawn = data(model_page)["figures"]["ladder-steps"]["traces"]
    assert drawn[0]["x"] == [s["effect"] for s in climbed]
    np.testing.assert_allclose(
        numbers(drawn[0]["y"]), [s["rmse_heldout"] * 1e6 for s in climbed], rtol=1e-6
    )
    np.testing.assert_allclose(
        numbers(drawn[2]["y"]), [s["noise_floor"] * 1e6 for s in climbed], rtol=1e-6
    )


@pytest.mark.slow
def test_the_page_s_diagnosis_is_the_command_s(model_page: Path) -> None:
    folder = model_page.parent
    logs = [str(folder / f"hidden_{n}.csv.gz") for n in (1, 2)]
    assert (
        run(
            [
                "diagnose",
                *logs,
                "--model",
                str(folder / "M.toml"),
                "-o",
                str(folder / "diagnosis.json"),
                "--quiet",
            ]
        )
        == 0
    )
    said = json.loads((folder / "diagnosis.json").read_text())
    assert said["sentence"].replace("&", "&amp;") in model_page.read_text()
    shares = {c["effect"]: 100 * c["excess_removed"] for c in said["effects"]}
    drawn = {}
    for trace in data(model_page)["figures"]["ranking"]["traces"]:
        drawn |= dict(zip(trace["y"], numbers(trace["x"]).tolist(), strict=True))
    assert drawn == pytest.approx(shares, rel=1e-3, abs=1e-2)


def test_on_a_phone_in_the_dark_every_figure_has_a_name_and_its_width(
    browser: Any, model_page: Path
) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 900}, color_scheme="dark")
    page = context.new_page()
    page.goto(f"{model_page.as_uri()}#ladder")
    page.wait_for_selector("html[data-ready=true]", timeout=240_000)
    assert page.evaluate("[...document.querySelectorAll('details[open]')].length") == 1
    some = ["ladder-steps", "answer-waves", "answer-map-1", "answer-effect-0"]
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
    line = "#answer-waves .scatterlayer .js-line"
    stroke = page.evaluate(f"getComputedStyle(document.querySelector('{line}')).stroke")
    assert stroke == "rgb(185, 194, 202)"  # the first model's grey on dark paper
    page.evaluate("document.querySelectorAll('details').forEach(fold => { fold.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.keyboard.press("Tab")
    page.evaluate("document.querySelector('summary').focus()")
    page.keyboard.press("Shift+Tab")
    page.keyboard.press("Tab")
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    context.close()


def test_hostile_folder_names_are_only_text(opened: Any) -> None:
    page, problems = opened
    assert page.query_selector("main b, .plot svg a, header b") is None
    assert "a <b>&amp; b" in page.text_content("#about")
    assert problems == []
