"""Property: a real browser loads the page alone, draws, fits every screen, and prints."""

from contextlib import contextmanager

import pytest

pytestmark = pytest.mark.xdist_group("browser")  # one worker makes what these tests share


@contextmanager
def loaded(browser, page_file):
    """(page, console errors, requests beyond the file itself)."""
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    page = context.new_page()
    problems: list[str] = []
    requests: list[str] = []
    page.on(
        "console", lambda m: problems.append(m.text) if m.type in ("error", "warning") else None
    )
    page.on("pageerror", lambda e: problems.append(str(e)))
    page.on("dialog", lambda d: problems.append(f"dialog {d.message}"))
    page.on(
        "request",
        lambda r: requests.append(r.url) if not r.url.startswith(("data:", "blob:")) else None,
    )
    page.goto(page_file.as_uri())
    page.wait_for_selector("html[data-ready=true]", timeout=240_000)
    yield page, problems, requests
    context.close()


@pytest.fixture
def opened(browser, page_file):
    """A page of its own, for what changes it."""
    with loaded(browser, page_file) as made:
        yield made


@pytest.fixture(scope="module")
def loaded_once(browser, page_file):
    with loaded(browser, page_file) as made:
        yield made


@pytest.fixture
def shown(loaded_once):
    """The page that all share who only look at it."""
    loaded_once[0].set_viewport_size({"width": 1440, "height": 900})
    return loaded_once


def unfold(page):
    """Open what is folded away, as a reader does."""
    page.evaluate("document.querySelectorAll('details').forEach(fold => { fold.open = true; })")


def draw_all(page):
    unfold(page)
    for figure in page.query_selector_all(".plot"):
        figure.scroll_into_view_if_needed()
        page.wait_for_function(
            "e => e.querySelector('.main-svg') !== null", arg=figure, timeout=240_000
        )


def test_it_loads_without_an_error_or_a_request(shown, page_file):
    page, problems, requests = shown
    draw_all(page)
    assert len(page.query_selector_all(".plot")) >= 8
    assert problems == []
    assert requests == [page_file.as_uri()]


def test_a_hostile_name_is_only_text(shown):
    page, problems, _ = shown
    assert "onerror" in page.inner_text("h1")
    assert page.query_selector("h1 img") is None
    assert problems == []


@pytest.mark.parametrize("width", [390, 1440])
def test_nothing_is_wider_than_the_window(shown, width):
    page, _, _ = shown
    page.set_viewport_size({"width": width, "height": 900})
    draw_all(page)
    page.wait_for_function(
        "w => document.documentElement.scrollWidth <= w && "
        "[...document.querySelectorAll('.plot .main-svg')]"
        ".every(e => e.getBoundingClientRect().width <= w)",
        arg=width,
        timeout=240_000,
    )
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    for figure in page.query_selector_all(".plot .main-svg"):
        box = figure.bounding_box()
        assert box is None or box["width"] <= width


def test_print_hides_navigation_and_keeps_the_figures(opened, tmp_path):
    page, problems, _ = opened
    page.emulate_media(media="print")
    assert page.evaluate("getComputedStyle(document.querySelector('nav')).display") == "none"
    page.pdf(path=str(tmp_path / "page.pdf"))
    assert (tmp_path / "page.pdf").read_bytes().startswith(b"%PDF")
    assert problems == []


def test_every_figure_has_a_text_alternative(shown):
    page, _, _ = shown
    unfold(page)
    for figure in page.query_selector_all("figure"):
        described = page.query_selector(f"#{figure.get_attribute('aria-describedby')}")
        assert len(described.inner_text()) > 20


def test_the_keyboard_reaches_the_results(shown):
    page, _, _ = shown
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"


def test_a_dark_screen_has_dark_paper_and_print_is_white_and_no_wider_than_a4(browser, page_file):
    context = browser.new_context(color_scheme="dark", viewport={"width": 1440, "height": 900})
    page = context.new_page()
    page.goto(page_file.as_uri())
    page.wait_for_selector("html[data-ready=true]", timeout=240_000)
    paper, ink = (
        [int(v) for v in page.evaluate(f"getComputedStyle(document.body).{of}")[4:-1].split(",")]
        for of in ("backgroundColor", "color")
    )
    assert max(paper) < 64 < 192 < min(ink)
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    page.wait_for_function(
        "() => document.querySelectorAll('.plot .main-svg').length >= 8", timeout=240_000
    )
    fill = page.evaluate("getComputedStyle(document.querySelector('#speed-0 .xtick text')).fill")
    widths = page.evaluate(
        "[...document.querySelectorAll('.plot .main-svg')].map(s => "
        "s.getBoundingClientRect().width)"
    )
    page.evaluate("window.dispatchEvent(new Event('afterprint'))")
    assert page.query_selector("details[open]") is None
    unfold(page)
    page.wait_for_function(
        "() => document.querySelector('#speed-0 .main-svg').getBoundingClientRect().width > 700",
        timeout=240_000,
    )
    after = page.evaluate("getComputedStyle(document.querySelector('#speed-0 .xtick text')).fill")
    context.close()
    assert fill == "rgb(0, 0, 0)"
    assert max(widths) <= 680
    assert after == "rgb(232, 232, 232)"
