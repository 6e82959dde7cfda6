"""Golden copies of what commands print of damaged logs and wrong uses, which are written as data.

    python -m benchmarks.uses [NAME...]     rewrite the answers of tests/golden/uses/NAME.toml

A file has kits (`[[kits]]`): files, commands that `make` further ones, and cases. A case has other
files or commands than its kit. `edits` are cases of one `file`: texts, each with what takes its
place (of none: it is added at the end), or all of the file. A file's content is a text, or a list
of STEPS that make its bytes.

An answer is the status of each command, its messages and what it prints. A table is kept as its
number of rows and their quality words, but for that of `check`. tests/golden/test_uses.py compares
the answers with their golden copies.
"""

from __future__ import annotations

import csv
import gzip
import io
import lzma
import os
import re
import shlex
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from benchmarks.goldens import ANSWERS, SAMPLES, tirelog
from tirelog.runtime import one_thread

USES = ANSWERS.parent / "uses"
#: what a step makes of the bytes so far, by its first word; the folder has the kit's own files
STEPS: dict[str, Callable[..., bytes]] = {
    "own": lambda data, folder, name: (folder / name).read_bytes(),
    "sample": lambda data, folder, name: (SAMPLES / name).read_bytes(),
    "hex": lambda data, folder, text, times=1: data + bytes.fromhex(text) * times,
    "add": lambda data, folder, text, times=1: data + text.encode() * times,
    "at": lambda data, folder, place, text: with_bytes(data, place, bytes.fromhex(text)),
    "rows": lambda data, folder, count, rate_Hz, text: (
        data + "".join(text.format(t=i / rate_Hz, i=i) + "\n" for i in range(count)).encode()
    ),
    "replace": lambda data, folder, old, new: with_text(data, old, new, -1),
    "first": lambda data, folder, old, new: with_text(data, old, new, 1),
    "line": lambda data, folder, number, text: with_line(data, number, text),
    "rate": lambda data, folder, rate_Hz: with_rate(data, rate_Hz),
    "behind": lambda data, folder, mark: re.sub(f"(?m)^.*?{mark}".encode(), b"", data),
    "head": lambda data, folder, lines: b"".join(data.splitlines(keepends=True)[:lines]),
    "from": lambda data, folder, share: without_first_rows(data, share),
    "cut": lambda data, folder, stop: data[:stop],
    "encode": lambda data, folder, encoding: data.decode().encode(encoding),
    "gunzip": lambda data, folder: gzip.decompress(data),
    "gzip": lambda data, folder: gzip.compress(data, mtime=0),
    "xz": lambda data, folder: lzma.compress(data),
}
#: letters that are kept of what is no table
MOST_PRINTED = 9000
#: what depends on the last bit of a simulated number, or on a library's version
VARIES = re.compile(
    r"[\d,]+ bytes, sha256 \w+|(?<=readable HDF5 file )\(.*\)(?=; allowed)"
    r"|(?<=after )\d+(?= unpacked)|(?<=is not a formula )\(.*\)|(?<= rows, )[\d.]+ s, .* left$"
    r"|(?<=a table )\((Err|Exp|No|Parquet|Could)[\w']* .*\)(?=; csv)"
    r"|(?<=no pattern )\(.*\)(?=; allowed)"
    r"|(?<=\(ValueError: ).*(?=\);)|(?<=a footprint: )(the number|could) .*(?=; lines of)",
    re.MULTILINE,
)


def with_text(data: bytes, old: str, new: str, times: int) -> bytes:
    """The bytes with a text in place of another that is there."""
    if old.encode() not in data:
        raise ValueError(f"nothing to replace: {old}")
    return data.replace(old.encode(), new.encode(), times)


def with_rate(data: bytes, rate_Hz: float) -> bytes:
    """A text log whose first column counts its rows at another rate."""
    head, *lines = re.split(rb"(?m)(?<=\n)(?=\d)", data)
    rows = (b"%.6f,%b" % (i / rate_Hz, line.split(b",", 1)[1]) for i, line in enumerate(lines))
    return head + b"".join(rows)


def without_first_rows(data: bytes, share: float) -> bytes:
    """A text log without so much of its rows; its head stays."""
    head, *lines = re.split(rb"(?m)(?<=\n)(?=\d)", data)
    return head + b"".join(lines[round(share * len(lines)) :])


