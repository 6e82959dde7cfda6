"""Property: with a model the page can be read on a phone, and hostile names are only text."""

import pytest

from tests.report.test_browser import loaded, unfold

pytestmark = pytest.mark.xdist_group("model page")  # one worker makes what these tests share


def test_on_a_phone_in_the_dark_every_figure_has_a_name_and_its_width(browser, model_page):
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
    unfold(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.keyboard.press("Tab")
    page.evaluate("document.querySelector('summary').focus()")
    page.keyboard.press("Shift+Tab")
    page.keyboard.press("Tab")
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    context.close()


def test_hostile_folder_names_are_only_text(browser, model_page):
    with loaded(browser, model_page) as (page, problems, _):
        assert page.query_selector("main b, .plot svg a, header b") is None
        assert "a <b>&amp; b" in page.text_content("#about")
        assert problems == []
