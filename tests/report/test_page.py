"""Property: the page is one file that forbids all else; its numbers are the tables'."""

import base64
import json
import re

import numpy as np
import pandas as pd
import pytest

from tests.report.conftest import HOSTILE
from tirelog.cli import run


def data(page):
    found = re.search(
        r'<script type="application/json" id="data">(.*?)</script>', page.read_text(), re.S
    )
    assert found
    return json.loads(found[1])


def numbers(packed):
    return np.frombuffer(base64.b64decode(packed["bdata"]), "<f4")


@pytest.mark.parametrize(
    ("figure", "trace", "table", "column", "factor"),
    [
        ("speed-0", 0, "speed", "speed_m_s", 1.0),
        ("speed-1", 0, "speed", "acceleration_m_s2", 1.0),
        ("footprint-3", 0, "footprint", "length_m", 1e3),
        ("footprint-3", 1, "footprint", "length_d2_m", 1e3),
        ("dissipation-0", 1, "dissipation", "dissipation_factor_1_m", 1.0),
    ],
)
def test_the_page_s_numbers_are_the_table_s(page_file, figure, trace, table, column, factor):
    rows = pd.read_csv(page_file.parent / f"{table}.csv")
    rows = rows[rows["quality"] == "ok"]
    drawn = data(page_file)["figures"][figure]["traces"][trace]
    np.testing.assert_allclose(numbers(drawn["y"]), rows[column] * factor, rtol=1e-6)
    assert len(rows) > 5


def test_given_tables_make_the_same_page(page_file):
    folder = page_file.parent
    log, fit = str(folder / "log.csv"), str(folder / "fit.csv")
    assert run(["dissipation", log, "--fit", "-o", fit, "--quiet"]) == 0
    names = ("speed", "footprint", "dissipation", "fit")
    tables = [word for name in names for word in ("--table", str(folder / f"{name}.csv"))]
    assert run(["report", log, *tables, "-o", str(folder / "given.html"), "--quiet"]) == 0
    ours, given = data(page_file)["figures"], data(folder / "given.html")["figures"]
    assert ours.keys() == given.keys()
    for name in ours:
        for a, b in zip(ours[name]["traces"], given[name]["traces"], strict=True):
            y = numbers(a["y"])
            # one passage is cut out at the table's rounded time; a line through one speed hangs on
            # the difference of two numbers, of which text keeps nine digits
            peak = float(np.abs(y[np.isfinite(y)]).max(initial=0.0))
            rtol = 1e-4 if a["name"].endswith("fitted line") else 1e-6
            np.testing.assert_allclose(y, numbers(b["y"]), rtol=rtol, atol=1e-6 * peak)


def test_no_peak_of_the_signal_vanishes(page_file):
    log = pd.read_csv(page_file.parent / "log.csv")
    strain = 1.27 * (log["CH1"] - 1550) / 1550 * 1e6
    figures = data(page_file)["figures"]
    drawn = next(f for name, f in figures.items() if name.startswith("signal-"))
    y = numbers(drawn["traces"][0]["y"])
    assert y.min() == pytest.approx(strain.min(), rel=1e-5)
    assert y.max() == pytest.approx(strain.max(), rel=1e-5)


def test_one_file_with_a_policy_and_nothing_from_outside(page_file):
    text = page_file.read_text()
    assert "default-src 'none'" in text
    assert not re.search(r'(src|href)="https?://', text)
    assert HOSTILE not in text
    assert len(text.encode()) < 8e6


def test_what_cannot_be_shown_is_named_with_its_command(page_file):
    assert re.search(r"phase-shift: no channel for it: <code>tirelog info", page_file.read_text())
