"""Property: the type checker is strict, and what it does not see is said."""

import ast
import re
import tomllib
from pathlib import Path

import pytest

from tests.conftest import group_of
from tests.sources import ROOT, nodes, sources

pytestmark = pytest.mark.xdist_group("sources")  # one worker parses the package, once
#: where an `ignore` hides a mistake in the physics
PIPELINE = ("physics/model/", "physics/moving/")
MOST_IGNORED = 3
#: of tests, as CONTRIBUTING.md has them
KINDS = ("Closed form", "Property", "Literature", "Golden", "Faults")


def ignored() -> list[tuple[str, str]]:
    """(file, line) of everything that the type checker is told not to see."""
    lines = ((file, line) for file, (text, _) in sources().items() for line in text.splitlines())
    return [(file, line) for file, line in lines if "type: ignore" in line]


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
    assert len(said) > 150
    assert [file for file, text in said.items() if not (text or "").startswith(begins)] == []


#: what may have a docstring
TOLD = ast.Module | ast.FunctionDef | ast.ClassDef
#: words in backticks that are of formats and systems, or stand for several names
NOT_OURS = {"Fs", "nohup", "channel_1", "convert_MODULE", "name_se", "benchmarks.calibration"}


def test_a_name_in_a_text_is_one_of_the_code() -> None:
    """A name in backticks, in a docstring or comment, outlives no renaming of what it names."""
    names, texts = {"tirelog"}, {}
    for file, (source, _) in sources().items():
        names.update(Path(file).with_suffix("").parts)
        texts[file] = "\n".join(re.findall(r"#.*", source))
    for file, node in nodes():
        if isinstance(node, TOLD):
            texts[file] += ast.get_docstring(node) or ""
        if isinstance(node, ast.Constant) and len(str(node.value)) < 80:
            names.update(re.findall(r"\w+", str(node.value)))
        for field in ("id", "attr", "arg", "name", "module"):
            names.update(str(getattr(node, field, "")).split("."))
    names |= {name.lower() for name in names if name.isupper()}
    wrong = {
        (file, name)
        for file, text in texts.items()
        for name in re.findall(r"`([A-Za-z_][\w.]*)`", text)
        if name not in NOT_OURS and not names.issuperset(name.split("."))
    }
    assert wrong == set()


def test_every_number_of_a_module_says_what_it_is() -> None:
    """A constant with a number in it, or the line of constants that it stands in, has a comment."""
    bare = []
    for file, (text, tree) in sources().items():
        lines = text.splitlines()
        for node in tree.body:
            if isinstance(node, ast.Assign | ast.AnnAssign) and _is_a_number(node):
                above = node.lineno - 2
                while lines[above] and not lines[above].startswith(("#", "def ", "class ")):
                    above -= 1
                own = lines[node.lineno - 1 : node.end_lineno]
                if not lines[above].startswith("#") and not any("# " in line for line in own):
                    bare.append(f"{file}:{node.lineno}: {own[0]}")
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
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
        return False
    if node.func.attr not in ("minimum", "astype"):
        return False
    text = ast.unparse(node)
    return text.startswith("np.minimum(") and ".astype(" in text and "uint" not in text


def test_a_class_made_of_a_number_is_bounded_at_both_ends() -> None:
    """Two ways to one float differ in the last bit: the least lies a hair below the first class."""
    assert [f"{file}:{node.lineno}" for file, node in nodes() if clipped_at_one_end(node)] == []


def test_what_a_search_tries_is_never_an_exception() -> None:
    """`or_refusal` makes a value of it, which the type checker asks each caller for."""
    caught = [
        f"{file}:{node.lineno}"
        for file, node in nodes()
        if isinstance(node, ast.ExceptHandler)
        and file.startswith(("diagnosis/", "inference/"))
        and any(isinstance(n, ast.Name) and n.id == "ModelError" for n in ast.walk(node))
    ]
    assert caught == []
