"""Do the units of a formula agree?  By walking it, with unknown units as any.

    formula, units of its names -> the dimension (m, kg, s, K) of every part
        -> '' or the part that does not fit, in words

A parameter whose unit is not known fits anywhere, and so does a plain number that is added, is
compared or divides (speed / 20); a plain factor is a number.
Powers of ten are not looked at: km and mm are lengths.
"""

from __future__ import annotations

import ast
import functools
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tirelog.errors import ModelError, nearest
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.conditions import CONDITIONS

# ---- A user's formula in a model file.
#
# Parsed into a tree of allowed nodes and computed by walking it, never executed as Python.
#
# Allowed: numbers, names, + - * / ** %, comparisons, `and`/`or`/`not` (also & | ~), `a if c else
# b`,
# and numpy's elementary functions by their plain names. Everything is computed in floating point,
# so
# no exponent grows beyond it.


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


def _operation(node: Any) -> Callable[..., Any]:
    """The operation of a part on its operands; a choice is numpy's where()."""
    if isinstance(node, ast.Call):
        return FUNCTIONS[getattr(node.func, "id", "")]
    return np.where if isinstance(node, ast.IfExp) else _OPERATORS[type(node.op)]


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
    return _operation(node)(*terms)


#: units by their powers of m, kg, s, K
BASE: Mapping[str, tuple[float, float, float, float]] = {
    "1": (0, 0, 0, 0), "rad": (0, 0, 0, 0), "m": (1, 0, 0, 0), "mm": (1, 0, 0, 0),
    "km": (1, 0, 0, 0), "kg": (0, 1, 0, 0), "s": (0, 0, 1, 0), "Hz": (0, 0, -1, 0),
    "K": (0, 0, 0, 1), "N": (1, 1, -2, 0), "Pa": (-1, 1, -2, 0), "J": (2, 1, -2, 0),
}  # fmt: skip
_SYMBOLS = ("m", "kg", "s", "K")
#: units of the places that an expression may read
PLACE_UNITS = {"xi": "m", "phi": "rad", "L": "m", "R": "m", "load": "N"}
#: units of what an expression may act on; what is not here has the observable's
RESULT_UNITS = {
    "contact_pressure": "N/m",
    "foundation_stiffness": "N/m^2",
    "strain": "1",
    "load": "N",
    "sensor": "1",
    "radial_acceleration": "m/s^2",
}
#: what an operation makes of its operands' units: operands alike and a result as they are; a number
#: of a number; a product and a quotient; a power, fixed or as it is given. Of others it is a number
_ALIKE, _OF_NUMBER, _PRODUCT, _QUOTIENT, _POWER = "alike", "number", "product", "quotient", "power"
_RULES: Mapping[Callable[..., Any], str | float] = {
    **dict.fromkeys((np.add, np.subtract, np.mod, np.negative, np.positive, np.where), _ALIKE),
    **dict.fromkeys((np.abs, np.minimum, np.maximum, np.clip, np.hypot), _ALIKE),
    **dict.fromkeys((np.floor, np.ceil, np.arctan2), _ALIKE),
    **dict.fromkeys((np.sin, np.cos, np.tan, np.arcsin, np.arccos, np.arctan), _OF_NUMBER),
    **dict.fromkeys((np.sinh, np.cosh, np.tanh, np.arcsinh, np.arccosh, np.arctanh), _OF_NUMBER),
    **dict.fromkeys((np.exp, np.exp2, np.expm1, np.sinc), _OF_NUMBER),
    **dict.fromkeys((np.log, np.log2, np.log10, np.log1p), _OF_NUMBER),
    np.multiply: _PRODUCT,
    np.divide: _QUOTIENT,
    np.power: _POWER,
    np.sqrt: 0.5,
    np.cbrt: 1.0 / 3.0,
    np.square: 2.0,
}
#: dimensions that differ by less than this are one
_SAME = 1e-9


def dimension_of(unit: str) -> FloatArray | None:
    """Powers of m, kg, s, K of a unit such as `N/m^2` or `1/s`; None if it is not known."""
    total = np.zeros(4)
    for i, part in enumerate(unit.replace("*", " ").split("/")):
        if not part.split():
            return None
        for symbol in part.split():
            name, raised, power = symbol.partition("^")
            if name not in BASE or (raised and not re.fullmatch(r"-?\d+(\.\d+)?", power)):
                return None
            total += (1.0 if i == 0 else -1.0) * float(power or 1.0) * np.array(BASE[name])
    return total


