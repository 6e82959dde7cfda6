"""Programs in a process of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path


def python(
    program: str,
    *words: str,
    folder: Path | None = None,
    without: str = "no such variable",
    status: int = 0,
    **variables: str,
) -> subprocess.CompletedProcess[str]:
    """What a program of Python does, in a `folder`, with more `variables` of the environment.

    It does not have this process' own variables that have `without` in their names. It ends with
    the `status`.
    """
    kept = {name: value for name, value in os.environ.items() if without not in name}
    done = subprocess.run(
        [sys.executable, "-c", program, *words],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        env=kept | variables,
    )
    assert done.returncode == status, done.stderr[-2000:]
    return done
