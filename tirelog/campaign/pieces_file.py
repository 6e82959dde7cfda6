"""Pieces of a log as bytes.

Arrays by name, numbers and text only, nothing that is executed when it is read.

Pieces -> .npz (uncompressed) -> Pieces, equal to the bit
"""

from __future__ import annotations

import io
import json
from dataclasses import fields
from typing import Any
from zipfile import BadZipFile

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.inference.cells.pieces import Pieces
from tirelog.storage.documents import json_value

_WORDS = ("observable", "channel", "surface", "radius_m", "logs", "notes")


def pieces_bytes(pieces: Pieces) -> bytes:
    """The content of a file that holds the pieces."""
    arrays: dict[str, Any] = {
        f.name: getattr(pieces, f.name)
        for f in fields(Pieces)
        if f.name not in (*_WORDS, "conditions")
    }
    arrays |= {
        f"conditions.{f.name}": getattr(pieces.conditions, f.name) for f in fields(Conditions)
    }
    arrays["words"] = np.array(json.dumps({name: getattr(pieces, name) for name in _WORDS}))
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def read_pieces(data: bytes) -> Pieces:
    """The pieces in a file.  ValueError: it is none."""
    try:
        return _pieces(data)
    except (KeyError, TypeError, AttributeError, OSError, EOFError, BadZipFile) as problem:
        raise ValueError(str(problem)) from None


def _pieces(data: bytes) -> Pieces:
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        words = json_value(str(arrays["words"]))
        conditions = Conditions(
            **{f.name: arrays[f"conditions.{f.name}"] for f in fields(Conditions)}
        )
        rows = {
            f.name: arrays[f.name] for f in fields(Pieces) if f.name not in (*_WORDS, "conditions")
        }
    return Pieces(
        **{**words, "logs": tuple(words["logs"]), "notes": tuple(words["notes"])},
        conditions=conditions,
        **rows,
    )
