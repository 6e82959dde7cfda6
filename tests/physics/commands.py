"""The command line as a line of words, for the tests of this folder."""

import json
import shlex

from tirelog.cli import run


def status(words: str, *more: str) -> int:
    """The status of `tirelog` with these words, as a shell parts them, and some more."""
    return run([*shlex.split(words), *more])


def rows(capsys, words: str, *more: str) -> list[dict]:
    """What a command that has to end well prints as JSON."""
    capsys.readouterr()
    assert status(words, *more, "--format", "json") == 0
    return json.loads(capsys.readouterr().out)