def with_bytes(data: bytes, place: int, part: bytes) -> bytes:
    """The bytes with others in their place."""
    place %= len(data)
    return data[:place] + part + data[place + len(part) :]


def with_line(data: bytes, number: int, text: str) -> bytes:
    """The bytes with another text in a line, which is counted from 1."""
    lines = data.split(b"\n")
    lines[number - 1] = text.encode()
    return b"\n".join(lines)


def write(folder: Path, files: Mapping[str, Any]) -> None:
    """Files of a text, or of steps that make their bytes."""
    for name, content in files.items():
        data = b"" if isinstance(content, list) else str(content).encode()
        for word, *given in content if isinstance(content, list) else ():
            data = STEPS[word](data, folder, *given)
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).unlink(missing_ok=True)
        (folder / name).write_bytes(data)


def contents_of(folder: Path) -> dict[Path, bytes]:
    """Every file of a folder, and those that it links to, with their bytes."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def output_of(text: str) -> str:
    """What a command printed; of a table how many rows, and which words are in their quality."""
    if re.match(r"\w+(,\w+)+\n", text):
        rows = list(csv.DictReader(io.StringIO(text)))
        words = sorted({row["quality"] for row in rows if row.get("quality")})
        return " ".join([f"a table of {len(rows)} rows", *words]) + "\n"
    return text[:MOST_PRINTED]


def answers(name: str) -> str:
    """The answers to all cases of a file."""
    one_thread()
    said = []
    for kit in tomllib.loads((USES / f"{name}.toml").read_text())["kits"]:
        with tempfile.TemporaryDirectory() as made:
            folder = Path(made)
            write(folder, kit.get("files", {}))
            for link, target in kit.get("links", {}).items():
                (folder / link).symlink_to(target)
            for link, target in kit.get("hard_links", {}).items():
                os.link(folder / target, folder / link)
            for line in kit.get("make", ()):
                assert tirelog(folder, *shlex.split(line), "--quiet").status == 0, line
            before = contents_of(folder)
            for case in [*kit.get("cases", ()), *edit_cases(kit)] or [{}]:
                write(folder, case.get("files", {}))
                lines = case.get("commands", kit.get("commands", "")).splitlines()
                said.append(f"== {case['name']}\n" if "name" in case else "")
                said += case_answers(folder, [line for line in lines if line])
                for path, data in before.items():
                    if path.read_bytes() != data:
                        path.write_bytes(data)
                for path in contents_of(folder).keys() - before.keys():
                    path.unlink()
    return "".join(said)


def edit_cases(kit: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """The cases of the edits of a file."""
    for edit in kit.get("edits", ()):
        content = edit
        if isinstance(edit, list) and isinstance(edit[0], str):
            pairs = zip(edit[::2], edit[1::2], strict=True)
            steps = (["first", a, b] if a else ["add", f"\n{b}\n"] for a, b in pairs)
            content = [["own", kit["file"]], *steps]
        yield {"name": f"{kit['file']}: {edit!r:.100}", "files": {kit["file"]: content}}


def case_answers(folder: Path, lines: list[str]) -> Iterator[str]:
    """The answers to command lines of a case; one that is the answer before is not said again."""
    before = ""
    for line in lines:
        answer = answer_to(folder, line)
        shown = "the same\n" if answer == before else answer
        yield f"$ tirelog {line}\n{shown}\n"
        before = answer


def answer_to(folder: Path, line: str) -> str:
    """The status of a command line, what it prints, and which files it makes or changes."""
    before = contents_of(folder)
    done = tirelog(folder, *shlex.split(line))
    out = done.out if line.startswith("check ") else output_of(done.out)
    now = contents_of(folder)
    for path in sorted(before.keys() | now.keys()):
        if before.get(path) != now.get(path):
            verb = "writes" if path in now else "removes"
            out += f"{verb} {path.relative_to(folder)}\n"
    out += done.err
    out = VARIES.sub("...", out.replace(f"{folder}/", ""))
    return f"{done.status}\n{out}"


def main() -> int:
    """Rewrite the answers that are named, or all."""
    for name in sys.argv[1:] or sorted(path.stem for path in USES.glob("*.toml")):
        (USES / f"{name}.txt").write_text(answers(name))
    return 0


if __name__ == "__main__":
    sys.exit(main())
