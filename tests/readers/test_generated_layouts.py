"""Property: files in every layout of public data are read as they were written, to the row."""

import pytest

from benchmarks.layouts import crossed, extras, meaning
from benchmarks.layouts.generated import cases
from benchmarks.layouts.judge import judged

EVERY = (*cases(), *extras.cases(), *meaning.cases())
CASES = {f"{case.source}: {case.layout}": case for case in EVERY}
#: whole kinds, of which each twentieth case is enough for every day
CROSSED = {f"{case.source}: {case.layout}": case for case in crossed.cases()}
SOME = [
    pytest.param(case, id=name, marks=[pytest.mark.slow] if number % 20 else [])
    for number, (name, case) in enumerate(CROSSED.items())
]


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_a_layout_is_read_as_it_was_written(case, tmp_path):
    if case.needs:
        pytest.importorskip(case.needs, reason=f"{case.needs} comes with an extra")
    assert judged(case, tmp_path).wrong == ""


@pytest.mark.parametrize("case", SOME)
def test_one_of_a_whole_kind_is_read_as_it_was_written(case, tmp_path):
    test_a_layout_is_read_as_it_was_written(case, tmp_path)
