"""A table in memory: columns -> pandas DataFrame that knows its units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from tirelog.vocabulary.columns import COLUMNS, OPTIONAL, TABLES


def frame_of(columns: Mapping[str, Any]) -> pd.DataFrame:
    """Columns of one length, scalars repeated, as a DataFrame."""
    rows = max((np.shape(v)[0] for v in columns.values() if np.ndim(v)), default=1)
    return pd.DataFrame(
        {
            name: np.broadcast_to(np.asarray(v), (rows,)) if np.ndim(v) == 0 else v
            for name, v in columns.items()
        }
    )


def whole_frame(name: str, parts: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """The parts of the table `name` as one; without a part its columns without rows.

    `attrs["units"]` and `attrs["descriptions"]` hold unit and meaning of every column, by name.
    """
    if parts:
        frame = pd.concat(parts, ignore_index=True) if len(parts) > 1 else parts[0]
    else:
        frame = pd.DataFrame({c: [] for c in TABLES[name] if c not in OPTIONAL})
    known = [str(c) for c in frame.columns if c in COLUMNS]
    frame.attrs = {
        "units": {c: COLUMNS[c].unit for c in known},
        "descriptions": {c: COLUMNS[c].meaning for c in known},
    }
    return frame
