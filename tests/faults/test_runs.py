"""Faults: runs with a flipped bit, runs of somebody else, recordings read after their end."""

import random
import zlib
from contextlib import suppress
from functools import cache

import h5py
import numpy as np
import pytest
import typer

from tests.runs.stored import SIZE, source, write
from tirelog.cli import run
from tirelog.cli.session import Session
from tirelog.errors import ReadError, SetupError
from tirelog.runs.ingest import open_recording
from tirelog.runs.store import DIGEST, contents_digest, is_run, open_run
from tirelog.runs.temporary import CHUNK

FILTERS = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True}

TIMES_S = np.linspace(0.0, 20.0, SIZE) ** 1.1


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The bytes of a run."""
    path = tmp_path_factory.mktemp("written") / "r.h5"
    write(path, source())
    return path.read_bytes()


def told(path):
    """All that a recording says, and its samples' bytes."""
    with open_run(path, "r.h5") as read:
        about = {key: value for key, value in read.provenance.items() if key != "losses"}
        out: dict[str, object] = {"setup": read.setup.text, "about": str(about)}
        for name, channel in read.channels.items():
            times = channel.axis.time(0, channel.axis.size)
            out[name] = (channel.read().tobytes(), times.tobytes(), channel.flags)
        return out | {"remarks": read.remarks, "losses": list(read.losses)}


def test_nothing_lies_in_the_heap(tmp_path):
    write(tmp_path / "r.h5", source(), times_s=TIMES_S)
    # where HDF5 keeps what is of variable length
    assert b"GCOL" not in (tmp_path / "r.h5").read_bytes()
    kinds = set()
    with h5py.File(tmp_path / "r.h5") as file:
        file.visititems(
            lambda _, item: kinds.update(item.attrs.get_id(name).dtype.kind for name in item.attrs)
        )
    assert kinds <= set("iufS")


def test_a_flipped_bit_is_noticed_or_changes_nothing(tmp_path):
    """Everywhere, and in texts: a gain of 1.25 must not become one of 1.35."""
    path = tmp_path / "r.h5"
    write(path, source(), times_s=TIMES_S)
    truth, clean = told(path), path.read_bytes()
    rng = random.Random(5)
    places = [rng.randrange(len(clean)) for _ in range(40)]
    for text in (b"strain_gain = 1.25", b"a loss", b"contents_sha256", b"rate_Hz", b"decimals"):
        start = clean.index(text)
        places += [rng.randrange(start, start + len(text) + 8) for _ in range(6)]
    noticed = lost = 0
    for at in places:
        damaged = bytearray(clean)
        damaged[at] ^= 1 << rng.randrange(8)
        path.write_bytes(damaged)
        try:
            found = told(path)
        except (ReadError, SetupError):
            noticed += 1
            continue
        if found == truth:
            continue
        noticed, lost = noticed + 1, lost + 1
        assert any("damaged (checksum)" in loss for loss in found["losses"])
        for key in ("setup", "about", "remarks"):
            assert found[key] == truth[key]
        for name in ("s", "t", "v"):
            read, was = (np.frombuffer(one[name][0]) for one in (found, truth))
            # the strain takes the temperature from the nearest readings of its twin
            near = np.abs(read - was) < (2e-5 if name == "s" else 1e-300)
            assert (np.isnan(read) | near).all()
    assert noticed > len(places) // 2
    assert lost > 5


@pytest.mark.parametrize("left", [0.1, 0.5, 0.99])
def test_a_run_that_is_cut_off_is_not_asked_for_a_setup(tmp_path, written, left):
    path = tmp_path / "run.h5"
    path.write_bytes(written[: int(left * len(written))])
    with pytest.raises(ReadError, match="is cut off at"), open_recording(str(path)):
        pass


def _external_link(file, folder):
    with h5py.File(folder / "other.h5", "w") as other:
        other["s"] = file["channels/s"][:]
    del file["channels/s"]
    file["channels/s"] = h5py.ExternalLink(str(folder / "other.h5"), "s")


def _soft_groups(file, folder):
    file.move("groups", "hidden")
    file["groups"] = h5py.SoftLink("/hidden")


