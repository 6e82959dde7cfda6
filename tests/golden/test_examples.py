"""Golden: the examples of the documentation run and give the numbers that they show."""

import doctest
import inspect
import re
from importlib import import_module
from pathlib import Path

import pandas as pd
import pytest

import tirelog

ROOT = Path(__file__).parents[2]
PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs" / "methods").glob("*.md")),
]
BLOCKS = [
    block
    for page in PAGES
    for block in re.findall(r"^```python\n(.*?)^```", page.read_text("utf-8"), re.M | re.S)
]


def test_the_pages_have_examples_in_python():
    assert len(BLOCKS) >= 4
    assert any("tirelog.contributions" in block for block in BLOCKS)


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_a_page_s_python_runs(number, tmp_path, monkeypatch):
    (tmp_path / "sample_data").symlink_to(ROOT / "sample_data")
    for log in ("drive.csv.gz", "drive.toml"):  # pages of methods are typed in sample_data
        (tmp_path / log).symlink_to(ROOT / "sample_data" / log)
    part = tmp_path / "results" / "table=footprint" / "log=a" / "part.parquet"
    part.parent.mkdir(parents=True)
    pd.DataFrame({"length_m": [0.1, 0.2]}).to_parquet(part)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "page"}
    exec(compile(BLOCKS[number], f"pages, block {number}", "exec"), names)


@pytest.mark.parametrize("module", ["logs", "tables", "models", "answers"])
def test_the_docstrings_numbers(module, monkeypatch):
    monkeypatch.chdir(ROOT)
    result = doctest.testmod(import_module(f"tirelog.api.{module}"))
    assert result.attempted > 1
    assert result.failed == 0


def test_every_public_name_is_there_and_documented():
    for name in tirelog.__all__:
        found = getattr(tirelog, name)
        assert name in dir(tirelog)
        assert found.__doc__
        if inspect.unwrap(found).__module__.startswith("tirelog.api."):
            assert "Parameters\n" in found.__doc__, name
            assert "Returns\n" in found.__doc__, name
            assert "Raises\n" in found.__doc__, name
