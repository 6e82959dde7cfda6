"""The command line as a line of words, for the tests of this folder."""

import shlex

from tirelog.cli import run


def status(words: str, *more: str) -> int:
    """The status of `tirelog` with these words, as a shell parts them, and some more."""
    return run([*shlex.split(words), *more])
