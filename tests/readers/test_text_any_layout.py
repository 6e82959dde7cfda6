"""Property: any mixture of layouts of a text log reads back the same numbers."""

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.readers.text_logs import read

STAMPS = {
    "none": None,
    "seconds": lambda i, dec: f"{i / 2500:.4f}".replace(".", dec),
    "iso": lambda i, dec: f"2022-04-14T23:59:{59 - 30 + i / 2500:07.4f}",
    "iso, comma": lambda i, dec: f"2022-04-14 13:00:{i / 2500:07.4f}".replace(".", dec),
    "day first": lambda i, dec: f"14/04/2022 13:00:{i / 2500:09.6f}",
    "dashes": lambda i, dec: f"14-04-2022 13:00:{i / 2500:08.5f} ",
    "epoch": lambda i, dec: f"{1649934000 + i // 2500}{dec}{i % 2500 * 4:04d}",
}
PREAMBLES = [
    "",
    "Logger 3.1\n",
    "Serial\t12\nChannels;4\n\n",
    "# comment, with commas, 1, 2\n" * 40,
    "Name: x\nStart: 2022-04-14 13:00:00\nRate 2500 Hz\n",
]


@st.composite
def layouts(draw):
    separator = draw(st.sampled_from([",", ";", "\t", ", ", " "]))
    quotes = draw(st.sampled_from(["no", "where needed", "around all"]))
    commas = separator in (";", "\t") or (separator == "," and quotes != "no")
    decimal = draw(st.sampled_from([".", ","])) if commas else "."
    stamps = draw(
        st.sampled_from(
            [name for name in STAMPS if separator != " " or name in ("none", "seconds", "epoch")]
        )
    )
    return {
        "separator": separator,
        "decimal": decimal,
        "stamps": stamps if not (separator.startswith(",") and "comma" in stamps) else "iso",
        "quotes": quotes if separator != " " else "no",
        "header": draw(st.booleans()),
        "units": draw(st.sampled_from(["no", "row", "suffix"])),
        "preamble": draw(st.sampled_from(PREAMBLES)),
        "trailing": separator in (";", "\t") and draw(st.booleans()),
        "encoding": draw(st.sampled_from(["utf-8", "utf-8-sig", "cp1252"])),
        "end": draw(st.sampled_from(["\n", "\r\n"])),
        "last_end": draw(st.booleans()),
        "rows": draw(st.integers(3, 30)),
        "lost": draw(st.sampled_from(["", "NaN", "0", "-1"])) if separator != " " else "0",
    }


def written(layout, values):
    """The log of `values`, shape (rows, 3), NaN where lost."""
    stamp, decimal = STAMPS[layout["stamps"]], layout["decimal"]
    rows = []
    if layout["header"]:
        names, units = ["A", "Bé", "C"], ["nm", "nm", "nm"]
        if layout["units"] == "suffix":
            names = [f"{name}[nm]" for name in names]
        rows.append(["t_stamp"] * (stamp is not None) + names)
        if layout["units"] == "row" and layout["separator"] != " ":
            rows.append(["s"] * (stamp is not None) + units)
    for i, row in enumerate(values):
        cells = [layout["lost"] if np.isnan(x) else f"{x:.4f}".replace(".", decimal) for x in row]
        rows.append(([stamp(i, decimal)] if stamp else []) + cells)
    if layout["quotes"] != "no":
        everywhere = layout["quotes"] == "around all"
        rows = [[f'"{c}"' if everywhere or "," in c else c for c in row] for row in rows]
    end = layout["separator"] * layout["trailing"]
    text = layout["preamble"] + "\n".join(layout["separator"].join(row) + end for row in rows)
    text += "\n" * layout["last_end"]
    return text.replace("\n", layout["end"]).encode(layout["encoding"])


#: three rows of quoted times that end in a blank, under words: blanks seemed to separate cells
QUOTED_TIMES = {
    "separator": "\t", "decimal": ".", "stamps": "dashes", "quotes": "around all", "header": True,
    "units": "row", "preamble": "Logger 3.1\n", "trailing": False, "encoding": "utf-8",
    "end": "\n", "last_end": False, "rows": 3, "lost": "NaN",
}  # fmt: skip


@given(layouts(), st.integers(0, 10**6))
@example(QUOTED_TIMES, 62637)
@settings(max_examples=200, deadline=None)
def test_any_layout(layout, seed):
    rng = np.random.default_rng(seed)
    values = np.round(1550 + rng.standard_normal((layout["rows"], 3)), 4)
    values[rng.random(values.shape) < 0.1] = np.nan
    values[:3] = np.round(1550 + rng.standard_normal((3, 3)), 4)
    if not layout["last_end"] and layout["lost"] == "" and not layout["trailing"]:
        values[-1, 2] = 1550.1234  # blank at the very end, it would be a row that is cut off
    first = 1 + (layout["stamps"] != "none")
    names = ["A", "Bé", "C"] if layout["header"] else [f"#{first + k}" for k in range(3)]
    reader, block = read(written(layout, values), {f"c{k}": name for k, name in enumerate(names)})
    for k in range(3):
        np.testing.assert_array_equal(block.values[f"c{k}"], values[:, k])
    assert reader.report.losses == []
    if layout["stamps"] == "none":
        assert block.stamps_s is None
    else:
        wanted = np.arange(layout["rows"]) / 2500
        np.testing.assert_allclose(block.stamps_s, wanted, rtol=0, atol=1e-9)
