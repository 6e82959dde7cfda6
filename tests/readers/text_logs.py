"""Small text logs for the tests of the text reader."""

import io
from collections.abc import Mapping
from typing import Any

import numpy as np

from tests.readers.logs import Pipe, setup_of
from tirelog.data.setup import Setup
from tirelog.readers.base import RawBlock, without_lost_peaks
from tirelog.readers.text.reader import TextReader, open_text

__all__ = ["Pipe", "joined", "piped", "read", "setup_of"]


def read(
    text: str | bytes, setup: Setup | Mapping[str, Any], log: str = "", **common: Any
) -> tuple[TextReader, RawBlock]:
    """(reader, all its blocks as one); the setup, or what `setup_of` makes it of."""
    data = text.encode() if isinstance(text, str) else text
    setup = setup if isinstance(setup, Setup) else setup_of(setup, log, **common)
    reader = open_text(io.BytesIO(data), setup, "log.csv")
    return reader, joined(list(reader.blocks()), reader)


def piped(data: bytes, setup: Setup) -> tuple[TextReader, RawBlock]:
    """As `read`, of what comes through a pipe."""
    reader = open_text(Pipe(data), setup, "-")
    return reader, joined(list(reader.blocks()), reader)


def joined(blocks: list[RawBlock], reader: TextReader) -> RawBlock:
    """Blocks of a reader after one another, without lost peaks."""
    channels = reader.setup.channels
    starts = np.cumsum([0] + [next(iter(b.values.values())).size for b in blocks])
    return RawBlock(
        blocks[0].group,
        {
            name: without_lost_peaks(
                np.concatenate([b.values[name] for b in blocks]), channels[name]
            )
            for name in blocks[0].values
        },
        None if blocks[0].stamps_s is None else np.concatenate([b.stamps_s for b in blocks]),
        None if blocks[0].number is None else np.concatenate([b.number for b in blocks]),
        tuple(
            (c, a + int(s), z + int(s), w) for b, s in zip(blocks, starts) for c, a, z, w in b.flags
        ),
    )
