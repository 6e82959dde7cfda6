"""Faults: damaged HDF5 is refused or read in part, in a sentence, in bounded memory."""

import resource
from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.readers.logs import flip, setup_of, spoilt, whole
from tirelog.cli import run
from tirelog.errors import ReadError, TirelogError
from tirelog.readers.hdf5.reader import Hdf5Log, datasets
from tirelog.vocabulary.quality import Quality

SAMPLES = Path(__file__).parents[2] / "sample_data"
GOOD = np.arange(20_000.0)


def opened(path, *sources):
    channels = {f"c{i}": source for i, source in enumerate(sources)}
    return Hdf5Log(path, setup_of(channels, kind="temperature"), "log.h5")


def read(path, *sources):
    """(values per channel, flags, report)."""
    reader = opened(path, *sources)
    values, _, flags = whole(reader)
    return values, flags, reader.report


@pytest.fixture
def path(tmp_path):
    return tmp_path / "log.h5"


@pytest.fixture
def chunked(path):
    """Twenty chunks with checksums, behind a small contiguous dataset."""
    with h5py.File(path, "w") as file:
        file["small"] = np.arange(100.0)
        file.create_dataset(
            "x",
            data=np.random.default_rng(3).permutation(GOOD),
            chunks=(1000,),
            compression="gzip",
            fletcher32=True,
        )
    return path


def place(path, source, chunk):
    with h5py.File(path) as file:
        return file[source].id.get_chunk_info(chunk)


