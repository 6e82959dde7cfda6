"""A page from a small log, and a browser to look at it with."""

import gzip
import os
import shutil
from importlib import import_module
from itertools import islice
from pathlib import Path

import pytest

from tests.cli.conftest import SETUP, pulse_rows
from tests.cli.conftest import folder as folder
from tests.cli.conftest import tirelog as tirelog
from tirelog.cli import run

SAMPLES = Path(__file__).parents[2] / "sample_data"
#: lines of a sample log of 40 s, of which its half is 50,000
_LINES = 50_000
HOSTILE = "<img src=x onerror=alert(1)>"


@pytest.fixture(scope="session")
def page_file(tmp_path_factory):
    """A page of a log whose tire has a hostile name."""
    folder = tmp_path_factory.mktemp("report")
    (folder / "log.csv").write_text("time_s,CH1,CH2\n" + "\n".join(pulse_rows()) + "\n")
    (folder / "log.toml").write_text(SETUP.replace('"test"', f"'{HOSTILE}'"))
    outputs = {name: f"{name}.csv" for name in ("speed", "footprint", "dissipation")}
    for command, output in (outputs | {"report": "page.html"}).items():
        assert run([command, str(folder / "log.csv"), "-o", str(folder / output), "--quiet"]) == 0
    return folder / "page.html"


@pytest.fixture(scope="session")
def browser():
    """Headless Chromium; required where CI says so, else skipped with a reason."""
    names = ("chromium", "chromium-browser", "google-chrome")
    path = next(filter(None, map(shutil.which, names)), None)
    required = bool(os.environ.get("TIRELOG_REQUIRE_BROWSER"))
    if path is None and not required:
        pytest.skip("no Chromium on this machine")
    name = "playwright.sync_api"
    sync_api = import_module(name) if required else pytest.importorskip(name)
    assert path is not None
    off = ("gpu", "quic", "background-networking", "sync")
    flags = ["--no-sandbox", "--no-first-run", *(f"--disable-{what}" for what in off)]
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=flags, timeout=240_000)
        yield browser
        browser.close()


def _first_lines(log: Path, folder: Path) -> None:
    """The log's begin: as many manoeuvres as ladder and verdict need."""
    with gzip.open(log) as whole, gzip.open(folder / log.name, "wb", compresslevel=1) as part:
        part.writelines(islice(whole, _LINES))


@pytest.fixture(scope="session")
def model_page(tmp_path_factory):
    """A page of two logs, their model and ladder, in a folder with a hostile name."""
    folder = tmp_path_factory.mktemp("model") / "a <b>&amp; b"
    folder.mkdir()
    logs = []
    for name in ("hidden_1", "hidden_2"):
        shutil.copy(SAMPLES / f"{name}.toml", folder)
        _first_lines(SAMPLES / f"{name}.csv.gz", folder)
        logs.append(str(folder / f"{name}.csv.gz"))
    plain, model, page, climbed = (
        str(folder / name) for name in ("plain.toml", "M.toml", "page.html", "ladder.json")
    )
    with_model = [*logs, "--model", model, "--quiet", "-o"]
    for words in (
        ["model", "new", "--setup", str(folder / "hidden_1.toml"), "-o", plain],
        ["model", "add", plain, "viscous_damping", "-o", model],
        ["ladder", *with_model, climbed],
        ["report", *with_model, page, "--ladder", climbed],
    ):
        assert run(words) == 0
    return Path(page)
