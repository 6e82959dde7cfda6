"""Literature: every command of the papers' row table ends well, and every row names its test."""

import re
import shlex
import shutil

import pytest

from tests.sources import ROOT
from tirelog.cli import run

PAGE = (ROOT / "docs" / "papers.md").read_text(encoding="utf-8")
ROWS = [
    [cell.strip() for cell in line.split("|")[1:-1]]
    for line in re.findall(r"^\| \d\.\d+ \|.*$", PAGE, re.M)
]


@pytest.mark.slow
def test_the_commands_of_the_rows_end_well(tmp_path, monkeypatch, capfd):
    """Each once, in a copy of the samples, after those that make what they name."""
    first = re.search(r"^```sh\n(.*?)^```", PAGE, re.M | re.S)
    assert first is not None
    made = first[1].splitlines()
    asked = [command for row in ROWS for command in re.findall(r"`(tirelog [^`]*)`", row[2])]
    shutil.copytree(ROOT / "sample_data", tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    ended = {line: run(shlex.split(line)[1:]) for line in dict.fromkeys((*made, *asked))}
    capfd.readouterr()
    assert len(ended) > 100
    assert [line for line, status in ended.items() if status != 0] == []


def test_every_row_that_is_there_has_a_command_and_a_test():
    there = [row for row in ROWS if row[4] in ("yes", "partly")]
    assert [row[0] for row in there if "`tirelog " not in row[2]] == []
    named = {row[0]: row[3].strip("`") for row in there}
    assert [key for key, file in named.items() if not (ROOT / "tests" / file).is_file()] == []
