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


FOLDER = "the folder has to exist"


@pytest.mark.parametrize(
    ("words", "path", "said"),
    [
        ("compare --model m.toml --plot", "nowhere/x.png", FOLDER),
        ("compare --model m.toml --plot", "x.jpg", "allowed are .png"),
        ("compare --model m.toml -o", "nowhere/x.json", FOLDER),
        ("ladder --model m.toml --save", "nowhere/x.toml", FOLDER),
        ("ladder --model m.toml --save", "other.toml", "is there and is no model file"),
        ("propose --model m.toml -o", "nowhere/x.toml", FOLDER),
        ("propose --model m.toml -o", "other.toml", "is there and is no model file"),
        ("report --model m.toml -o", "nowhere/x.html", FOLDER),
        ("model fit --model m.toml -o", "nowhere/x.toml", FOLDER),
        ("model fit --model m.toml -o", "other.toml", "is there and is no model file"),
        ("speed --plot", "x.jpg", "allowed are .png"),
        ("speed --plot", "nowhere/x.png", FOLDER),
        ("phase-shift --plot", "x.jpg", "allowed are .png"),
        ("phase-shift --calibrate", "nowhere/x.toml", FOLDER),
        ("speed -o", ".", "Is a directory"),
        ("ingest -o", "nowhere/x.h5", FOLDER),
        ("tables -o", "log.csv", "it is a file; give the path of a folder"),
        ("tables -o", "log.csv/below", "Not a directory"),
        ("report -o", ".", "Is a directory"),
    ],
)
@pytest.mark.usefixtures("no_work")
def test_what_cannot_be_written_is_refused_first(
    folder: Path, tirelog: Command, words: str, path: str, said: str
) -> None:
    (folder / "other.toml").write_text("x = 1\n")
    before = sorted(folder.iterdir())
    typed = f"{words} {path} log.csv"
    result = tirelog(typed)
    assert result.status == 2
    assert said in result.err
    assert path in result.err
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize("command", ["compare", "diagnose", "ladder", "footprint"])
@pytest.mark.usefixtures("no_work")
def test_a_picture_without_matplotlib_is_refused_first(
    folder: Path, tirelog: Command, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = util.find_spec
    monkeypatch.setattr(
        util, "find_spec", lambda name, *more: None if name == "matplotlib" else found(name, *more)
    )
    log, model, plot = (str(folder / name) for name in ("log.csv", "m.toml", "x.png"))
    models = [] if command == "footprint" else ["--model", model]
    result = tirelog(command, log, *models, "--plot", plot)
    assert result.status == 2
    assert "a picture needs matplotlib" in result.err
