"""The extension that kernels were compiled to when the package was installed.

    _built.EXT   one function for each kernel and kind of arguments
    _built.json  their names, and of which sources it was made

It is used if all of its sources are as they were, to the byte: not after an edit of one of them in
a folder that the package is installed from.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from hashlib import blake2b
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from threading import Lock
from typing import Any

#: the folder of the package, in which sources are named by their paths
PACKAGE = Path(__file__).resolve().parents[1]
#: the extension's name as a module, which names the function that sets it up
MODULE = "_built"
#: the extension of the Python that runs; the longest name is that of this version alone
EXTENSION = PACKAGE / "kernels" / f"{MODULE}{max(EXTENSION_SUFFIXES, key=len)}"
#: names of its functions, and hashes of its sources
TABLE = PACKAGE / "kernels" / f"{MODULE}.json"
#: names a file to which calls that the extension has no function for are written, line by line
RECORD = "TIRELOG_RECORD_KERNELS"


def function(kernel: str, kinds: str) -> Callable[..., Any] | None:
    """The function of a `kernel` for arguments of these `kinds`; None if there is none."""
    module, symbols = _loaded()
    symbol = symbols.get(kernel, {}).get(kinds)
    return None if symbol is None else getattr(module, symbol)


def at_hand() -> bool:
    """True if the extension can be used: calling one more kernel costs nothing."""
    return bool(_loaded()[1])


def note_missed(kernel: str, kinds: str) -> None:
    """Write a call that the extension has no function for to the file that RECORD names."""
    record = os.environ.get(RECORD)
    if record:
        with open(record, "a", encoding="utf-8") as file:
            file.write(f"{json.dumps([kernel, kinds])}\n")


def fingerprints(sources: Iterable[str]) -> dict[str, str]:
    """A hash of each source, by its path in the package."""
    return {
        name: blake2b((PACKAGE / name).read_bytes(), digest_size=16).hexdigest()
        for name in sorted(sources)
    }


_Functions = dict[str, dict[str, str]]
_lock = Lock()
_once: list[tuple[Any, _Functions]] = []


def _loaded() -> tuple[Any, _Functions]:
    """The extension and its functions' names by kernel and kinds; none if it is not to be used."""
    if not _once:
        with _lock:  # threads that call their first kernels at the same time
            if not _once:
                _once.append(_load())
    return _once[0]


def _load() -> tuple[Any, _Functions]:
    with suppress(OSError, ValueError, KeyError, TypeError, ImportError):
        table = json.loads(TABLE.read_text(encoding="utf-8"))
        made_of: dict[str, str] = table["sources"]
        if table["extension"] == EXTENSION.name and fingerprints(made_of) == made_of:
            # under a name without a dot, which is that of the function that sets it up
            spec = spec_from_file_location(MODULE, EXTENSION)
            if spec is not None and spec.loader is not None:
                module = module_from_spec(spec)
                spec.loader.exec_module(module)
                return module, dict(table["functions"])
    return None, {}
