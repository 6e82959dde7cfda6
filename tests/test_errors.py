"""Property: an error's sentence is made of its fields, and its fields are what code reads."""

import ast
import pickle

import pytest

from tests.sources import nodes
from tirelog.errors import ModelError

pytestmark = pytest.mark.xdist_group("sources")  # one worker parses the package, once


def test_an_error_told_elsewhere_keeps_its_parts() -> None:
    here = ModelError("no speed", allowed=("one",), do="give it")
    there = here.at("m.toml", 4)
    assert str(there) == f"m.toml:4: {here}"
    assert (there.what, there.allowed, there.do) == (here.what, here.allowed, here.do)
    travelled = pickle.loads(pickle.dumps(there))
    assert (str(travelled), travelled.what) == (str(there), there.what)


def test_a_raise_site_hands_over_parts() -> None:
    """What is wrong, what is allowed and what to do are fields, not one sentence to be cut."""
    kinds = {"UsageError", "SetupError", "ModelError", "OutputError", "ReadError", "DataLoss"}
    whole = []
    for file, node in nodes():
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.args):
            continue
        parts = {keyword.arg for keyword in node.keywords} & {"allowed", "do"}
        sentence = node.args[0]
        texts = sentence.values if isinstance(sentence, ast.JoinedStr) else [sentence]
        clauses = [t.value for t in texts if isinstance(t, ast.Constant)]
        if node.func.id in kinds and not parts and any("; " in str(text) for text in clauses):
            whole.append(f"{file}:{node.lineno}")
    assert whole == []
