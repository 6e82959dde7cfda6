"""Small text logs and their setups for the tests of the text reader."""

import io
from collections.abc import Mapping
from typing import Any

import numpy as np

from tirelog.data.setup import Setup, parse_setup
from tirelog.readers.base import RawBlock, counted_floats
from tirelog.readers.text.parse import Parsed, RowPlan, concatenated_rows, plain_rows
from tirelog.readers.text.reader import TextReader, open_text


def setup_of(channels: Mapping[str, Mapping[str, Any]], log: str = "") -> Setup:
    """A setup of these channels; gratings get a wavelength where they have none."""
    text = "[tire]\nunloaded_radius_m = 0.3\n"
    for name, keys in channels.items():
        keys = {"kind": "fbg_strain", **keys}
        if keys["kind"].startswith("fbg_"):
            keys = {"unit": "nm", "reference_wavelength_nm": 1550.0, **keys}
        text += f"[channels.{name}]\n" + "".join(f"{k} = {_toml(v)}\n" for k, v in keys.items())
    return parse_setup(text + (f"[log]\n{log}\n" if log else ""))


def _toml(value: Any) -> str:
    return (
        f'"{value}"'
        if isinstance(value, str)
        else str(list(value) if isinstance(value, tuple) else value)
    )


class Pipe(io.RawIOBase):
    """A stream that, like a pipe, neither seeks nor gives as much as it is asked for."""

    def __init__(self, data: bytes, most: int = 777) -> None:
        self._data, self._at, self._most = data, 0, most

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return False

    def readinto(self, buffer: Any) -> int:
        part = self._data[self._at : self._at + min(len(buffer), self._most)]
        buffer[: len(part)] = part
        self._at += len(part)
        return len(part)


def read(text: str | bytes, setup: Setup) -> tuple[TextReader, RawBlock]:
    """(reader, all its blocks as one)."""
    data = text.encode() if isinstance(text, str) else text
    reader = open_text(io.BytesIO(data), setup, "log.csv")
    return reader, joined(list(reader.blocks()), reader)


def all_plain(plan: RowPlan, block: bytes) -> tuple[Parsed, int]:
    """(rows that the compiled way reads one pass after the other, byte behind them)."""
    parts, at, careful = [], 0, False
    while at < len(block) and not careful:
        begin = at
        parsed, at, careful = plain_rows(plan, block, at)
        parsed.bad_cells = [
            (block.count(b"\n", 0, begin) + row, what) for row, what in parsed.bad_cells
        ]
        parts.append(parsed)
    return concatenated_rows(parts), at


def joined(blocks: list[RawBlock], reader: TextReader) -> RawBlock:
    """Blocks of a reader after one another, all values as floats."""
    places = reader.groups[0].decimals
    starts = np.cumsum([0] + [next(iter(b.values.values())).size for b in blocks])
    return RawBlock(
        blocks[0].group,
        {
            name: np.concatenate([counted_floats(b.values[name], places[name]) for b in blocks])
            for name in blocks[0].values
        },
        None if blocks[0].stamps_s is None else np.concatenate([b.stamps_s for b in blocks]),
        None if blocks[0].number is None else np.concatenate([b.number for b in blocks]),
        tuple(
            (c, a + int(s), z + int(s), w) for b, s in zip(blocks, starts) for c, a, z, w in b.flags
        ),
    )
