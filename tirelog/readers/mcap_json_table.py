"""JSON messages of one shape as a table of numbers: the fast way for what a logger writes, the same fields again and again.

    messages --same skeleton as the first?--> brackets, quotes, blanks deleted, ':' to ',' --> rows of a CSV table --> Column per want

    {"wl": [1550.1, 1551.2], "n": 3}   ->   wl,1550.1,1551.2,n,3        skeleton  {"wl":[,],"n":}

The skeleton is the text without what numbers are written with, so equal skeletons mean equal cells.  Names may hold digits: where they do,
their cells are compared too.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.readers.mcap_source import FieldError, Want, is_list

if TYPE_CHECKING:
    from tirelog.readers.mcap_decode import Column

#: what numbers are written with; names are compared apart where they hold any of it
NUMERIC = b"0123456789.+-eE"
STRUCTURE = b' \t{}[]"'
TO_COMMA = bytes.maketrans(b":", b",")
SPECIAL = frozenset("\\,:{}[]\"'\t\r\n ")
MOST_CELLS = 4096


@dataclass(frozen=True)
class _Cell:
    """A number of the template: which cell of its row it is."""

    number: int


@dataclass(frozen=True)
class Shape:
    """The cells of one message, `names` those that have to be compared, and for each want its cells (True: a batch)."""

    skeleton: bytes
    width: int
    names: dict[int, str]
    wanted: list[tuple[list[int], bool]]


def shape_of(message: bytes, wants: list[Want]) -> Shape | None:
    """The shape of `message`; None where it cannot be read as a row."""
    try:
        walk = _Walk()
        template = walk.value(json.loads(message, object_pairs_hook=_unlike))
        wanted = [_cells(template, want) for want in wants]
    except (ValueError, RecursionError):
        return None
    row = _row(message).split(b",")
    if len(row) != walk.cells or any(row[at] != name.encode() for at, name in walk.names.items()):
        return None
    numeric = set(NUMERIC.decode())
    return Shape(_skeleton(message), walk.cells, {at: name for at, name in walk.names.items() if set(name) & numeric}, wanted)


class _Walk:
    """Counts the cells of a message's row, and replaces its numbers by cells."""

    def __init__(self) -> None:
        self.cells = 0
        self.names: dict[int, str] = {}

    def value(self, value: Any) -> Any:
        """`value` with its numbers replaced.  ValueError where it is too large, or has names or texts that a row would tear apart."""
        if self.cells > MOST_CELLS:
            raise ValueError
        if isinstance(value, dict) and value:
            return {name: self.named(name, below) for name, below in value.items()}
        if isinstance(value, list) and value:
            return [self.value(below) for below in value]
        self.cells += 1
        if isinstance(value, int | float) and not isinstance(value, bool):
            return _Cell(self.cells - 1)
        if isinstance(value, str):
            _plain(value)
        return value

    def named(self, name: str, value: Any) -> Any:
        self.names[self.cells] = _plain(name)
        self.cells += 1
        return self.value(value)


def _plain(text: str) -> str:
    if SPECIAL & set(text) or not text.isascii():
        raise ValueError
    return text


def _unlike(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len({name for name, _ in pairs}) != len(pairs):
        raise ValueError
    return dict(pairs)


def _cells(template: Any, want: Want) -> tuple[list[int], bool]:
    """The cells that a want reads; ValueError where one is no number of the template."""
    at: Any = template
    for k, token in enumerate(want.tokens):
        if isinstance(token, slice):
            if k != len(want.tokens) - 1 or not is_list(at):
                raise FieldError("is no plain list")
            return [_number(item) for item in at[token]], True
        inside = token in at if isinstance(at, dict) else isinstance(at, list) and isinstance(token, int) and token < len(at)
        if not inside:
            raise FieldError("is not there")
        at = at[token]
    return [_number(at)], False


def _number(value: Any) -> int:
    if not isinstance(value, _Cell):
        raise FieldError("is no number")
    return value.number


def _skeleton(text: bytes) -> bytes:
    text = text.replace(b"null", b"") if b"null" in text else text
    return text.translate(None, NUMERIC)


def _row(text: bytes) -> bytes:
    return text.translate(TO_COMMA, STRUCTURE)


def read_table(text: bytes, n: int, shape: Shape) -> list[Column] | None:
    """The columns of `n` messages, one a line of `text`; None where they have not all this shape."""
    import pyarrow as pa
    import pyarrow.csv

    from tirelog.readers.mcap_decode import Column

    if _skeleton(text) + b"\n" != (shape.skeleton + b"\n") * n:
        return None
    used = sorted({cell for cells, _ in shape.wanted for cell in cells})
    types = {**{f"f{cell}": pa.float64() for cell in used}, **{f"f{cell}": pa.string() for cell in shape.names}}
    rows = _row(text)
    try:
        table = pyarrow.csv.read_csv(
            pa.BufferReader(rows),
            read_options=pyarrow.csv.ReadOptions(use_threads=False, block_size=len(rows) + 1, autogenerate_column_names=True),
            parse_options=pyarrow.csv.ParseOptions(quote_char=False, escape_char=False, ignore_empty_lines=False),
            convert_options=pyarrow.csv.ConvertOptions(include_columns=list(types), column_types=types, null_values=["null"]),
        )
    except pa.ArrowException:
        return None
    if table.num_rows != n:
        return None
    for cell, name in shape.names.items():
        texts = table.column(f"f{cell}").combine_chunks()
        if texts.unique().to_pylist() != [name]:
            return None
    numbers = {cell: table.column(f"f{cell}").to_numpy() for cell in used}
    return [
        Column(np.stack([numbers[c] for c in cells], axis=1).ravel() if cells else np.zeros(0), np.full(n, len(cells)))
        if batch
        else Column(numbers[cells[0]])
        for cells, batch in shape.wanted
    ]
