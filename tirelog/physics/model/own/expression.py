"""A user's formula in a model file.

Parsed into a tree of allowed nodes and computed by walking it, never executed as Python.

Allowed: numbers, names, + - * / ** %, comparisons, `and`/`or`/`not` (also & | ~), `a if c else b`,
and numpy's elementary functions by their plain names. Everything is computed in floating point, so
no exponent grows beyond it.
"""

from __future__ import annotations

import ast
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
    "clip": (2, 3),
}
CONSTANTS = {"pi": np.pi, "e": np.e}
_BINARY: Mapping[type, Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.Mod: np.mod,
    ast.BitAnd: np.logical_and,
    ast.BitOr: np.logical_or,
}
_UNARY: Mapping[type, Callable[..., Any]] = {
    ast.USub: np.negative,
    ast.UAdd: np.positive,
    ast.Not: np.logical_not,
    ast.Invert: np.logical_not,
}
_COMPARE: Mapping[type, Callable[..., Any]] = {
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
    ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
}
_BOOLEAN: Mapping[type, Callable[..., Any]] = {ast.And: np.logical_and, ast.Or: np.logical_or}


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
                allowed="a finite number at every xi and condition is allowed",
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
    for part in _parts(node, text):
        _check(part, text, allowed, names, depth + 1)


def _parts(node: ast.AST, text: str) -> list[ast.expr]:
    """The operands of an allowed node."""
    if (
        isinstance(node, ast.Constant)
        and isinstance(node.value, int | float)
        and not isinstance(node.value, bool)
        and abs(node.value) < 1e300
    ):
        return []
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        return [node.left, node.right]
    if isinstance(node, ast.UnaryOp) and type(node.op) in _UNARY:
        return [node.operand]
    if isinstance(node, ast.BoolOp):
        return node.values
    if isinstance(node, ast.Compare) and all(type(op) in _COMPARE for op in node.ops):
        return [node.left, *node.comparators]
    if isinstance(node, ast.IfExp):
        return [node.test, node.body, node.orelse]
    called = node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""
    if isinstance(node, ast.Call) and called in FUNCTIONS and not node.keywords:
        if len(node.args) not in ARGUMENTS[called]:
            many = " or ".join(map(str, ARGUMENTS[called]))
            raise ModelError(
                f"expression {text!r} gives {called}() {len(node.args)} arguments",
                allowed=f"allowed are {many}",
                do="correct it",
            )
        return node.args  # a starred argument is refused as a node of its own
    what = called or type(node).__name__
    raise ModelError(
        f"expression {text!r} uses {what}, which is not allowed",
        allowed="allowed are finite numbers, names, + - * / ** %, comparisons, and/or/not, a if "
        f"c else b, and the functions {', '.join(FUNCTIONS)}",
        do="write it with these",
    )


def _compute(node: ast.expr, values: Mapping[str, Any]) -> Any:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return np.float64(node.value)
    if isinstance(node, ast.Name):
        return values[node.id] if node.id in values else CONSTANTS[node.id]
    if isinstance(node, ast.BinOp):
        left, right = _compute(node.left, values), _compute(node.right, values)
        return (
            _BINARY[type(node.op)](_float(left), _float(right))
            if not _logical(node.op)
            else _BINARY[type(node.op)](left, right)
        )
    if isinstance(node, ast.UnaryOp):
        operand = _compute(node.operand, values)
        return _UNARY[type(node.op)](
            _float(operand) if isinstance(node.op, ast.USub | ast.UAdd) else operand
        )
    if isinstance(node, ast.BoolOp):
        result = _compute(node.values[0], values)
        for part in node.values[1:]:
            result = _BOOLEAN[type(node.op)](result, _compute(part, values))
        return result
    if isinstance(node, ast.Compare):
        terms = [_compute(part, values) for part in (node.left, *node.comparators)]
        result = np.True_
        for op, left, right in zip(node.ops, terms, terms[1:]):
            result = np.logical_and(result, _COMPARE[type(op)](left, right))
        return result
    if isinstance(node, ast.IfExp):
        return np.where(
            _compute(node.test, values), _compute(node.body, values), _compute(node.orelse, values)
        )
    call: Any = node  # `_check` let nothing but a call of an allowed function through
    arguments = [_compute(part, values) for part in call.args]
    try:
        return FUNCTIONS[call.func.id](*arguments)
    except (TypeError, ValueError):
        raise ModelError(
            f"{call.func.id}() does not take {len(arguments)} arguments",
            allowed=f"as many as numpy's {call.func.id} takes are allowed",
            do="correct the expression",
        ) from None


def _logical(op: ast.operator) -> bool:
    return isinstance(op, ast.BitAnd | ast.BitOr)


def _float(value: Any) -> Any:
    return np.asarray(value, dtype=np.float64)
