"""Closed form: gratings of known wavelength in rows that hold a varying number of peaks."""

from itertools import chain

import numpy as np
import pytest

from tests.readers.text_logs import read
from tirelog.errors import SetupError
from tirelog.vocabulary.quality import Quality

REST = {"g0": 1540.0, "g1": 1544.0, "g2": 1548.0, "g3": 1552.0}
N = 4000


def truth(seed):
    """(wavelengths (4, N) that swing by 1.8 nm, which of them are lost)."""
    rng, t, k = np.random.default_rng(seed), np.arange(N) / 1000.0, np.arange(4)[:, None]
    pulse = 1.8 * (-1.0) ** k * np.exp(-((((5 * t + 0.1 * k) % 1) - 0.5) ** 2) / 0.0025)
    rest = np.array(list(REST.values()))[:, None]
    wavelengths = np.round(rest + pulse + 0.001 * rng.standard_normal((4, N)), 4)
    return wavelengths, rng.random((4, N)) < 0.01


def log(peaks, *, counts=False, descending=False, decimal="."):
    """Rows of stamps and peaks; `peaks[row][fibre]`."""
    lines = ["Software 1.2", "Channels\t2", ""] if counts else ["Timestamp\tWL 1[nm]"]
    for i, row in enumerate(peaks):
        fibres = [sorted(f, reverse=descending) for f in row]
        flat = list(chain(*fibres)) if counts else sorted(chain(*fibres), reverse=descending)
        fronts = [str(len(f)) for f in fibres] if counts else []
        cells = [f"{x:.4f}".replace(".", decimal) for x in flat]
        lines.append("\t".join([f"01/02/2020 10:00:{i / 1000:09.6f}", *fronts, *cells]))
    return "\n".join(lines) + "\n"


def gratings(window=False):
    more = {n: {"window_nm": [r - 1.9, r + 1.9]} if window else {} for n, r in REST.items()}
    return {
        n: {"reference_wavelength_nm": r, "source": f"peak of {n}", **more[n]}
        for n, r in REST.items()
    }


def windows(**each):
    return {name: {"source": name, "window_nm": window} for name, window in each.items()}


LAYOUTS = [
    {"counts": True, "decimal": ","},
    {"counts": True, "descending": True},
    {"counts": False},
    {"counts": False, "descending": True},
]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("window", [False, True])
def test_lost_peaks_move_no_other_grating(layout, window):
    wavelengths, lost = truth(1001)
    rows = [
        [[wavelengths[k, i] for k in fibre if not lost[k, i]] for fibre in ((0, 1), (2, 3))]
        for i in range(N)
    ]
    _, block = read(log(rows, **layout), gratings(window))
    for k, name in enumerate(REST):
        np.testing.assert_array_equal(block.values[name], np.where(lost[k], np.nan, wavelengths[k]))
    assert block.flags == ()


@pytest.mark.parametrize("layout", LAYOUTS)
def test_spurious_and_double_peaks_are_refused_and_flagged(layout):
    wavelengths, lost = truth(1002)
    rng = np.random.default_rng(1003)
    rows, strange = [], np.zeros((4, N), bool)
    for i in range(N):
        row = [[wavelengths[k, i] for k in fibre if not lost[k, i]] for fibre in ((0, 1), (2, 3))]
        if rng.random() < 0.02:
            near = wavelengths[1, i] < 1544.5
            row[0].append(round(wavelengths[1, i] + 1.2, 4) if near else 1543.0)
            strange[1, i] = True
        if rng.random() < 0.02 and not lost[2, i]:
            row[1].append(wavelengths[2, i])
            strange[2, i] = True
        rows.append(row)
    _, block = read(log(rows, **layout), gratings())
    for k, name in enumerate(REST):
        got = block.values[name]
        right = (got == wavelengths[k]) | (np.isnan(got) & lost[k])
        # a false peak beside a lost one cannot be told from it
        assert right[~(lost[k] & strange[k])].all()
        flagged = np.zeros(N, bool)
        for channel, start, stop, word in block.flags:
            assert word == Quality.SPURIOUS_PEAK
            flagged[start:stop] |= channel == name
        assert (flagged == strange[k])[~lost[k]].all()


def test_a_false_peak_alone_in_the_window_is_refused():
    rows = [[[1549.0], [1560.0] * (i % 2)] for i in range(100)]
    rows[50][0], rows[51][0] = [1551.6], []
    _, block = read(log(rows), windows(g=[1548.3, 1551.7]))
    assert np.flatnonzero(np.isnan(block.values["g"])).tolist() == [50, 51]
    assert block.flags == (("g", 50, 51, Quality.SPURIOUS_PEAK),)


def test_a_grating_is_followed_out_of_its_window():
    wave = np.round(1550.0 + 2.5 * np.sin(np.arange(1000) / 50.0), 4)
    rows = [[[float(w)], [1560.0] * (i % 2)] for i, w in enumerate(wave)]
    _, block = read(log(rows), windows(g=[1549.0, 1551.0]))
    np.testing.assert_array_equal(block.values["g"], wave)


def test_counts_keep_gratings_of_one_wavelength_apart():
    rows = [[[1550.0 + i / 1000], [1550.5 + i / 1000] * (i % 3 != 0)] for i in range(200)]
    _, block = read(log(rows, counts=True), {"a": "CH1", "b": "CH2"})
    np.testing.assert_allclose(block.values["a"], 1550.0 + np.arange(200) / 1000)
    assert np.isnan(block.values["b"])[::3].all()
    np.testing.assert_allclose(block.values["b"][1::3], 1550.5 + np.arange(200)[1::3] / 1000)


def test_a_wrong_window_says_where_the_peaks_are():
    wavelengths, _ = truth(1004)
    rows = [[list(wavelengths[:2, i]), list(wavelengths[2:, i])[: 1 + i % 2]] for i in range(N)]
    reader, block = read(log(rows), windows(right=[1542.0, 1546.0], wrong=[1570.0, 1572.0]))
    assert np.isnan(block.values["wrong"]).all()
    assert not np.isnan(block.values["right"]).any()
    (said,) = reader.report.losses
    assert said.startswith("channel wrong: no peak between 1570 and 1572 in any row; peaks were ")
    assert "seen at about 1540" in said


def test_windows_of_one_fibre_that_overlap_are_refused():
    one, other = [1548.0, 1551.5], [1550.0, 1553.0]
    rows = [[[1549.0, 1551.0], [1560.0] * (i % 2)] for i in range(20)]
    said = r"window_nm of a and of b overlap between 1550 and 1551\.5"
    with pytest.raises(SetupError, match=said):
        read(log(rows), windows(a=one, b=other))
    apart = log([[[1549.0], [1551.0]] for _ in range(20)], counts=True)
    _, block = read(apart, windows(CH1=one, CH2=other))
    assert (block.values["CH1"] == 1549.0).all()
    assert (block.values["CH2"] == 1551.0).all()