def _replaced(file, path, **dataset):
    """Another dataset at `path`, with the attributes of the old one."""
    old = dict(file[path].attrs) if path in file else {}
    if path in file:
        del file[path]
    file.create_dataset(path, **dataset)  # type: ignore[arg-type]
    for name, value in old.items():
        file[path].attrs[name] = value


def _raw_storage(file, folder):
    (folder / "secret.bin").write_bytes(bytes(4 * SIZE))
    elsewhere = [(str(folder / "secret.bin"), 0, 4 * SIZE)]
    _replaced(file, "channels/s", shape=(SIZE,), dtype="i4", external=elsewhere)


def _virtual(file, folder):
    layout = h5py.VirtualLayout((SIZE,), "i4")
    layout[:] = h5py.VirtualSource(str(folder / "other.h5"), "s", (SIZE,))
    old = dict(file["channels/s"].attrs)
    del file["channels/s"]
    file.create_virtual_dataset("channels/s", layout)
    for name, value in old.items():
        file["channels/s"].attrs[name] = value


def _fletcher32(data):
    """As HDF5's specification words it."""
    low = high = 0
    for word in np.frombuffer(data + b"\0" * (len(data) % 2), ">u2").tolist():
        low += word
        high += low
        low, high = (low & 0xFFFF) + (low >> 16), (high & 0xFFFF) + (high >> 16)
    return (high << 16) | low


@cache
def _packed():
    """A chunk of 300 kB that grows to 300 MB when it is unpacked."""
    packer = zlib.compressobj(1)
    packed = b"".join(packer.compress(bytes(1 << 20)) for _ in range(300)) + packer.flush()
    return packed + _fletcher32(packed).to_bytes(4, "little")


def _inflating_chunk(file, folder):
    _replaced(file, "channels/s", shape=(SIZE,), dtype="i4", chunks=(CHUNK,), **FILTERS)
    file["channels/s"].id.write_direct_chunk((0,), _packed())


def _text(file, name, text):
    _replaced(file, name, data=np.frombuffer(text, np.uint8), chunks=True)
    file[name].attrs["size"] = len(text)


def _attribute(path, name, value=None):
    """Another value of an attribute, or without one none at all."""

    def make(file, folder):
        if value is None:
            del file[path].attrs[name]
        else:
            file[path].attrs[name] = value

    return make


def _dataset(path, **dataset):
    return lambda file, folder: _replaced(file, path, **dataset)


def _removed(*names):
    def make(file, folder):
        for name in names or list(file):
            del file[name]

    return make


def _provenance(text):
    return lambda file, folder: _text(file, "provenance", text)


