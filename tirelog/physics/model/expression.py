"""A user's formula in a model file.

It is parsed into a tree of allowed nodes and computed by walking it, never executed as Python.

Allowed: numbers, names, + - * / ** %, comparisons, `and`/`or`/`not` (also & | ~), `a if c else b`,
and numpy's elementary functions by their plain names. Everything is computed in floating point, so
no exponent grows beyond it.
"""

from __future__ import annotations

import ast
import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tirelog.errors import ModelError, nearest

#: letters of a formula, and how deep it may be nested: far above what a person writes, far below
#: what the parser's own recursion takes
LONGEST, DEEPEST = 1000, 40
_ELEMENTARY: tuple[Callable[..., Any], ...] = (
    np.sin, np.cos, np.tan, np.arcsin, np.arccos, np.arctan, np.arctan2, np.sinh, np.cosh, np.tanh,
    np.arcsinh, np.arccosh, np.arctanh, np.exp, np.exp2, np.expm1, np.log, np.log2, np.log10,
    np.log1p, np.sqrt, np.cbrt, np.square, np.abs, np.sign, np.floor, np.ceil, np.minimum,
    np.maximum, np.where, np.clip, np.hypot, np.heaviside, np.sinc,
)  # fmt: skip
FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    function.__name__: function for function in _ELEMENTARY
} | {"abs": np.abs}
#: how many arguments each takes; a third one of a function of two numbers would be numpy's array to
#: write into
ARGUMENTS = {name: (getattr(function, "nin", 1),) for name, function in FUNCTIONS.items()} | {
    "where": (3,),
    "clip": (3,),
}
CONSTANTS = {"pi": np.pi, "e": np.e}
_OPERATORS: Mapping[type, Callable[..., Any]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide,
    ast.Pow: np.power, ast.Mod: np.mod, ast.USub: np.negative, ast.UAdd: np.positive,
    ast.BitAnd: np.logical_and, ast.BitOr: np.logical_or, ast.Invert: np.logical_not,
    ast.And: np.logical_and, ast.Or: np.logical_or, ast.Not: np.logical_not,
    ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal,
    ast.Eq: np.equal, ast.NotEq: np.not_equal,
}  # fmt: skip


@dataclass(frozen=True)
class Expression:
    """A parsed formula: its text and the names that it reads."""

    text: str
    names: frozenset[str]
    tree: ast.expr

    def __call__(self, values: Mapping[str, Any]) -> np.ndarray:
        """The formula's value if the names have these values (arrays that broadcast).

        ModelError if it is not finite.
        """
        with np.errstate(all="ignore"):
            result = np.asarray(_compute(self.tree, values), dtype=np.float64)
        if not np.isfinite(result).all():
            raise ModelError(
                f"expression {self.text!r} is not finite everywhere",
                allowed="a finite number at every angle and condition is allowed",
                do="guard it with where(), clip() or a comparison",
            )
        return result


def parse_expression(text: str, allowed: frozenset[str] | set[str]) -> Expression:
    """The parsed formula `text` over the `allowed` names.

    ModelError for anything else, with what is allowed.
    """
    if len(text) > LONGEST:
        raise ModelError(
            f"expression of {len(text)} characters",
            allowed=f"up to {LONGEST} are allowed",
            do="shorten it",
        )
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as problem:
        raise ModelError(
            f"expression {text!r} is not a formula ({getattr(problem, 'msg', problem)})",
            allowed="numbers, names, operators and calls are allowed",
            do="correct it",
        ) from None
    names: set[str] = set()
    _check(tree, text, allowed, names, 0)
    return Expression(text, frozenset(names), tree)


def _check(
    node: ast.AST, text: str, allowed: frozenset[str] | set[str], names: set[str], depth: int
) -> None:
    """Refuses every node that is not on the list; collects names."""
    if depth > DEEPEST:
        raise ModelError(
            f"expression {text!r} is nested deeper than {DEEPEST}",
            allowed="a flatter one is allowed",
            do="split it",
        )
    if isinstance(node, ast.Name):
        if node.id not in allowed and node.id not in CONSTANTS:
            raise ModelError(
                f"expression {text!r} uses the name {node.id!r}{nearest(node.id, allowed)}",
                allowed=f"allowed here are {', '.join(sorted(allowed))}, pi, e and the functions "
                f"{', '.join(FUNCTIONS)}",
                do="use one of them",
            )
        names.add(node.id)
        return
    _refuse_other_node(node, text)
    for part in _operands(node):
        _check(part, text, allowed, names, depth + 1)


def _operands(node: ast.AST) -> list[ast.expr]:
    """The operands of a node, in their order."""
    parts = node.args if isinstance(node, ast.Call) else ast.iter_child_nodes(node)
    return [part for part in parts if isinstance(part, ast.expr)]


def _refuse_other_node(node: ast.AST, text: str) -> None:
    """ModelError for any other node than numbers, operators, comparisons, choices, calls."""
    called = node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""
    number = node.value if isinstance(node, ast.Constant) else None
    operators = node.ops if isinstance(node, ast.Compare) else [getattr(node, "op", None)]
    good = (
        isinstance(node, ast.IfExp)
        or (isinstance(number, int | float) and type(number) is not bool and abs(number) < 1e300)
        or (isinstance(node, ast.Call) and called in FUNCTIONS and not node.keywords)
        or all(type(operator) in _OPERATORS for operator in operators)
    )
    if not good:
        what = called or type(node).__name__
        raise ModelError(
            f"expression {text!r} uses {what}, which is not allowed",
            allowed="allowed are finite numbers, names, + - * / ** %, comparisons, and/or/not, a "
            f"if c else b, and the functions {', '.join(FUNCTIONS)}",
            do="write it with these",
        )
    # a starred argument is refused as a node of its own
    if isinstance(node, ast.Call) and len(node.args) not in ARGUMENTS[called]:
        many = " or ".join(map(str, ARGUMENTS[called]))
        raise ModelError(
            f"expression {text!r} gives {called}() {len(node.args)} arguments",
            allowed=f"allowed are {many}",
            do="correct it",
        )


def _compute(node: ast.expr, values: Mapping[str, Any]) -> Any:
    """The value of a part that `_check` let through."""
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return node.value
    if isinstance(node, ast.Name):
        return values[node.id] if node.id in values else CONSTANTS[node.id]
    terms = [np.asarray(_compute(part, values), dtype=np.float64) for part in _operands(node)]
    if isinstance(node, ast.Compare):
        pairs = zip(node.ops, terms, terms[1:])
        return functools.reduce(np.logical_and, (_OPERATORS[type(op)](a, b) for op, a, b in pairs))
    if isinstance(node, ast.BoolOp):
        return functools.reduce(_OPERATORS[type(node.op)], terms)
    if isinstance(node, ast.Call):
        return FUNCTIONS[getattr(node.func, "id", "")](*terms)
    operation = np.where if isinstance(node, ast.IfExp) else _OPERATORS[type(node.op)]
    return operation(*terms)
