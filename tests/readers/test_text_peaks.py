"""Closed form: gratings of known wavelength in rows that hold a varying number of peaks."""

from itertools import chain

import numpy as np
import pytest

from tirelog.errors import SetupError
from tirelog.vocabulary.quality import Quality

from .text_logs import read, setup_of

REST = {"g0": 1540.0, "g1": 1544.0, "g2": 1548.0, "g3": 1552.0}
N = 4000


def truth(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(wavelengths (4, N) that swing by 1.8 nm, which of them are lost)."""
    rng, t = np.random.default_rng(seed), np.arange(N) / 1000.0
    pulse = np.array(
        [
            1.8 * (-1) ** k * np.exp(-((((5 * t + 0.1 * k) % 1) - 0.5) ** 2) / 0.0025)
            for k in range(4)
        ]
    )
    return np.round(
        np.array(list(REST.values()))[:, None] + pulse + 0.001 * rng.standard_normal((4, N)), 4
    ), rng.random((4, N)) < 0.01


def log(
    peaks: list[list[list[float]]], *, counts: bool, descending: bool = False, decimal: str = "."
) -> str:
    """Rows of stamps and peaks; `peaks[row][fibre]`."""
    lines = ["Software 1.2", "Channels\t2", ""] if counts else ["Timestamp\tWL 1[nm]"]
    for i, row in enumerate(peaks):
        fibres = [sorted(f, reverse=descending) for f in row]
        flat = list(chain(*fibres)) if counts else sorted(chain(*fibres), reverse=descending)
        fronts = [str(len(f)) for f in fibres] if counts else []
        cells = [
            f"01/02/2020 10:00:{i / 1000:09.6f}",
            *fronts,
            *(f"{x:.4f}".replace(".", decimal) for x in flat),
        ]
        lines.append("\t".join(cells))
    return "\n".join(lines) + "\n"


def setup(window: bool = False, fibres: bool = False):
    more = {n: {"window_nm": [r - 1.9, r + 1.9]} if window else {} for n, r in REST.items()}
    source = {n: f"CH{1 + k // 2}" if fibres else f"peak of {n}" for k, n in enumerate(REST)}
    return setup_of(
        {n: {"reference_wavelength_nm": r, "source": source[n], **more[n]} for n, r in REST.items()}
    )


LAYOUTS = [
    {"counts": True, "decimal": ","},
    {"counts": True, "descending": True},
    {"counts": False},
    {"counts": False, "descending": True},
]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("window", [False, True])
def test_lost_peaks_move_no_other_grating(layout: dict, window: bool) -> None:
    wavelengths, lost = truth(1001)
    rows = [
        [[wavelengths[k, i] for k in fibre if not lost[k, i]] for fibre in ((0, 1), (2, 3))]
        for i in range(N)
    ]
    reader, block = read(log(rows, **layout), setup(window))
    for k, name in enumerate(REST):
        np.testing.assert_array_equal(block.values[name], np.where(lost[k], np.nan, wavelengths[k]))
    assert block.flags == ()
    assert reader.groups[0].decimals == dict.fromkeys(REST, 4)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_spurious_and_double_peaks_are_refused_and_flagged(layout: dict) -> None:
    wavelengths, lost = truth(1002)
    rng = np.random.default_rng(1003)
    rows, strange = [], np.zeros((4, N), bool)
    for i in range(N):
        row = [[wavelengths[k, i] for k in fibre if not lost[k, i]] for fibre in ((0, 1), (2, 3))]
        if rng.random() < 0.02:
            row[0].append(
                round(wavelengths[1, i] + 1.2, 4) if wavelengths[1, i] < 1544.5 else 1543.0
            )
            strange[1, i] = True
        if rng.random() < 0.02 and not lost[2, i]:
            row[1].append(wavelengths[2, i])
            strange[2, i] = True
        rows.append(row)
    _, block = read(log(rows, **layout), setup())
    for k, name in enumerate(REST):
        got = block.values[name]
        right = (got == wavelengths[k]) | (np.isnan(got) & lost[k])
        assert right[
            ~(lost[k] & strange[k])
        ].all()  # a false peak beside a lost one cannot be told from it
        flagged = np.zeros(N, bool)
        for channel, start, stop, word in block.flags:
            if channel == name:
                assert word == Quality.SPURIOUS_PEAK
                flagged[start:stop] = True
        assert (flagged == strange[k])[~lost[k]].all()


def test_a_false_peak_alone_in_the_window_is_refused() -> None:
    rows = [[[1549.0]] for _ in range(100)]
    rows[50] = [[1551.6]]
    rows[51] = [[]]
    one = setup_of({"g": {"source": "", "window_nm": [1548.3, 1551.7]}})
    _, block = read(log([[*r, [1560.0] * (i % 2)] for i, r in enumerate(rows)], counts=False), one)
    assert np.flatnonzero(np.isnan(block.values["g"])).tolist() == [50, 51]
    assert block.flags == (("g", 50, 51, Quality.SPURIOUS_PEAK),)


def test_a_grating_is_followed_out_of_its_window() -> None:
    wave = 1550.0 + 2.5 * np.sin(np.arange(1000) / 50.0)
    rows = [[[float(w)], [1560.0] * (i % 2)] for i, w in enumerate(np.round(wave, 4))]
    _, block = read(
        log(rows, counts=False), setup_of({"g": {"source": "", "window_nm": [1549.0, 1551.0]}})
    )
    np.testing.assert_array_equal(block.values["g"], np.round(wave, 4))


def test_counts_keep_gratings_of_one_wavelength_apart() -> None:
    rows = [[[1550.0 + i / 1000], [1550.5 + i / 1000] * (i % 3 != 0)] for i in range(200)]
    two = setup_of({"a": {"source": "CH1"}, "b": {"source": "CH2"}})
    _, block = read(log(rows, counts=True), two)
    np.testing.assert_allclose(block.values["a"], 1550.0 + np.arange(200) / 1000)
    assert np.isnan(block.values["b"])[::3].all()
    np.testing.assert_allclose(block.values["b"][1::3], 1550.5 + np.arange(200)[1::3] / 1000)


def test_a_wrong_window_says_where_the_peaks_are() -> None:
    wavelengths, _ = truth(1004)
    rows = [[list(wavelengths[:2, i]), list(wavelengths[2:, i])[: 1 + i % 2]] for i in range(N)]
    channels = {
        "right": {"window_nm": [1542.0, 1546.0], "source": ""},
        "wrong": {"window_nm": [1570.0, 1572.0], "source": ""},
    }
    reader, block = read(log(rows, counts=False), setup_of(channels))
    assert np.isnan(block.values["wrong"]).all()
    assert not np.isnan(block.values["right"]).any()
    assert len(reader.report.losses) == 1
    assert (
        "channel wrong: no peak between 1570 and 1572 in any row; peaks were seen at about 1540"
        in reader.report.losses[0]
    )


def test_windows_of_one_fibre_that_overlap_are_refused() -> None:
    rows = [[[1549.0, 1551.0], [1560.0] * (i % 2)] for i in range(20)]
    windows = {"a": [1548.0, 1551.5], "b": [1550.0, 1553.0]}
    with pytest.raises(
        SetupError, match=r"window_nm of a and of b overlap between 1550 and 1551\.5"
    ):
        read(
            log(rows, counts=False),
            setup_of(
                {name: {"source": "", "window_nm": window} for name, window in windows.items()}
            ),
        )
    apart = {
        name: {"source": f"CH{1 + k}", "window_nm": window}
        for k, (name, window) in enumerate(windows.items())
    }
    _, block = read(log([[[1549.0], [1551.0]] for _ in range(20)], counts=True), setup_of(apart))
    assert (block.values["a"] == 1549.0).all()
    assert (block.values["b"] == 1551.0).all()
