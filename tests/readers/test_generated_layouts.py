"""Property: files in every layout of public data are read as they were written, to the row."""

import pytest

from benchmarks.layouts import crossed, extras, meaning
from benchmarks.layouts.generated import cases
from benchmarks.layouts.judge import judged

EVERY = (*cases(), *extras.cases(), *meaning.cases())


def each(every, nth):
    """The cases by name; every day each nth, the others with the slow tests."""
    named = {f"{case.source}: {case.layout}": case for case in every}
    return [
        pytest.param(case, id=name, marks=[pytest.mark.slow] if number % nth else [])
        for number, (name, case) in enumerate(named.items())
    ]


# of whole kinds, names and units by formats, a twentieth is enough for every day
@pytest.mark.parametrize("case", [*each(EVERY, 3), *each(crossed.cases(), 20)])
def test_a_layout_is_read_as_it_was_written(case, tmp_path):
    if case.needs:
        pytest.importorskip(case.needs, reason=f"{case.needs} comes with an extra")
    assert judged(case, tmp_path).wrong == ""
