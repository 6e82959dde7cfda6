"""A page from a small log, and a browser to look at it with."""

import gzip
import os
import shutil
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from tests.cli.conftest import SETUP, pulse_rows
from tirelog.cli import run

SAMPLES = Path(__file__).parents[2] / "sample_data"
#: lines of a sample log of 40 s, of which its half is 50,000
_LINES = 50_000
HOSTILE = "<img src=x onerror=alert(1)>"


@pytest.fixture(scope="session")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page of a log whose tire has a hostile name."""
    folder = tmp_path_factory.mktemp("report")
    (folder / "log.csv").write_text("time_s,CH1,CH2\n" + "\n".join(pulse_rows()) + "\n")
    (folder / "log.toml").write_text(SETUP.replace('"test"', f"'{HOSTILE}'"))
    for table in ("speed", "footprint", "dissipation"):
        assert (
            run([table, str(folder / "log.csv"), "-o", str(folder / f"{table}.csv"), "--quiet"])
            == 0
        )
    assert run(["report", str(folder / "log.csv"), "-o", str(folder / "page.html"), "--quiet"]) == 0
    return folder / "page.html"


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Headless Chromium; required where CI says so, else skipped with a reason."""
    path = (
        shutil.which("chromium")
        or shutil.which("chromium-browser")
        or shutil.which("google-chrome")
    )
    required = bool(os.environ.get("TIRELOG_REQUIRE_BROWSER"))
    if path is None and not required:
        pytest.skip("no Chromium on this machine")
    sync_api = (
        pytest.importorskip("playwright.sync_api")
        if not required
        else __import__("playwright.sync_api", fromlist=["sync_playwright"])
    )
    assert path is not None
    flags = [
        "--no-sandbox",
        "--disable-gpu",
        "--disable-quic",
        "--no-first-run",
        "--disable-background-networking",
        "--disable-sync",
    ]
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=flags, timeout=240_000)
        yield browser
        browser.close()


def _first_lines(log: Path, folder: Path) -> None:
    """The log's begin: as many manoeuvres as ladder and verdict need."""
    with gzip.open(log) as whole, gzip.open(folder / log.name, "wb", compresslevel=1) as part:
        part.writelines(islice(whole, _LINES))


@pytest.fixture(scope="session")
def model_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page of two logs that lack an effect, a model of one effect, and the ladder climbed on
    them, in a folder with a hostile name.
    """
    folder = tmp_path_factory.mktemp("model") / "a <b>&amp; b"
    folder.mkdir()
    logs = []
    for name in ("hidden_1", "hidden_2"):
        shutil.copy(SAMPLES / f"{name}.toml", folder)
        _first_lines(SAMPLES / f"{name}.csv.gz", folder)
        logs.append(str(folder / f"{name}.csv.gz"))
    plain, model, page = (str(folder / name) for name in ("plain.toml", "M.toml", "page.html"))
    assert (
        run(
            [
                "model",
                "new",
                "--carcass",
                "beam",
                "--setup",
                str(folder / "hidden_1.toml"),
                "-o",
                plain,
            ]
        )
        == 0
    )
    assert run(["model", "add", plain, "viscous_damping", "-o", model]) == 0
    assert (
        run(["ladder", *logs, "--model", model, "-o", str(folder / "ladder.json"), "--quiet"]) == 0
    )
    assert (
        run(
            [
                "report",
                *logs,
                "--model",
                model,
                "--ladder",
                str(folder / "M.ladder.json"),
                "-o",
                page,
                "--quiet",
            ]
        )
        == 0
    )
    return Path(page)
