"""Setups, streams and whole logs for the tests of every reader."""

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.data.setup import Setup, parse_setup
from tirelog.readers.base import LogReader, without_lost_peaks


def setup_of(
    channels: Mapping[str, str | Mapping[str, Any]], log: str = "", **common: Any
) -> Setup:
    """A setup of channels, each by its source or by its own keys, beside those `common` to all."""
    text = "[tire]\nunloaded_radius_m = 0.3\n"
    for name, own in channels.items():
        keys = {
            "kind": "fbg_strain",
            **common,
            **({"source": own} if isinstance(own, str) else own),
        }
        if keys["kind"].startswith("fbg_"):
            keys = {"unit": "nm", "reference_wavelength_nm": 1550.0, **keys}
        lines = (f"{key} = {json.dumps(value)}\n" for key, value in keys.items())
        text += f"[channels.{name}]\n" + "".join(lines)
    return parse_setup(text + (f"[log]\n{log}\n" if log else ""))


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


def whole(reader: LogReader) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], list[tuple]]:
    """(values per channel without lost peaks, stamps per group, flags) of all blocks."""
    values: dict[str, list[np.ndarray]] = {}
    stamps: dict[str, list[np.ndarray]] = {}
    flags: list[tuple] = []
    for block in reader.blocks():
        sizes = {part.size for part in block.values.values()}
        if block.stamps_s is not None:
            stamps.setdefault(block.group, []).append(block.stamps_s)
            sizes.add(block.stamps_s.size)
        assert len(sizes) == 1
        flags += block.flags
        for name, part in block.values.items():
            values.setdefault(name, []).append(part)
    joined = [{k: np.concatenate(v) for k, v in parts.items()} for parts in (values, stamps)]
    channels = reader.setup.channels
    return {k: without_lost_peaks(v, channels[k]) for k, v in joined[0].items()}, joined[1], flags


def flip(path: Path, at: int, bit: int = 3) -> None:
    """Turns one bit of the byte `at` of a file."""
    content = bytearray(path.read_bytes())
    content[at] ^= 1 << bit
    path.write_bytes(content)


def spoilt(data: bytes, rng: np.random.Generator, first: int = 0, stop: int | None = None) -> bytes:
    """The bytes with one to three bits turned in [first, stop); some are cut off."""
    found = bytearray(data)
    for at in rng.integers(first, min(stop or len(found), len(found)), int(rng.integers(1, 4))):
        found[at] ^= 1 << int(rng.integers(8))
    if rng.random() < 0.4:
        del found[int(rng.integers(1, len(found))) :]
    return bytes(found)
