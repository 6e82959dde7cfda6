"""Property: every command of README.md and the pages runs on sample_data, as shown."""

import gzip
import io
import re
import shlex
import shutil
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.cli.conftest import command_of, refuse_other_options
from tirelog.cli import run

ROOT = Path(__file__).parents[2]
SAMPLES = ROOT / "sample_data"
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
#: beginning of a command -> why it is only parsed
PARSED_ONLY = {
    "tirelog campaign ": "a manifest of one's own; tests/campaign runs campaigns",
    "tirelog compare cleat.csv.gz --model m.toml": "17 s; tests/physics/test_coupled_command.py",
    "tirelog plot drive.csv.gz hidden_1.csv.gz --kind": "3 s; tests/strain draws it",
    "tirelog ladder hidden": "11 s; tests/diagnosis climbs ladders",
    "tirelog model predict m.toml": "a tire that moves takes 5 s; tests/physics drives it",
    "tirelog propose unknown": "25 s; tests/diagnosis proposes",
    "tirelog compare unknown_1.csv.gz unknown_2.csv.gz --model proposed": "needs what is proposed",
    "tirelog report hidden": "16 s; tests/report makes pages",
}
#: pages that make a command which is not there yet; tests/data/test_howtos.py follows them
NEW_COMMANDS = ("table.md",)
#: what `tirelog ... | this` stands beside, and what a page types before or between
OTHERS = ["cat", "cd", "cp", "cut", "grep", "gzip", "head", "jq", "ls", "make", "pip", "pytest"]
OTHERS += ["tail", "zstd"]
#: a word in capitals stands for a name of the reader's own
PLACEHOLDER = re.compile(r"(?<![\w./-])[A-Z][A-Z_]+(?:\.\w+)*\b")
WORD = re.compile(r"[A-Za-z_]{3,}")


class Typed(NamedTuple):
    page: str
    folder: str  # below the copy of the repository
    line: str
    shown: str  # what a console block shows below it


def typed():
    """Every line of the pages' blocks that a shell would take, with the folder it is typed in."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        name = page.relative_to(ROOT).as_posix()
        folder = "sample_data" if name.startswith("docs/") else ""
        for kind, block in re.findall(r"^```(sh|console)\n(.*?)^```", text, re.M | re.S):
            block = block.replace("\\\n", " ")
            for entry in block.split("\n$ ") if kind == "console" else block.splitlines():
                first, _, shown = entry.removeprefix("$ ").partition("\n")
                line = re.split(r"\s#\s|^#\s", first)[0].strip()
                if line.startswith("cd "):
                    folder = line[3:]
                elif line:
                    yield Typed(name, folder, line, shown)


ALL = list(typed())


def own(line):
    """The tirelog commands in a line, which may be a pipe."""
    parts = [part.strip() for part in re.split(r"\||&&|;(?![^']*')", re.sub(r"'[^']*'", "Q", line))]
    for part in parts:
        assert part.split()[0] in ("tirelog", *OTHERS), line
    return [part for part in parts if part.startswith("tirelog")]


COMMANDS = list(dict.fromkeys((t.folder, c) for t in ALL for c in own(t.line)))


def reason(words):
    """Why a command is not run; None if it is."""
    if PLACEHOLDER.search(words):
        return "a word in capitals stands for a name of one's own"
    return next((why for start, why in PARSED_ONLY.items() if words.startswith(start)), None)


def parse(words):
    """The parser takes the command; nothing is run."""
    one, rest = command_of(words)
    assert not hasattr(one, "commands"), words
    assert not one.make_context("tirelog", rest).args


def test_the_pages_have_commands_and_the_list_of_those_not_run_is_of_use():
    lines = [words for _, words in COMMANDS]
    assert len(lines) > 40
    assert len({line.split()[1] for line in lines}) > 12
    assert [start for start in PARSED_ONLY if not any(s.startswith(start) for s in lines)] == []
    assert sum(reason(line) is None for line in lines) > 0.7 * len(lines)


@pytest.mark.parametrize(("folder", "words"), COMMANDS, ids=[words for _, words in COMMANDS])
def test_a_page_s_command_is_taken(folder, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    parse(shlex.split(words)[1:])


def test_every_command_in_a_sentence_exists():
    """Commands in running text may lack arguments; their names and options are there."""
    found = 0
    for page in PAGES:
        if page.name in NEW_COMMANDS:
            continue
        text = re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.M | re.S)
        for words in re.findall(r"`tirelog ([a-z][^`\n]*)`", text):
            one, names = command_of(words.split())
            if hasattr(one, "commands"):  # a group alone, or one of several: model new | show
                assert not names or "NAME" in names or "..." in names, (page, words)
                continue
            refuse_other_options(one, re.split(r"\||&&", words)[0])
            found += 1
    assert found > 20


@pytest.mark.slow
def test_the_pages_run_from_top_to_bottom(tmp_path, monkeypatch, capfd):
    """In one copy of sample_data, in the order of the pages: status 0 each, and the words shown."""
    shutil.copytree(SAMPLES, tmp_path / "sample_data")
    failed: list[tuple[object, ...]] = []
    printed: dict[tuple[str, ...], set[str]] = {}
    for one in ALL:
        monkeypatch.chdir(tmp_path / one.folder)
        if one.line.startswith("cp "):
            shutil.copy(*one.line.split()[1:])
        for words in own(one.line):
            if reason(words) is not None:
                continue
            given = [
                name
                for word in shlex.split(words)[1:]
                for name in (sorted(map(str, Path().glob(word))) if "*" in word else [word])
            ]
            asked = tuple(word for word in given if word != "--quiet")
            if asked not in printed:  # else it stands on several pages
                monkeypatch.setattr(sys, "stdin", standard_input(one.line))
                capfd.readouterr()
                status = run(list(asked))
                out, err = capfd.readouterr()
                printed[asked] = set(WORD.findall(out + err))
                if status:
                    failed.append((one.page, words, status, err[-300:]))
            other = set(WORD.findall(one.shown)) - printed[asked]
            if other:
                failed.append((one.page, words, "is not what it prints: make outputs", other))
    assert failed == []
    assert len(printed) > 25


def standard_input(line):
    """What the line's pipe brings: a file unpacked by gzip, or nothing."""
    packed = re.match(r"gzip -dc (\S+) \|", line)
    piped = io.BytesIO(gzip.decompress(Path(packed[1]).read_bytes()) if packed else b"")
    return io.TextIOWrapper(io.BufferedReader(piped))
