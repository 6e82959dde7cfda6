"""Kernels compiled ahead of time: the step of an installation that makes the extension.

    python -m tirelog.kernels.build               make it in this folder, as `pip install` does

    calls.json (kinds of arguments that commands call each kernel with)
        --numba, which infers the rest; its compiler of modules--> object code --C compiler-->
        _built.EXT, _built.json

Needs numba, setuptools and a C compiler. Machine code is for every processor of the kind: that of
this one is no quicker (23 November 2026, two shared cores, Python 3.11; `tirelog tables` on 10
minutes of 16 gratings, twice three logs: 2.42 s and 2.41 s).
"""

from __future__ import annotations

import ast
import json
import os
import sys
import warnings
from functools import cache
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tirelog.kernels import dispatch
from tirelog.kernels.dispatch import Kernel, examples

#: kinds of arguments by kernel, as commands call them
CALLS = Path(__file__).parent / "calls.json"


def build(folder: Path = dispatch.EXTENSION.parent) -> list[Path]:
    """Files of the extension, made in a folder.

    ImportError: numba or setuptools is not there. Whatever numba and the C compiler raise if they
    can't.
    """
    with warnings.catch_warnings():
        # numba means to replace its compiler of modules, and has not named another
        warnings.simplefilter("ignore")
        from numba import typeof

        pycc: Any = import_module("numba.pycc")
    compiler = pycc.compiler
    usual = compiler.Flags

    def flags() -> Any:
        """The flags of `jit`: division as in numpy, other threads go on."""
        chosen: Any = usual()
        chosen.release_gil, chosen.error_model = True, "numpy"
        return chosen

    extension, table = folder / dispatch.EXTENSION.name, folder / dispatch.TABLE.name
    module = pycc.CC(dispatch.MODULE, source_module=__name__)
    functions: dict[str, dict[str, str]] = {}
    sources: set[Path] = set()
    for name, calls in json.loads(CALLS.read_text(encoding="utf-8")).items():
        kernel = getattr(import_module(name.partition(":")[0]), name.partition(":")[2], None)
        if not isinstance(kernel, Kernel):
            raise LookupError(f"{CALLS.name} has {name}, which is not a kernel; remove it")
        sources.update(*map(_with_imported, kernel.sources))
        for number, kinds in enumerate(map(json.dumps, calls)):
            symbol = f"{name}_{number}".replace(".", "_").replace(":", "_")
            types = tuple(typeof(example) for example in examples(kinds))
            module.export(symbol, types)(kernel.py_func)
            functions.setdefault(kernel.name, {})[kinds] = symbol
    with TemporaryDirectory() as made:
        module.output_dir, module.output_file = made, extension.name
        compiler.Flags = flags
        try:
            module.compile()
        finally:
            compiler.Flags = usual
        names = [source.relative_to(dispatch.PACKAGE).as_posix() for source in sources]
        told = {
            "extension": extension.name,
            "sources": dispatch.fingerprints(names),
            "functions": functions,
        }
        for path, content in (
            (extension, (Path(made) / extension.name).read_bytes()),
            (table, json.dumps(told, indent=1).encode()),
        ):
            # a process that runs has the old one open
            beside = path.with_name(f"{path.name}.{os.getpid()}")
            beside.write_bytes(content)
            beside.replace(path)
    return [extension, table]


@cache
def _with_imported(source: Path) -> frozenset[Path]:
    """A source and the modules it imports, whose constants are in its code."""
    nodes = ast.walk(ast.parse(source.read_text(encoding="utf-8")))
    names = [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
    modules = (dispatch.PACKAGE.joinpath(*name.split(".")[1:]) for name in names)
    return frozenset(
        {source, *(path for one in modules if (path := one.with_suffix(".py")).is_file())}
    )


def main() -> None:
    """Build, or print in a line why that failed."""
    try:
        build()
    except Exception as problem:
        sys.exit(f"kernels are not compiled ahead, but when first called: {problem}")


if __name__ == "__main__":
    main()
