"""Compiled: the numbers of messages that are alike but for their numbers."""

from __future__ import annotations

import numpy as np

from tirelog.readers.text.digits import Bytes, as_float, digits_number
from tirelog.runtime import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray


@compiled
def numbers_between(
    data: Bytes,
    starts: IntArray,
    sizes: IntArray,
    texts: Bytes,
    edges: IntArray,
    slots: IntArray,
    values: FloatArray,
) -> int:
    """Reads message i, `data[starts[i] : starts[i] + sizes[i]]`, into values[:, i]; how many until
    one is not alike, or not read so easily.

    Text k of a message is `texts[edges[k] : edges[k + 1]]`, and number k stands behind it: it goes
    to values[slots[k]] (-1: nowhere). `null` is NaN. The last text is not empty and no part of a
    number, so that no number runs past its message.
    """
    for i in range(starts.size):
        at, end = starts[i], starts[i] + sizes[i]
        if at == end or data[end - 1] != texts[texts.size - 1]:
            return i
        for k in range(edges.size - 1):
            length = edges[k + 1] - edges[k]
            if at + length > end:
                return i
            for place in range(length):
                if data[at + place] != texts[edges[k] + place]:
                    return i
            at += length
            if k == slots.size:
                break
            if (
                at + 4 < end
                and data[at] == 110
                and data[at + 1] == 117
                and data[at + 2] == 108
                and data[at + 3] == 108
            ):
                value, at = np.nan, at + 4
            elif at == end or data[at] == 43:
                return i
            else:
                m, e, stop = digits_number(data, at, 46)
                value, good = as_float(m, e, data[at] == 45)
                if stop < 0 or (slots[k] >= 0 and not good):
                    return i
                at = stop
            if slots[k] >= 0:
                values[slots[k], i] = value
        if at != end:
            return i
    return starts.size