def said(dimension: FloatArray) -> str:
    """A dimension in words: `m s^-1`, `a number`."""
    parts = [
        symbol if power == 1.0 else f"{symbol}^{power:.3g}"
        for symbol, power in zip(_SYMBOLS, dimension.tolist(), strict=True)
        if abs(power) > _SAME
    ]
    return " ".join(parts) or "a number"


class _Disagreement(Exception):
    """A part of a formula whose units do not agree."""


_NUMBER = np.zeros(4)
#: units of names, by their powers (4,); None for one that is not known and fits anywhere
_Units = Mapping[str, FloatArray | None]


def _dimension(node: ast.expr, units: _Units) -> FloatArray | None:
    """The dimension (4,) of a part; None if it may have any.

    _Disagreement: its own parts do not fit.
    """
    if isinstance(node, ast.Name):
        return _NUMBER if node.id in CONSTANTS else units.get(node.id)
    parts = _operands(node)
    found = [_dimension(part, units) for part in parts]
    if _value(node) is not None or isinstance(node, ast.BoolOp):
        return _NUMBER
    if isinstance(node, ast.Compare):
        _one_dimension(node, parts, found)
        return _NUMBER
    operation = _operation(node)
    rule = _RULES.get(operation)
    if rule == _ALIKE:
        first = 1 if operation is np.where else 0
        alike = _one_dimension(node, parts[first:], found[first:])
        return _NUMBER if operation is np.arctan2 else alike
    if rule == _OF_NUMBER:
        _refuse_dimension(f"{operation.__name__}() of", parts[0], found[0])
    if rule == _POWER:
        _refuse_dimension("a power of", parts[1], found[1])
        rule = _value(parts[1])
        if rule is None:
            _refuse_dimension("a fitted power of", parts[0], found[0])
    if isinstance(rule, float):
        return None if found[0] is None else rule * found[0]
    if rule not in (_PRODUCT, _QUOTIENT):
        return _NUMBER
    left, right = found
    if left is None or right is None or (rule == _QUOTIENT and _value(parts[1]) is not None):
        return None
    return left + right if rule == _PRODUCT else left - right


def _one_dimension(
    whole: ast.expr, parts: list[ast.expr], found: list[FloatArray | None]
) -> FloatArray | None:
    """The one dimension of some parts; plain numbers take it."""
    told = [f for part, f in zip(parts, found) if f is not None and _value(part) is None]
    for other in told[1:]:
        if np.abs(told[0] - other).max() > _SAME:
            raise _Disagreement(f"{ast.unparse(whole)} mixes {said(told[0])} and {said(other)}")
    return told[0] if told else None


def _refuse_dimension(what: str, part: ast.expr, found: FloatArray | None) -> None:
    """_Disagreement: the part is no number."""
    if found is not None and np.abs(found).max() > _SAME:
        raise _Disagreement(f"{what} {ast.unparse(part)}, which is {said(found)} and no number")


def _value(node: ast.expr) -> float | None:
    """The number of a node, with its sign; None for anything else."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        inner = _value(node.operand)
        return None if inner is None else inner * (-1.0 if isinstance(node.op, ast.USub) else 1.0)
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return float(node.value)
    return None


def disagreement(text: str, units: Mapping[str, str], result: str) -> str:
    """'' if the units of a formula agree, else the part that does not fit.

    `units` of its parameters by name, "" for one that is not known; `result`: the unit of the
    whole. The formula is one that `parse_expression` let through.
    """
    names = PLACE_UNITS | {c.symbol: c.unit for c in CONDITIONS.values()} | dict(units)
    tree = ast.parse(text.strip(), mode="eval").body
    try:
        known = {name: dimension_of(unit) if unit else None for name, unit in names.items()}
        whole = _dimension(tree, known) if _value(tree) is None else None
    except _Disagreement as problem:
        return str(problem)
    wanted = dimension_of(result)
    if wanted is None or whole is None or np.abs(whole - wanted).max() < _SAME:
        return ""
    return f"the whole is {said(whole)}, and {said(wanted)} is wanted"
