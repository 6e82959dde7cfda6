"""Property: with a model the page says where it fails, what is missing, how the ladder fell; the
switches change figures and numbers.
"""

import json
import re
import time
from collections.abc import Callable
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
        ("switches", "report"),
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


def test_every_combination_of_effects_has_its_state(model_page: Path) -> None:
    switches = data(model_page)["switches"]["switches"]
    count = len(switches["effects"])
    assert count >= 2
    assert sorted(int(mask) for mask in switches["states"]) == list(range(2**count))
    assert len({state["text"] for state in switches["states"].values()}) == 2**count
    held = {
        int(m): numbers(s["figures"]["switch-error"]["0"]["y"])[1]
        for m, s in switches["states"].items()
    }
    bit = 1 << switches["effects"].index("water_film")
    assert all(held[mask] < 0.5 * held[mask & ~bit] for mask in held if mask & bit)


def test_switches_change_figures_and_numbers(opened: Any) -> None:
    page, problems = opened
    for name in ("switch-waves", "switch-map", "switch-error"):
        figure = page.query_selector(f"#{name}")
        figure.scroll_into_view_if_needed()
        page.wait_for_function(
            "e => e.querySelector('.main-svg') !== null", arg=figure, timeout=240_000
        )

    def state() -> tuple[str, float, float, float]:
        """The text; height of the highest bar on the screen [px], size of the first wave and of the
        map as drawn.
        """
        bars = (
            "Math.max(...[...document.querySelectorAll('#switch-error .barlayer path')].map(p => "
            "p.getBoundingClientRect().height))"
        )
        wave = (
            "document.getElementById('switch-waves').calcdata[0].reduce((sum, p) => sum + "
            "Math.abs(p.y), 0)"
        )
        residual = (
            "Math.max(...document.getElementById('switch-map').calcdata[0][0].z.map(row => "
            "Math.max(...row.map(v => Math.abs(v) || 0))))"
        )
        return (
            page.inner_text(".switches output"),
            *(float(page.evaluate(code)) for code in (bars, wave, residual)),
        )

    def state_once(drawn: Callable[[tuple[str, float, float, float]], bool]) -> Any:
        """The state once it is as wanted, or after four minutes whatever it is."""
        end = time.monotonic() + 240.0
        while not drawn(found := state()) and time.monotonic() < end:
            page.wait_for_timeout(50)
        return found

    before = state()
    page.get_by_role("checkbox", name="water_film").click()
    without = state_once(
        lambda now: (
            now[0] != before[0]
            and now[1] > 2 * before[1]
            and now[2] != before[2]
            and now[3] > 2 * before[3]
        )
    )
    assert without[0] != before[0]
    assert re.search(r"held-out error [\d.]+ microstrain", without[0])
    assert without[1] > 2 * before[1]
    assert without[2] != before[2]
    assert without[3] > 2 * before[3]
    page.get_by_role("checkbox", name="water_film").focus()
    page.keyboard.press("Space")
    again = state_once(
        lambda now: (
            (now[0], now[2], now[3]) == (before[0], before[2], before[3])
            and abs(now[1] - before[1]) <= 0.01
        )
    )
    assert (again[0], again[2], again[3]) == (before[0], before[2], before[3])
    # where a bar lies on the screen is rounded by the browser (6e-5 px seen after scrolling)
    assert again[1] == pytest.approx(before[1], abs=0.01)
    assert problems == []


def test_on_a_phone_in_the_dark_every_figure_has_a_name_and_its_width(
    browser: Any, model_page: Path
) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 900}, color_scheme="dark")
    page = context.new_page()
    page.goto(f"{model_page.as_uri()}#ladder")
    page.wait_for_selector("html[data-ready=true]", timeout=240_000)
    assert page.evaluate("[...document.querySelectorAll('details[open]')].length") == 1
    some = ["ladder-steps", "answer-waves", "answer-map-1", "answer-effect-0", "switch-map"]
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


def test_pictures_for_slides(model_page: Path, tmp_path: Path) -> None:
    folder = model_page.parent
    logs = [str(folder / f"hidden_{n}.csv.gz") for n in (1, 2)]
    shown = tmp_path / "slides"
    command = [
        "report",
        *logs,
        "--ladder",
        str(folder / "M.ladder.json"),
        "--format",
        "png",
        "--figures",
        str(shown),
        "--quiet",
    ]
    assert run(command) == 0
    figures = data(model_page)["figures"]
    expected = {
        f"{name}.png"
        for name in figures
        if name.split("-")[0]
        not in ("answer", "switch", "waveforms", "differences", "residual", "ranking")
    }
    assert {p.name for p in shown.iterdir()} == expected
    assert all(
        p.read_bytes().startswith(b"\x89PNG") and p.stat().st_size > 5000 for p in shown.iterdir()
    )
