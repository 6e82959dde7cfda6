"""Property: texts are in plain words: subject, verb, object, and at most 25 words a sentence.

A text is a docstring, or any string of the package: a message, a line of help, a page. Comments,
CHANGELOG and the pages of the docs have no foreign words either.
"""

import ast
import io
import re
import tokenize
from collections.abc import Iterator

import pytest

from tests.sources import ROOT, sources

pytestmark = pytest.mark.xdist_group("sources")  # one worker parses the package, once

#: words and turns that a reader from the field does not use so
FOREIGN = re.compile(r"\b(?:told|said|stands|taken off|as it came|of like|which is no)\b", re.I)
#: a symbol or the number of an equation, which a terminal does not explain
SYMBOL = re.compile(r"\bP[1-4] \(?\d|\bOmega\b|\bxi\b")
#: files whose texts are reference, or formulas in the language of model files
REFERENCE = (
    "diagnosis/propose/grammar.py",
    "physics/effects/contact.py",
    "physics/effects/waveform.py",
    "physics/model/user_effects.py",
    "vocabulary/columns.py",
)
#: tags of the page, which are no words
MARKUP = re.compile(r"</?[a-z][^<>]*>|<!doctype html>")
MOST_WORDS = 25


def texts(file: str, tree: ast.Module) -> Iterator[tuple[str, int, str, bool]]:
    """(file, line, text, is it a docstring) of every text; X is for the values in it.

    A string that is one bare identifier is a key and no text.
    """
    inside: set[ast.AST] = set()
    docs: set[ast.AST] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            docs.add(node.value)
        if isinstance(node, ast.JoinedStr):
            inside |= set(node.values)
            parts = [str(p.value) if isinstance(p, ast.Constant) else "X" for p in node.values]
            yield file, node.lineno, "".join(parts), False
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in inside:
            if node.value.isidentifier():
                continue
            yield file, node.lineno, node.value, node in docs


def held() -> Iterator[tuple[str, int, str, bool]]:
    """The texts of the package."""
    for file, (_, tree) in sources().items():
        yield from texts(file, tree)


def sentences(text: str) -> Iterator[str]:
    """The sentences of a text, its clauses, lines of a list or diagram, choices of a pattern."""
    plain = MARKUP.sub("\n\n", text) if "</" in text else text
    for block in re.split(r"\n\s*\n", plain):
        lines = block.strip("\n").splitlines()
        if any(re.search(r"\S {2,}\S|-->|^-{3,}$", line.strip()) for line in lines):
            apart = [re.sub(r"\S+ {2,}", "", line.strip()) for line in lines]
        else:
            apart = [" ".join(lines)]
        for part in apart:
            yield from re.split(r"(?<=[.;:?!])\s|\|", part)


def test_texts_have_no_foreign_words() -> None:
    found = [(file, line, FOREIGN.findall(text)) for file, line, text, _ in held()]
    assert [one for one in found if one[2]] == []


def test_pages_have_no_foreign_words() -> None:
    tops = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
    code = re.compile(r"`[^`]*`")
    texts = {
        page: code.sub("", page.read_text(encoding="utf-8"))
        for page in (*tops, *(ROOT / "docs").rglob("*.md"))
    }
    assert [
        (page, FOREIGN.findall(text)) for page, text in texts.items() if FOREIGN.search(text)
    ] == []


def test_comments_have_no_foreign_words() -> None:
    found = []
    for file, (text, _) in sources().items():
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.COMMENT and FOREIGN.search(token.string):
                found.append((file, token.start[0], token.string))
    assert found == []


def test_no_sentence_is_long() -> None:
    long = [
        (file, line, sentence)
        for file, line, text, _ in held()
        for sentence in sentences(text)
        if len(re.findall(r"[^\W_][\w'./-]*", sentence)) > MOST_WORDS
    ]
    assert long == []


def test_help_begins_with_what_comes_out() -> None:
    begins = ("Tell ", "Say ")
    assert [(f, n, text) for f, n, text, doc in held() if text.startswith(begins)] == []


def test_a_terminal_shows_no_symbol() -> None:
    shown = [(f, n, text) for f, n, text, doc in held() if not doc and f not in REFERENCE]
    assert [one for one in shown if SYMBOL.search(one[2])] == []
