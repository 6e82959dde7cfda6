"""The process in which a library reads a log: limits first, then one conversion, then an answer."""

from __future__ import annotations

import importlib
import json
import sys
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

#: sentences of a kind, and letters of one, that the answer holds
_MOST_SAID, _MOST_LETTERS = 50, 300


class NoNumbers(Exception):
    """A sentence on why nothing of the log can be read."""


@dataclass
class Answer:
    """What is said of a conversion, gathered on its way."""

    losses: list[str] = field(default_factory=list)
    passed_over: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    start: str | None = None

    def told(self) -> dict[str, object]:
        """All of it, shortened."""
        return {
            name: [one_line(sentence) for sentence in getattr(self, name)[:_MOST_SAID]]
            for name in ("losses", "passed_over", "remarks")
        } | {"start": self.start}


def one_line(sentence: object) -> str:
    """A sentence of printable letters, not too long."""
    words = " ".join(str(sentence)[: 2 * _MOST_LETTERS].split())
    return "".join(letter for letter in words if letter.isprintable())[:_MOST_LETTERS]


def limit(memory_bytes: int, disk_bytes: int, seconds: int) -> None:
    """Sets what this process may take from here on, if the system has such limits."""
    try:
        import resource
    except ImportError:
        return
    wanted = {"RLIMIT_FSIZE": disk_bytes, "RLIMIT_CPU": seconds, "RLIMIT_CORE": 0}
    with suppress(OSError, ValueError):
        status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
        held = next(line for line in status.splitlines() if line.startswith("VmData:"))
        wanted["RLIMIT_DATA"] = int(held.split()[1]) * 1024 + memory_bytes
    for name, most in wanted.items():
        with suppress(OSError, ValueError, AttributeError):
            kind = getattr(resource, name)
            _, hard = resource.getrlimit(kind)
            lower = most if hard == resource.RLIM_INFINITY else min(most, hard)
            resource.setrlimit(kind, (lower, hard))


def main() -> None:
    """MODULE LOG MADE ANSWER MEMORY DISK SECONDS: converts, and writes the answer as JSON."""
    module, source, target, answer_file, *limits = sys.argv[1:]
    answer = Answer()
    try:
        converter = importlib.import_module(f"tirelog.readers.extra.{module}")
        converter.load()
        limit(*(int(most) for most in limits))
        converter.convert(Path(source), Path(target), answer)
        told = answer.told()
    except MemoryError:
        told = {"error": "it takes too much memory"}
    except NoNumbers as problem:
        told = {"empty": one_line("; ".join([str(problem), *answer.losses, *answer.passed_over]))}
    # libraries raise anything on a damaged file; the sentence goes to who asked
    except Exception as problem:
        told = {"error": one_line(f"{type(problem).__name__}: {problem}")}
    Path(answer_file).write_text(json.dumps(told), encoding="utf-8")
