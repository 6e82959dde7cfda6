"""Golden: what the commands answer to the sample logs, and what wrong uses are told."""

import json

import pytest

from benchmarks import goldens

pytestmark = pytest.mark.xdist_group("answers")  # a question's logs are made once

#: of each question the answers that take few seconds; the others are marked slow
QUICK = {
    "drive_beam": goldens.KEPT["drive_beam"],
    "drive_patch": goldens.KEPT["drive_patch"],
    "encoder_shift": goldens.KEPT["encoder_shift"],
    "hidden_beam": ("diagnose",),
    "quiet": ("diagnose",),
}
ASKED = [
    pytest.param(
        name,
        verb,
        marks=() if verb in QUICK.get(name, ()) else pytest.mark.slow,
        id=f"{name}-{verb}",
    )
    for name, verbs in goldens.KEPT.items()
    for verb in verbs
]


@pytest.fixture(scope="module")
def prepared():
    """The folders of the questions that were asked so far."""
    return {}


@pytest.mark.parametrize(("name", "verb"), ASKED)
def test_an_answer_has_not_moved(name, verb, prepared, tmp_path_factory):
    golden = json.loads((goldens.ANSWERS / f"{name}.json").read_text())[verb]
    if name not in prepared:
        prepared[name] = tmp_path_factory.mktemp(name)
        goldens.prepare(prepared[name], name)
    assert golden["answer"]
    assert goldens.moved(golden, goldens.answer(prepared[name], name, verb)) == []


@pytest.mark.parametrize(
    ("kind", "answered"), [("errors", goldens.wrong_uses), ("mistakes", goldens.mistakes)]
)
def test_wrong_uses_and_mistakes_have_the_same_messages(kind, answered, tmp_path):
    golden = (goldens.ANSWERS / f"{kind}.txt").read_text()
    assert answered(tmp_path).splitlines() == golden.splitlines()


def test_verdicts_are_covered():
    """Five of the seven; `partial` and `scatter` come of no log here."""
    given = {
        answers["diagnose"]["answer"]["verdict"]
        for answers in map(json.loads, (p.read_text() for p in goldens.ANSWERS.glob("*.json")))
        if "diagnose" in answers
    }
    assert given >= {"missing", "ambiguous", "unknown", "nothing_missing", "too_few"}
