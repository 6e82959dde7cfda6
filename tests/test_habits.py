"""Property: the type checker is strict, and what it does not see is said."""

import ast
import io
import re
import tokenize
import tomllib
from pathlib import Path

import numpy as np

from tests.conftest import group_of
from tirelog.strain.footprint.learn import _classes

ROOT = Path(__file__).parents[1]
#: where an `ignore` hides a mistake in the physics
PIPELINE = ("physics/model/", "physics/moving/")
MOST_IGNORED = 3
#: of tests, as CONTRIBUTING.md has them
KINDS = ("Closed form", "Property", "Literature", "Golden", "Faults")


def ignored() -> list[tuple[str, str]]:
    """(file, line) of everything that the type checker is told not to see."""
    return [
        (path.relative_to(ROOT / "tirelog").as_posix(), line)
        for path in sorted((ROOT / "tirelog").rglob("*.py"))
        for line in path.read_text(encoding="utf-8").splitlines()
        if "type: ignore" in line
    ]


def test_the_model_s_pipeline_hides_nothing() -> None:
    assert [file for file, _ in ignored() if file.startswith(PIPELINE)] == []


def test_what_is_hidden_elsewhere_is_little_and_has_a_reason() -> None:
    unsaid = [
        f"{file}: {line.strip()}"
        for file, line in ignored()
        if not re.search(r"type: ignore\[[\w,-]+\]  # \w", line)
    ]
    assert unsaid == []
    assert len(ignored()) <= MOST_IGNORED


def test_checks_are_strict() -> None:
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    assert tools["mypy"]["strict"] is True
    options = tools["pytest"]["ini_options"]
    assert options["xfail_strict"] is True
    assert options["filterwarnings"][0] == "error"


def test_every_mark_of_a_group_is_one_that_the_scheduler_sees() -> None:
    """Else each worker makes again what the group shares, and nothing says so."""
    marked = [
        path
        for path in sorted((ROOT / "tests").rglob("test_*.py"))
        if "xdist_group(" in path.read_text(encoding="utf-8") and path != Path(__file__)
    ]
    assert len(marked) > 10
    assert [path.name for path in marked if not group_of(path)] == []


def test_every_file_of_tests_says_of_which_kind_it_is() -> None:
    """As the first word of its docstring, and of one kind alone."""
    said = {
        path.relative_to(ROOT).as_posix(): ast.get_docstring(ast.parse(path.read_text("utf-8")))
        for path in sorted((ROOT / "tests").rglob("test_*.py"))
    }
    begins = tuple(f"{kind}: " for kind in KINDS)
    assert len(said) > 200
    assert [file for file, text in said.items() if not (text or "").startswith(begins)] == []


#: words in backticks that are of formats and systems, or stand for several names
NOT_OURS = {"Fs", "nohup", "channel_1", "convert_MODULE", "name_se", "benchmarks.calibration"}


def test_a_name_in_a_text_is_one_of_the_code() -> None:
    """A name in backticks, in a docstring or comment, outlives no renaming of what it names."""
    names, texts = set(), {}
    for path in sorted((ROOT / "tirelog").rglob("*.py")):
        source = path.read_text(encoding="utf-8")
        names.update(path.relative_to(ROOT).with_suffix("").parts)
        tokens = list(tokenize.generate_tokens(io.StringIO(source).readline))
        names.update(token.string for token in tokens if token.type == tokenize.NAME)
        plain = [ast.get_docstring(node) or "" for node in documented(source)]
        plain += [token.string for token in tokens if token.type == tokenize.COMMENT]
        texts[path.relative_to(ROOT).as_posix()] = "\n".join(plain)
        words = (token.string for token in tokens if token.type == tokenize.STRING)
        names.update(re.findall(r"\w+", " ".join(word for word in words if len(word) < 80)))
    names |= {name.lower() for name in names if name.isupper()}
    wrong = {
        (file, name)
        for file, text in texts.items()
        for name in re.findall(r"`([A-Za-z_][\w.]*)`", text)
        if name not in NOT_OURS and not names.issuperset(name.split("."))
    }
    assert wrong == set()


def documented(source: str) -> list[ast.Module | ast.FunctionDef | ast.ClassDef]:
    """What may have a docstring."""
    kinds = ast.Module | ast.FunctionDef | ast.ClassDef
    return [node for node in ast.walk(ast.parse(source)) if isinstance(node, kinds)]


def test_every_number_of_a_module_says_what_it_is() -> None:
    """A constant with a number in it, or the line of constants that it stands in, has a comment."""
    bare = []
    for path in sorted((ROOT / "tirelog").rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        lines = text.splitlines()
        for node in ast.parse(text).body:
            if isinstance(node, ast.Assign | ast.AnnAssign) and _is_a_number(node):
                above = node.lineno - 2
                while lines[above] and not lines[above].startswith(("#", "def ", "class ")):
                    above -= 1
                own = lines[node.lineno - 1 : node.end_lineno]
                if not lines[above].startswith("#") and not any("# " in line for line in own):
                    bare.append(f"{path.relative_to(ROOT)}:{node.lineno}: {own[0]}")
    assert bare == []


def _is_a_number(node: ast.Assign | ast.AnnAssign) -> bool:
    """Whether constants are set here, in capitals, with a number of their own in them."""
    target = node.targets[0] if isinstance(node, ast.Assign) else node.target
    names = [part.id for part in ast.walk(target) if isinstance(part, ast.Name)]
    parts = list(ast.walk(node.value)) if node.value is not None else []
    return (
        bool(names)
        and re.match(r"_?[A-Z][A-Z0-9]", names[0]) is not None
        and any(isinstance(p, ast.Constant) and type(p.value) in (int, float) for p in parts)
        and not any(isinstance(part, ast.Call) for part in parts)
    )


def clipped_at_one_end(node: ast.AST) -> bool:
    """Whether numbers made whole are bounded above by `np.minimum` and not below."""
    text = ast.unparse(node)
    return (
        isinstance(node, ast.Call)
        and ast.unparse(node.func) == "np.minimum"
        and ".astype(" in text
        and "uint" not in text
    ) or (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr == "astype"
        and text.startswith("np.minimum(")
        and "uint" not in text
    )


def test_a_class_made_of_a_number_is_bounded_at_both_ends() -> None:
    """Two ways to one float differ in the last bit: the least lies a hair below the first class."""
    one_ended = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in sorted((ROOT / "tirelog").rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if clipped_at_one_end(node)
    ]
    assert one_ended == []


def test_classes_of_speed_are_those_that_there_are() -> None:
    """1e5 speeds in sets of 60; numpy squares by x * x, Python by pow."""
    for seed in range(4000, 5700):
        speed = np.random.default_rng(seed).uniform(3.0, 30.0, 60)
        classes = _classes(speed)
        assert classes.min() == 0
        assert classes[np.argmax(speed)] == classes.max()


def test_what_a_search_tries_is_never_an_exception() -> None:
    """`or_refusal` makes a value of it, which the type checker asks each caller for."""
    caught = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for folder in ("diagnosis", "inference")
        for path in sorted((ROOT / "tirelog" / folder).rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ExceptHandler)
        and any(isinstance(n, ast.Name) and n.id == "ModelError" for n in ast.walk(node))
    ]
    assert caught == []
