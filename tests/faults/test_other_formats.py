"""Faults: MATLAB, Parquet, WAV and zip logs: a sentence and a status, or what can be kept."""

import io
import struct
import tracemalloc
import zipfile
import zlib
from itertools import product

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat, wavfile

from tests.readers.logs import setup_of, spoilt
from tests.readers.other_files import A, N, outcome, read, refusal
from tirelog.runs.ingest import open_recording

TEXT = "time,a\n" + "".join(f"{i / 100:.2f},{x:.4f}\n" for i, x in enumerate(A))


def matlab(packed=False, **variables):
    file = io.BytesIO()
    savemat(file, variables or {"a": A}, do_compression=packed)
    return file.getvalue()


def parquet(**columns):
    file = io.BytesIO()
    pq.write_table(pa.table(columns or {"time": np.arange(N) / 100.0, "a": A}), file)
    return file.getvalue()


def wav(values):
    file = io.BytesIO()
    wavfile.write(file, 100, values)
    return file.getvalue()


def with_end(archive, behind, number):
    """The archive with another number so many bytes behind the begin of its end."""
    at = archive.rindex(b"PK\5\6") + behind
    return archive[:at] + number.to_bytes(4, "little") + archive[at + 4 :]


def zipped(*names, text=TEXT, method=zipfile.ZIP_DEFLATED):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        for name in names or ("log.csv",):
            archive.writestr(name, text)
    return file.getvalue()


MADE = {
    "matlab": (matlab(), "a"),
    "matlab packed": (matlab(packed=True), "a"),
    "parquet": (parquet(), "a"),
    "wav": (wav((A * 3000).astype(np.int16)), "#1"),
    "zip": (zipped(), "a"),
}


@pytest.mark.parametrize("name", MADE)
def test_flips_and_cuts_end_in_a_sentence_or_in_data(name, tmp_path):
    """Nothing but an error of our own, and never more samples than were written, unless said."""
    data, source = MADE[name]
    rng = np.random.default_rng(sum(name.encode()))
    sizes = []
    for _ in range(5):
        size, said = outcome(spoilt(data, rng), tmp_path, source)
        assert size <= N + 1 or "damaged" in said
        assert size > 0 or said.startswith(f"{tmp_path / 'log'}: ")
        sizes.append(size)
    assert max(sizes) > 0 or name == "matlab packed"  # one variable with one checksum