S, ONE = "channels/s", {"chunks": (CHUNK,)}
GROWING = {"shape": (SIZE,), "maxshape": (None,), "dtype": "i4"}
NUMBER_OF_400 = b'{"counts": {"a": 1' + b"0" * 400 + b"}}"
HOSTILE = {
    "external link": _external_link,
    "link for a group": _soft_groups,
    "raw storage of another file": _raw_storage,
    "virtual over another file": _virtual,
    "a chunk of 2 GB": _dataset(S, **GROWING, chunks=(1 << 29,), **FILTERS),
    "a chunk that grows": _inflating_chunk,
    "a chunk of 2 GB of text": _dataset(
        "setup", shape=(1 << 31,), dtype="u1", chunks=(1 << 31,), **FILTERS
    ),
    "a size of 1e15": _attribute("groups/g", "size", 1e15),
    "half of the size": _attribute("groups/g", "size", SIZE // 2),
    "a size of text": _attribute("groups/g", "size", np.bytes_(b"many")),
    "a negative size": _attribute("groups/g", "size", -5),
    "an infinite rate": _attribute("groups/g", "rate_Hz", np.inf),
    "a rate of text": _attribute("groups/g", "rate_Hz", np.bytes_(b"fast")),
    "a rate of a list": _attribute("groups/g", "rate_Hz", np.arange(3.0)),
    "no rate": _attribute("groups/g", "rate_Hz"),
    "samples of text": _dataset(S, data=np.array([b"a"] * SIZE), **ONE),
    "complex samples": _dataset(S, data=np.zeros(SIZE, complex), **ONE),
    "samples of two axes": _dataset(S, data=np.zeros((SIZE, 2)), chunks=(CHUNK, 2)),
    "lists for samples": _dataset(S, shape=(SIZE,), dtype=h5py.vlen_dtype("i4"), **ONE),
    "no samples": _dataset(S, shape=(0,), maxshape=(None,), dtype="i4", **ONE),
    "a start beyond all time": _dataset("groups/g/start_s", data=[1e300], chunks=True),
    "a period of nothing": _dataset("groups/g/period_s", data=[np.nan], chunks=True),
    "no start": _dataset("groups/g/start_s", data=np.zeros(0), chunks=(1,), maxshape=(None,)),
    "flags from nowhere": _dataset("flags/s/start", data=np.array([-5, 5000]), chunks=True),
    "decimals without end": _attribute(S, "decimals", 1e9),
    "no group": _attribute(S, "group"),
    "another group": _attribute(S, "group", np.bytes_(b"nowhere")),
    "a group in the heap": _attribute(S, "group", "g"),
    "a version of text": _attribute("/", "tirelog_run", "2"),
    "the version before": _attribute("/", "tirelog_run", 1),
    "no setup": _removed("setup"),
    "a setup of other text": lambda file, folder: _text(file, "setup", b"\xff\xfe"),
    "no provenance": _removed("provenance"),
    "deep provenance": _provenance(b"[" * 100_000),
    "provenance that counts words": _provenance(b'{"counts": {"a": "b"}}'),
    "provenance of huge numbers": _provenance(NUMBER_OF_400),
    "provenance without end": _provenance(b'{"sha256": "00"'),
    "a digest that is a number": _provenance(b'{"sha256": 7}'),
    "provenance that is a list": _provenance(b"[1]"),
    "nothing but the attribute": _removed(),
}


#: what whoever signed it may say: wrong times and flags are then his own
NUMBERS = (
    "link for a group",
    "a start beyond all time",
    "a period of nothing",
    "no start",
    "flags from nowhere",
)
SIGNED = [(name, True) for name in HOSTILE if name not in NUMBERS]


@pytest.mark.parametrize(("name", "signed"), [*((name, False) for name in HOSTILE), *SIGNED])
def test_a_run_of_somebody_else_is_checked_as_any_file(tmp_path, written, capsys, name, signed):
    """Also if its digest is one of its own contents: what is no good is refused for what it is."""
    path = tmp_path / "r.h5"
    path.write_bytes(written)
    with h5py.File(path, "r+") as file:
        HOSTILE[name](file, tmp_path)
        if signed:
            try:
                file.attrs[DIGEST] = np.bytes_(contents_digest(file))
            except (ReadError, OSError, MemoryError):
                pytest.skip("cannot be signed")
    assert is_run(path)
    assert run(["speed", str(path)]) == 4
    said = capsys.readouterr().err
    assert said.startswith(f"tirelog: error: {path}: the run is damaged")
    assert said.count("\n") == 1


def test_a_closed_recording_says_so(tmp_path):
    """Kept longer than it is open: a run, a log by a temporary run, times of their own."""
    write(tmp_path / "r.h5", source(), times_s=TIMES_S)
    rows = [f"{k / 100 + 0.003 * (k % 3)},{k % 7}" for k in range(3000)]
    (tmp_path / "log.csv").write_text("time_s,c\n" + "\n".join(rows) + "\n")
    (tmp_path / "log.toml").write_text('[channels.v]\nkind = "vehicle_speed"\nsource = "c"\n')
    # the run says that it has lost rows
    with suppress(typer.Exit), Session(None, quiet=True) as session:
        kept = list(session.recordings([str(tmp_path / "r.h5"), str(tmp_path / "log.csv")]))
    assert len(kept) == 2
    for recording in kept:
        for channel in recording.channels.values():
            with pytest.raises(ReadError, match="the recording is closed"):
                channel.read()
    with pytest.raises(ReadError, match="the recording is closed"):
        kept[0].channels["v"].axis.time(0, 10)
