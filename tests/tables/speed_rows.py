"""Three rows of the speed table, of a log whose name holds a comma."""

import numpy as np

PART = {
    "quality": np.array(["ok", "gap;spike", "ok"], dtype=object),
    "log": "a, b.csv",
    "channel": "strain_1",
    "revolution": np.array([0, 1, 2]),
    "time_s": np.array([0.1, 1234.5678901234, 1e-7]),
    "speed_m_s": np.array([14.0000000001234, np.nan, 3.0]),
}
