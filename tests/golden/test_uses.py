"""Golden: what commands print of damaged logs, wrong files, wrong options and wrong numbers."""

import re

import pytest

from benchmarks import uses

#: most of a minute
SLOW = ("pooled",)
NAMES = [
    pytest.param(path.stem, marks=[pytest.mark.slow] * (path.stem in SLOW))
    for path in sorted(uses.USES.glob("*.toml"))
]


@pytest.mark.parametrize("name", NAMES)
def test_wrong_uses_have_the_same_answers(name):
    golden = (uses.USES / f"{name}.txt").read_text()
    assert not re.search("Traceback|a defect of", golden)
    assert uses.answers(name).splitlines() == golden.splitlines()
