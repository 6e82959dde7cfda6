"""Faults: what cannot be written or drawn in the end is refused before the work, and a channel of
another kind at once.
"""

from importlib import util
from pathlib import Path

import pytest

from tests.cli.conftest import Command, folder, tirelog

__all__ = ["folder", "tirelog"]


@pytest.fixture
def no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Logs that must not be opened, by names that no module imported meanwhile can keep."""

    def opened(*given: object, **more: object) -> None:
        raise AssertionError("the work was begun")

    for name in ("temporary_folder", "open_run"):
        monkeypatch.setattr(f"tirelog.runs.ingest.{name}", opened)


@pytest.mark.parametrize(
    ("command", "option", "path", "said"),
    [
        ("compare", "--plot", "nowhere/x.png", "the folder has to exist"),
        ("compare", "--plot", "x.jpg", "allowed are .png"),
        ("compare", "-o", "nowhere/x.json", "the folder has to exist"),
        ("diagnose", "--plot", "nowhere/x.png", "the folder has to exist"),
        ("diagnose", "-o", "nowhere/x.json", "the folder has to exist"),
        ("ladder", "--save", "nowhere/x.toml", "the folder has to exist"),
        ("ladder", "--plot", "nowhere/x.png", "the folder has to exist"),
        ("propose", "-o", "nowhere/x.toml", "the folder has to exist"),
        ("propose", "--plot", "nowhere/x.png", "the folder has to exist"),
        ("propose", "--plot", "x.jpg", "allowed are .png"),
        ("report", "-o", "nowhere/x.html", "the folder has to exist"),
        ("report", "-o", "x.pdf", "the page is HTML"),
        ("fit", "-o", "nowhere/x.toml", "the folder has to exist"),
        ("fit", "-o", "other.toml", "is there and is no model file"),
        ("ladder", "--save", "other.toml", "is there and is no model file"),
        ("propose", "-o", "other.toml", "is there and is no model file"),
        ("compare", "--plot-kind", "polr", "nearest: polar"),
        ("compare", "--plot-kind", "polar", "add --plot FILE"),
    ],
)
@pytest.mark.usefixtures("no_work")
def test_what_cannot_be_written_is_refused_first(
    folder: Path, tirelog: Command, command: str, option: str, path: str, said: str
) -> None:
    words = ["model", "fit"] if command == "fit" else [command]
    (folder / "other.toml").write_text("x = 1\n")
    before = sorted(folder.iterdir())
    log, model = str(folder / "log.csv"), str(folder / "m.toml")
    value = path if option == "--plot-kind" else str(folder / path)
    result = tirelog(*words, log, "--model", model, option, value)
    assert result.status == 2
    assert said in result.err
    assert path in result.err
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize(
    ("words", "path", "said"),
    [
        ("speed --plot", "x.jpg", "allowed are .png"),
        ("speed --plot", "nowhere/x.png", "the folder has to exist"),
        ("footprint --plot", "x.jpg", "allowed are .png"),
        ("dissipation --plot", "x.jpg", "allowed are .png"),
        ("phase-shift --plot", "x.jpg", "allowed are .png"),
        ("phase-shift --calibrate", "nowhere/x.toml", "the folder has to exist"),
        ("inflation --plot", "x.jpg", "allowed are .png"),
        ("speed -o", ".", "Is a directory"),
        ("ingest -o", "nowhere/x.h5", "the folder has to exist"),
        ("tables -o", "log.csv", "it is a file; give the path of a folder"),
        ("tables -o", "log.csv/below", "Not a directory"),
        ("report -o", ".", "Is a directory"),
    ],
)
@pytest.mark.usefixtures("no_work")
def test_what_tables_cannot_write_is_refused_first(
    folder: Path, tirelog: Command, words: str, path: str, said: str
) -> None:
    command, *options = words.split()
    result = tirelog(command, str(folder / "log.csv"), *options, str(folder / path))
    assert result.status == 2
    assert said in result.err


@pytest.mark.parametrize("command", ["compare", "diagnose", "ladder"])
@pytest.mark.usefixtures("no_work")
def test_a_picture_without_matplotlib_is_refused_first(
    folder: Path, tirelog: Command, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = util.find_spec
    monkeypatch.setattr(
        util, "find_spec", lambda name, *more: None if name == "matplotlib" else found(name, *more)
    )
    log, model, plot = (str(folder / name) for name in ("log.csv", "m.toml", "x.png"))
    result = tirelog(command, log, "--model", model, "--plot", plot)
    assert result.status == 2
    assert "--plot needs matplotlib" in result.err
