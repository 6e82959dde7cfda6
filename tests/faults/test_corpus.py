"""Faults: what coverage-guided fuzzing found worth keeping is read, or refused with a sentence."""

import zipfile

import pytest

from benchmarks.fuzz.guided import CORPUS, read

FILES = zipfile.ZipFile(CORPUS)


@pytest.mark.parametrize("name", FILES.namelist())
def test_a_kept_input_is_read_or_refused(name):
    read(FILES.read(name))