def test_a_file_cut_off_keeps_what_is_there_and_says_so(tmp_path):
    data, source = MADE["wav"]
    whole, none = read(data, tmp_path, source)
    part, lost = read(data[: len(data) * 6 // 10], tmp_path, source)
    assert none == ""
    assert 0.5 * N < part.size < 0.7 * N
    np.testing.assert_array_equal(part, whole[: part.size])
    assert "cut off" in lost


def test_a_page_of_parquet_that_is_damaged_ends_the_rows(tmp_path):
    file = io.BytesIO()
    table = pa.table({"time": np.arange(10 * N) / 100.0, "a": np.tile(A, 10)})
    pq.write_table(table, file, row_group_size=5 * N, write_page_checksum=True, compression="none")
    data = bytearray(file.getvalue())
    data[len(data) * 3 // 4] ^= 8
    values, lost = read(bytes(data), tmp_path)
    assert 0 < values.size < 10 * N
    np.testing.assert_array_equal(values, np.tile(A, 10)[: values.size])
    assert "cannot be read to its end" in lost


def test_a_column_of_parquet_that_nobody_reads_may_be_damaged(tmp_path):
    places, latin = np.arange(N + 1, dtype=np.int32), b"\xe4" * N
    note = pa.Array.from_buffers(
        pa.string(), N, [None, pa.py_buffer(places.tobytes()), pa.py_buffer(latin)]
    )
    file = io.BytesIO()
    pq.write_table(pa.table({"time": np.arange(N) / 100.0, "a": A, "note": note}), file)
    values, lost = read(file.getvalue(), tmp_path)
    np.testing.assert_array_equal(values, A)
    assert not lost


@pytest.mark.parametrize("packed", [False, True])
def test_a_variable_that_is_damaged_is_lost_and_no_other(packed, tmp_path):
    data = matlab(packed=packed, a=A, b=A[::-1].copy())
    values, lost = read(data[:-200], tmp_path)
    np.testing.assert_array_equal(values, A)
    assert "variable 2 cannot be read" in lost


def element(kind, body):
    return struct.pack("<II", kind, len(body)) + body + bytes(-len(body) % 8)


def array(name, dims, body, kind=6):
    """A matrix element by hand."""
    shape = struct.pack(f"<{len(dims)}i", *dims)
    flags = element(6, struct.pack("<II", kind, 0))
    return element(14, flags + element(5, shape) + element(1, name) + body)


HEAD = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"


DIMS = [(1 << 30, 1 << 30), (1, 1 << 30), (1 << 30, 1), (2, -5), (7,), (0, 3), (3, 1 << 29)]
NAMES = [b"../x", b"/", b"", b"a/b", b"\xff\xfe", b"x" * 3000, b"."]
NINE = element(9, np.arange(9.0).tobytes())


def test_what_an_array_says_it_is_costs_no_memory_and_no_name_is_a_path(tmp_path):
    data = HEAD
    for k, (dims, kind) in enumerate(product(DIMS, (1, 2, 6))):
        data += array(f"a{k}".encode(), dims, element(9, bytes(64)), kind)
    data += b"".join(array(name, (1, 9), NINE) for name in [*NAMES, b"b"])
    tracemalloc.start()
    values, _ = read(data, tmp_path, "b")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    np.testing.assert_array_equal(values, np.arange(9.0))
    assert peak < 20 << 20
    assert sorted(p.name for p in tmp_path.iterdir()) == ["log"]


def test_what_matlab_keeps_of_its_objects_is_passed_over(tmp_path):
    """A table or a time series has no axes, and its inside stands behind the variables."""
    flags, name = element(6, struct.pack("<II", 17, 0)), element(1, b"drive")
    body = array(b"", (1, 1), element(6, bytes(4)), 13)
    kinds = element(1, b"MCOS") + element(1, b"timetable")
    object_ = element(14, flags + name + kinds + body)
    inside = array(b"", (1, 9), element(2, bytes(9)), 9)
    (tmp_path / "log").write_bytes(HEAD + object_ + array(b"b", (1, 9), NINE) + inside)
    setup = setup_of({"b": "b"}, "sampling_rate_Hz = 100.0", kind="signal")
    with open_recording(str(tmp_path / "log"), setup) as recording:
        assert recording.losses == []
        assert recording.remarks == ("not read: /drive is an object (a table, a time series)",)


def test_structures_without_end_end(tmp_path):
    names = element(5, struct.pack("<i", 8)) + element(1, b"x\0\0\0\0\0\0\0")
    inner = b""
    for _ in range(41):
        inner = array(b"", (1, 1), names + inner, 2)
    data = HEAD + array(b"s", (1, 1), names + inner, 2) + array(b"b", (1, 9), NINE)
    assert read(data, tmp_path, "b")[0].size == 9


def test_a_small_matlab_file_that_unpacks_to_much(tmp_path, monkeypatch):
    monkeypatch.setattr("tirelog.readers.other.conversion.MEMORY_BYTES", 32 << 20)
    many = 40 << 20
    bomb = zlib.compress(array(b"a", (1, many // 8), element(9, bytes(many))))
    data = HEAD + struct.pack("<II", 15, len(bomb)) + bomb
    assert "variable 1 cannot be read (MemoryError)" in refusal(data, tmp_path)


def encrypted():
    data = bytearray(zipped())
    data[6] |= 1
    data[data.index(b"PK\1\2") + 8] |= 1
    return bytes(data)


def named_twice():
    file = io.BytesIO()
    pq.write_table(pa.Table.from_arrays([pa.array(A), pa.array(A)], names=["a", "a"]), file)
    return file.getvalue()


#: a file without one channel that can be read, and what the refusal says
REFUSED = {
    "matlab cut off": (matlab()[:-200], "variable 1 cannot be read"),
    "matlab packed, cut off": (matlab(packed=True)[:-200], "variable 1 cannot be read"),
    "parquet cut off": (parquet()[:-200], "is a Parquet file that cannot be read"),
    "parquet with a name twice": (named_twice(), "a column name twice"),
    "zip cut off": (zipped()[:-200], "is a zip archive that cannot be read (BadZipFile"),
    "zip encrypted": (encrypted(), "is encrypted"),
    "zip of a list that begins behind the end": (with_end(zipped(), 16, 1 << 24), "cannot be read"),
    "zip of a list of 5 MB": (with_end(zipped(), 12, 5 << 20), "cannot be read"),
    "zip of nothing": (zipped("a/", text=""), "holds no file"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_without_a_channel_that_can_be_read_is_refused(name, tmp_path):
    data, says = REFUSED[name]
    assert says in refusal(data, tmp_path)


def test_an_archive_s_checksum_is_looked_at(tmp_path):
    data = bytearray(zipped(method=zipfile.ZIP_STORED))
    at = data.index(b"0.50,")
    data[at + 5 : at + 6] = b"9"
    assert "Bad CRC-32" in read(bytes(data), tmp_path)[1]


def test_text_in_a_table_is_handed_to_nobody(tmp_path):
    words = ["x\ny,1\t2\n"] * N
    data = parquet(words=words, time=np.arange(N) / 100.0, a=A)
    np.testing.assert_array_equal(read(data, tmp_path)[0], A)
    assert "no column 'words'" in refusal(data, tmp_path, "words")