def make_virtual(file):
    layout = h5py.VirtualLayout((100,), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", (100,))
    file.create_virtual_dataset("bad", layout)


def make_lists(file):
    file.create_dataset("bad", (3,), h5py.vlen_dtype("f8"))[0] = [1.0]


def make_references(file):
    file.create_dataset("bad", (1,), h5py.ref_dtype)[0] = file["small"].ref


def make_absurd_with_a_chunk(file):
    file.create_dataset("bad", (10**18,), "f8", chunks=(1000,))[0] = 1.0


def make_giant_chunk(file):
    file.create_dataset("bad", (1 << 27,), "i1", chunks=(1 << 27,), compression="gzip")[0] = 1


ELSEWHERE = [("/etc/hostname", 0, h5py.h5f.UNLIMITED)]
#: what makes it, what stands where, the arguments of a dataset, or its values; and what is said
REFUSED = {
    "external link": (
        [("bad", h5py.ExternalLink("/etc/other.h5", "/x"))],
        "link to '/etc/other.h5'",
    ),
    "soft link outside": (
        [("way", h5py.ExternalLink("other.h5", "/")), ("bad", h5py.SoftLink("/way/x"))],
        "external link to 'other.h5'",
    ),
    "circle": (
        [("bad", h5py.SoftLink("/back")), ("back", h5py.SoftLink("/bad"))],
        "circle of soft links",
    ),
    "external storage": (
        {"shape": (100,), "dtype": "f8", "external": ELSEWHERE},
        "keeps its data in the other file",
    ),
    "virtual": (make_virtual, "is virtual"),
    "lists": (make_lists, "object array"),
    "text": (np.array([b"1550.1", b"1550.2"]), "holds text"),
    "long text": (np.array(["1550.1", "x"], dtype=h5py.string_dtype()), "holds text"),
    "references": (make_references, "object references"),
    "complex": (np.zeros(5, complex), "complex128"),
    "absurd": (
        {"shape": (10**18,), "dtype": "f8", "chunks": (1000,)},
        "1000000000000000000 values and stores 0 bytes",
    ),
    "absurd with a chunk": (
        make_absurd_with_a_chunk,
        "1000000000000000000 values and stores 8000 bytes",
    ),
    "giant chunk": (make_giant_chunk, "compressed chunks of 128 MB"),
    "empty": ({"shape": (0,), "dtype": "f8", "maxshape": (None,)}, "no samples"),
    "scalar": (3.0, "single value"),
    "null": (h5py.Empty("f8"), "single value"),
    "group": ([("bad/below", 1.0)], "is a group"),
    "table": (
        np.zeros(5, [("a", "f8"), ("b", "f8")]),
        "a table without a column None; it has a, b",
    ),
    "wide": (np.zeros((50, 4)), "(50, 4)"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_is_refused_alone_is_unreadable_and_beside_a_good_channel_a_loss(chunked, what):
    made, said = REFUSED[what]
    with h5py.File(chunked, "r+") as file:
        if callable(made):
            made(file)
        elif isinstance(made, list):
            file.update(made)
        elif isinstance(made, dict):
            file.create_dataset("bad", **made)
        else:
            file["bad"] = made
    with pytest.raises(ReadError) as caught:
        read(chunked, "/bad")
    assert said in str(caught.value)
    assert str(caught.value).count(";") >= 2
    values, _, report = read(chunked, "/bad", "/small")
    np.testing.assert_array_equal(values["c1"], np.arange(100.0))
    assert [said in loss for loss in report.losses] == [True]


@pytest.mark.parametrize("index", ["[4]", "[0, 0]", "[:]", "[-1]", "[x]"])
def test_an_index_that_does_not_fit(path, index):
    with h5py.File(path, "w") as file:
        file["d"] = np.zeros((50, 4))
    with pytest.raises(ReadError, match="allowed"):
        read(path, f"/d{index}")


def test_a_wrong_column_names_the_nearest(path):
    with h5py.File(path, "w") as file:
        file["rear"] = np.zeros(5, [("encoder", "f8")])
    with pytest.raises(ReadError, match=r"nearest: encoder"):
        read(path, "/rear:encodre")


def test_a_flipped_bit_loses_its_chunk_and_no_other(chunked):
    whole = read(chunked, "/x")[0]["c0"]
    flip(chunked, place(chunked, "x", 7).byte_offset + 50)
    values, flags, report = read(chunked, "/x")
    lost = np.isnan(values["c0"])
    assert lost[7000:8000].all()
    assert lost.sum() == 1000
    np.testing.assert_array_equal(values["c0"][~lost], whole[~lost])
    assert flags == [("c0", 7000, 8000, Quality.GAP)]
    assert ["1000 samples" in loss for loss in report.losses] == [True]


def test_damage_to_the_first_stamps_leaves_the_others(path):
    with h5py.File(path, "w") as file:
        file["x"] = GOOD
        file.create_dataset(
            "time", data=5.0 + GOOD / 100, chunks=(1000,), compression="gzip", fletcher32=True
        )
    flip(path, place(path, "time", 0).byte_offset + 50)
    reader = opened(path, "/x")
    stamps = whole(reader)[1]["clock_1"]
    assert np.isnan(stamps[:1000]).all()
    np.testing.assert_allclose(stamps[1000:], GOOD[:-1000] / 100, atol=1e-9)
    assert ["1000 stamps" in loss for loss in reader.report.losses] == [True]


def test_chunks_that_were_never_written_are_lost_not_zero(path):
    with h5py.File(path, "w") as file:
        x = file.create_dataset("x", (10_000,), "f8", chunks=(1000,), fillvalue=5.0)
        x[:2000], x[4000:6000] = 1.0, 2.0
    values, flags, report = read(path, "/x")
    assert values["c0"].size == 6000
    assert np.isnan(values["c0"][2000:4000]).all()
    assert np.isfinite(np.delete(values["c0"], np.s_[2000:4000])).all()
    assert {word for _, _, _, word in flags} == {Quality.GAP}
    assert len(report.losses) == 2


def test_120_flips_and_cuts_end_in_a_sentence_or_in_data(chunked, tmp_path):
    """Any damage: an error of ours or samples, never another exception, and bounded memory."""
    content = chunked.read_bytes()
    rng = np.random.default_rng(11)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    outcomes = {"refused": 0, "read": 0}
    for trial in range(120):
        target = tmp_path / f"damaged_{trial}.h5"
        # half of them in the metadata at the start
        target.write_bytes(spoilt(content, rng, stop=(1500, None)[trial % 2]))
        try:
            read(target, "/x", "/small")
            outcomes["read"] += 1
        except TirelogError:
            outcomes["refused"] += 1
    assert min(outcomes.values()) > 10
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000  # kB


def other_types(path):
    """Whole datasets of types that numpy does not have, arrays as elements, and a good one."""
    from h5py import h5d, h5s, h5t

    quad = h5t.IEEE_F64LE.copy()
    quad.set_size(16)
    quad.set_precision(128)
    quad.set_fields(127, 112, 15, 0, 112)
    quad.set_ebias(16383)
    with h5py.File(path, "w") as file:
        file["good"] = GOOD[:100]
        file.create_dataset("arrays", shape=(100,), dtype=np.dtype(("f8", (10,))))
        for name, kind in ((b"times", h5t.UNIX_D32LE), (b"quad", quad)):
            h5d.create(file.id, name, kind, h5s.create_simple((100,)))


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("arrays", "holds arrays of shape (10,) as its elements"),
        ("times", "allowed are numbers; store it as such"),
        ("quad", "allowed are numbers; store it as such"),
    ],
)
def test_a_type_that_is_whole_but_no_number_here_is_not_called_damaged(path, name, says):
    other_types(path)
    _, _, report = read(path, "/good", f"/{name}")
    assert len(report.losses) == 1
    assert says in report.losses[0]
    assert "damaged" not in report.losses[0]


def test_what_is_in_a_file_of_such_types_is_told(path):
    other_types(path)
    assert [one.source for one in datasets(path, "log.h5").series] == ["/good"]


def test_an_encoder_that_was_never_stored_is_not_asked_for_in_the_setup(tmp_path, capsys):
    """The setup has it: the file is what is to be mended; the status says that input is lost."""
    log = tmp_path / "log.h5"
    log.write_bytes((SAMPLES / "encoder.h5").read_bytes())
    with h5py.File(log, "r+") as file:
        shape = file["/wheel/encoder"].shape
        del file["/wheel/encoder"]
        file.create_dataset("/wheel/encoder", shape, "f8", chunks=(1000,))
    (tmp_path / "log.toml").write_text((SAMPLES / "encoder.toml").read_text())
    assert run(["phase-shift", str(log), "-o", str(tmp_path / "shift.csv")]) == 3
    said = capsys.readouterr().err.splitlines()[-1]
    assert "channel encoder could not be read" in said
    assert "setup" not in said
    assert not (tmp_path / "shift.csv").exists()
