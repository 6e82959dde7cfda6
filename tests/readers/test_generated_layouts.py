"""Property: files in every layout of public data are read as they were written, to the row."""

import pytest

from benchmarks.layouts import extras, meaning
from benchmarks.layouts.generated import cases
from benchmarks.layouts.judge import judged

EVERY = (*cases(), *extras.cases(), *meaning.cases())
CASES = {f"{case.source}: {case.layout}": case for case in EVERY}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_a_layout_is_read_as_it_was_written(case, tmp_path):
    if case.needs:
        pytest.importorskip(case.needs, reason=f"{case.needs} comes with an extra")
    assert judged(case, tmp_path).wrong == ""
