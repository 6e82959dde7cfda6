"""Property: what comes out of HDF5 logs of every layout is what was written."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.readers.logs import setup_of, whole
from tirelog.errors import ReadError
from tirelog.readers.hdf5 import reader as hdf5

PANDAS = Path(__file__).parent / "data" / "pandas_layouts.h5"


def read(path, sources, log="", **keys):
    """(values per channel, stamps per group, the reader) of a whole log."""
    setup = setup_of(sources, log, **{"kind": "temperature", "unit": "K", **keys})
    reader = hdf5.Hdf5Log(path, setup, str(path))
    values, stamps, _ = whole(reader)
    return values, stamps, reader


def write(path, made, attributes=()):
    """A file of these datasets, links and their attributes, each by its path."""
    with h5py.File(path, "w") as file:
        for name, values in made.items():
            file[name] = values
        for name, words in dict(attributes).items():
            file[name].attrs.update(words)


GRATING = {"kind": "fbg_strain", "unit": "nm"}
TEN = np.arange(10.0)
FIFTY = np.arange(50.0)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "log.h5"


@pytest.mark.parametrize("source", ["/a/b", "a/b", "/soft", "/a/relative"])
def test_a_dataset_by_path_and_through_soft_links(path, source):
    links = {"soft": h5py.SoftLink("/a/b"), "a/relative": h5py.SoftLink("b")}
    write(path, {"a/b": FIFTY, **links})
    values, _, reader = read(path, {"x": source})
    np.testing.assert_array_equal(values["x"], FIFTY)
    assert reader.report.losses == []


@pytest.mark.parametrize(
    ("shape", "source", "expected"),
    [
        ((40, 5), "/d[3]", np.arange(200).reshape(40, 5)[:, 3]),
        ((5, 40), "/d[3]", np.arange(200).reshape(5, 40)[3]),
        ((5, 40), "/d[:, 3]", np.arange(200).reshape(5, 40)[:, 3]),
        ((1, 40), "/d", np.arange(40)),
        ((40, 1), "/d", np.arange(40)),
        ((40, 1), "/d[0]", np.arange(40)),
        ((2, 40, 3), "/d[1, 2]", np.arange(240).reshape(2, 40, 3)[1, :, 2]),
    ],
)
def test_columns_of_arrays(path, shape, source, expected):
    write(path, {"d": np.arange(np.prod(shape)).reshape(shape)})
    np.testing.assert_array_equal(read(path, {"x": source})[0]["x"], expected)


def test_columns_of_a_compound(path):
    rows = np.zeros(30, [("time", "f8"), ("wl", "f4", (3,)), ("steps", "i2")])
    rows["time"], rows["steps"] = np.arange(30) / 100, np.arange(30)
    rows["wl"] = np.arange(90).reshape(30, 3)
    write(path, {"t": rows})
    values, stamps, reader = read(path, {"a": "/t:steps", "b": "/t:wl[2]"})
    np.testing.assert_array_equal(values["a"], np.arange(30))
    np.testing.assert_array_equal(values["b"], np.arange(2, 90, 3))
    assert len(reader.groups) == 1
    np.testing.assert_allclose(stamps["clock_1"], np.arange(30) / 100, atol=1e-12)


RATES = dict.fromkeys(("sampling_rate_Hz", "fs", "Fs", "FS", "sample_rate", "SampleRate"), 2500)
PERIODS = dict.fromkeys(("dt", "wf_increment"), np.array([0.0004]))


@pytest.mark.parametrize(("name", "value"), [*RATES.items(), *PERIODS.items()])
@pytest.mark.parametrize("where", ["/g/d", "/g", "/"])
def test_the_rate_by_alias_and_place(path, name, value, where):
    write(path, {"g/d": TEN}, {where: {name: value}})
    rate_Hz = read(path, {"x": "/g/d"})[2].groups[0].rate_Hz
    assert rate_Hz == pytest.approx(2500.0, rel=1e-12)


def test_the_rate_nearest_to_the_data_wins(path):
    write(path, {"g/d": TEN}, {"/": {"fs": 1.0}, "g": {"fs": 2.0}})
    assert read(path, {"x": "/g/d"})[2].groups[0].rate_Hz == 2.0


@pytest.mark.parametrize(
    ("attributes", "expected"),
    [
        ({"scale_factor": 0.5, "add_offset": 3.0}, 0.5 * np.arange(10) + 3.0),
        ({"scale": 0.5, "offset": 3.0}, 0.5 * np.arange(10) + 3.0),
        ({"factor": 0.5, "offset": 3.0}, 0.5 * np.arange(10) + 3.0),
        ({"scaling_factor": 0.5, "offset": 3.0}, 0.5 * (np.arange(10) + 3.0)),
        ({"offset": 3.0}, np.arange(10) + 3.0),
        ({"scale_factor": "0.25"}, 0.25 * np.arange(10)),
    ],
)
def test_words_with_factor_and_offset(path, attributes, expected):
    write(path, {"d": np.arange(10, dtype="i2")}, {"d": attributes})
    np.testing.assert_allclose(read(path, {"x": "/d"})[0]["x"], expected, rtol=1e-15)


def test_decimal_counts_keep_their_decimals(path):
    counts = np.arange(154_900_000, 154_900_500, dtype="i4")
    write(path, {"d": counts}, {"d": {"scale_factor": 1e-5}})
    values, _, _ = read(path, {"x": "/d"}, **GRATING)
    np.testing.assert_array_equal(values["x"], [float(f"{c}e-5") for c in counts])


def test_lost_peaks_and_fill_values_are_lost(path):
    made = {"peaks": [1550.0, 0.0, -1.0, np.nan, 1551.0], "words": np.array([1, 2, -999, 4], "i4")}
    write(path, made, {"words": {"_FillValue": np.array([-999], "i4")}})
    peaks = read(path, {"x": "/peaks"}, **GRATING)[0]["x"]
    np.testing.assert_array_equal(peaks, [1550.0, np.nan, np.nan, np.nan, 1551.0])
    words = read(path, {"x": "/words"})[0]["x"]
    np.testing.assert_array_equal(words, [1, 2, np.nan, 4])


def test_a_time_dataset_of_the_setup_its_unit_and_a_common_origin(path):
    made = {"fast": np.arange(100.0), "slow": TEN, "fast_clock": 5000.0 + np.arange(100.0)}
    write(path, made | {"time": 6000 + np.arange(100)}, {"time": {"units": "ms"}})
    _, stamps, _ = read(path, {"a": "/fast"}, log='time = "/fast_clock"\ntime_unit = "ms"')
    np.testing.assert_allclose(stamps["clock_1"], np.arange(100) / 1000, atol=1e-12)
    _, stamps, _ = read(path, {"a": "/fast", "b": "/slow"})
    np.testing.assert_allclose(stamps["clock_1"], np.arange(100) / 1000, atol=1e-12)
    assert "clock_2" not in stamps  # ten samples have no time beside them


def test_two_clocks_count_from_the_first_stamp_of_either(path):
    twenty = np.arange(20.0)
    write(path, {"a/x": TEN, "a/time": 100.0 + TEN, "b/x": twenty, "b/time": 98.5 + twenty / 2})
    _, stamps, _ = read(path, {"a": "/a/x", "b": "/b/x"})
    assert stamps["clock_1"][0] == 1.5
    assert stamps["clock_2"][0] == 0.0


@pytest.mark.parametrize(
    ("name", "times", "words", "period_s", "start"),
    [
        (
            "timestamp", 1_767_225_600_123_456_789 + 400_001 * np.arange(10), {}, 400_001e-9,
            "2026-01-01T00:00:00.12345",
        ),
        (
            "time", 250.0 + 4 * TEN, {"units": "ms since 2026-03-01 12:00:00"}, 0.004,
            "2026-03-01T12:00:00.250000",
        ),
    ],
    ids=["nanoseconds since 1970", "netcdf"],
)  # fmt: skip
def test_times_since_a_date_keep_their_nanoseconds(path, name, times, words, period_s, start):
    write(path, {"x": TEN, name: times}, {name: words})
    _, stamps, reader = read(path, {"a": "/x"})
    np.testing.assert_allclose(stamps["clock_1"], period_s * TEN, rtol=0, atol=1e-15)
    assert reader.report.start.startswith(start)


def test_matlab_7_3(path):
    """A 512-byte user block, vectors as (1, n) or (n, 1), the rate as a variable."""
    with h5py.File(path, "w", userblock_size=512) as file:
        file["log/strain"] = np.arange(60.0).reshape(1, 60)
        file["log/all"] = np.arange(120.0).reshape(2, 60)
        file["log/Fs"] = np.array([[2500.0]])
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")
    values, _, reader = read(path, {"a": "/log/strain", "b": "/log/all[1]"})
    np.testing.assert_array_equal(values["a"], np.arange(60.0))
    np.testing.assert_array_equal(values["b"], np.arange(60.0, 120.0))
    assert [g.rate_Hz for g in reader.groups] == [2500.0]


@pytest.mark.parametrize("source", ["/entry/data", "/entry/data/counts"])
@pytest.mark.parametrize("old", [False, True])
def test_nexus(path, source, old):
    with h5py.File(path, "w") as file:
        data = file.create_group("entry/data")
        data["counts"], data["clock"] = np.arange(30.0), 0.5 + np.arange(30.0) / 50
        data["clock"].attrs["units"] = "s"
        if old:
            data["counts"].attrs["signal"], data["counts"].attrs["axes"] = 1, "clock"
        else:
            data.attrs["signal"], data.attrs["axes"] = "counts", ["clock"]
    values, stamps, _ = read(path, {"x": source})
    np.testing.assert_array_equal(values["x"], np.arange(30.0))
    np.testing.assert_allclose(stamps["clock_1"], np.arange(30.0) / 50, atol=1e-12)


@pytest.mark.parametrize("frame", ["fixed", "table", "columns", "float_index"])
def test_pandas(frame):
    row = np.arange(20)
    sources = {"a": f"/{frame}:CH1_FBG1", "b": f"/{frame}:CH1_FBG2", "n": f"/{frame}:n"}
    values, stamps, reader = read(PANDAS, sources)
    np.testing.assert_array_equal(values["a"], 1549 + row / 16)
    np.testing.assert_array_equal(values["b"], 1540 + row / 32)
    np.testing.assert_array_equal(values["n"], row)
    assert len(reader.groups) == 1
    np.testing.assert_allclose(stamps["clock_1"], row / 1000, atol=1e-12)
    assert reader.report.start == (None if frame == "float_index" else "2026-01-01T00:00:00+00:00")


@pytest.mark.parametrize(
    "source",
    ["/fixed:CH1_FBG1[3]", "/fixed:n[:, 0]", "/table:CH1_FBG1[3]", "/series[3]", "/series:n"],
)
def test_a_column_of_pandas_takes_no_index(source):
    """A column has one axis, that of time: nothing is left to choose by an index or a field."""
    with pytest.raises(ReadError, match="allowed is"):
        read(PANDAS, {"x": source})


def test_a_pandas_series():
    np.testing.assert_array_equal(read(PANDAS, {"n": "/series"})[0]["n"], np.arange(20))


def test_channels_of_one_clock_form_one_group(path):
    with h5py.File(path, "w") as file:
        for name, size, rate in (("a", 10, 100), ("b", 10, 100), ("c", 10, 200), ("d", 20, 100)):
            file[name] = np.arange(float(size))
            file[name].attrs["fs"] = rate
    groups = read(path, {n: f"/{n}" for n in "abcd"})[2].groups
    assert [(g.channels, g.rate_Hz) for g in groups] == [
        (("a", "b"), 100.0),
        (("c",), 200.0),
        (("d",), 100.0),
    ]


@pytest.mark.parametrize("name", ["x[3]", "a:b", "last ", "WL [1] [nm]", "x[0]:y", "group[1]/x"])
def test_a_name_is_looked_up_before_it_is_parsed(path, name):
    write(path, {name: FIFTY, "x": np.zeros((50, 4))})
    assert name in {one.source.removeprefix("/") for one in hdf5.datasets(path, "log").series}
    np.testing.assert_array_equal(read(path, {"x": f"/{name}"})[0]["x"], FIFTY)


@pytest.mark.parametrize("source", [" x", "  w[:,1]", "x "])
def test_blanks_around_a_source_are_no_part_of_it(path, source):
    write(path, {"x": FIFTY, "w": np.tile(FIFTY[:, None], 2)})
    np.testing.assert_array_equal(read(path, {"x": source})[0]["x"], FIFTY)


def test_a_unit_that_contradicts_the_setup_is_said(path):
    write(path, {"x": TEN, "y": TEN}, {"x": {"units": "degC"}, "y": {"unit": "Kelvin"}})
    (remark,) = read(path, {"x": "/x", "y": "/y"})[2].report.remarks
    assert "channel x" in remark
    assert "'degC'" in remark


@pytest.mark.parametrize("chunks", [None, (1, 3), (977, 1), (7, 2), (10_000, 3)])
def test_blocks_of_any_size_give_the_same_samples(path, monkeypatch, chunks):
    data = np.random.default_rng(1).normal(size=(10_000, 3))
    with h5py.File(path, "w") as file:
        file.create_dataset("d", data=data, chunks=chunks, compression="gzip" if chunks else None)
    monkeypatch.setattr(hdf5, "BLOCK_VALUES", 3001)
    values, _, _ = read(path, {"a": "/d[0]", "b": "/d[2]"})
    np.testing.assert_array_equal(values["a"], data[:, 0])
    np.testing.assert_array_equal(values["b"], data[:, 2])
