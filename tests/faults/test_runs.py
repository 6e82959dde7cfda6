"""Faults: runs with a flipped bit, runs of somebody else, recordings read after their end."""

import random
import zlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import pytest
import typer

from tirelog.cli import run
from tirelog.cli.session import Session
from tirelog.data.recording import TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.errors import ReadError, SetupError
from tirelog.readers.base import Group, RawBlock
from tirelog.runs.ingest import open_recording, write_run
from tirelog.runs.store import (
    DIGEST,
    check_columns,
    contents_digest,
    is_run,
    open_run,
    write_file,
)
from tirelog.runs.temporary import CHUNK, RunWriter
from tirelog.vocabulary.quality import Quality

SETUP = """[tire]
rolling_radius_m = 0.305
[channels.s]
kind = "strain"
source = "a"
[channels.v]
kind = "vehicle_speed"
source = "c"
"""
SIZE = CHUNK + 900
FILTERS = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True}


def write(path: Path, times: np.ndarray | None = None) -> None:
    """A run of a strain of counts and a speed, with flags, losses and explicit times if given."""
    rng = np.random.default_rng(1)
    groups = (Group("g", ("s",), decimals={"s": 4}), Group("h", ("v",)))
    folder = path.with_suffix(".samples")
    folder.mkdir()
    writer = RunWriter(folder, parse_setup(SETUP), groups)
    writer.append(
        RawBlock(
            "g",
            {"s": np.round(rng.standard_normal(SIZE), 4)},
            flags=(("s", 3, 5, Quality.SPIKE),),
        )
    )
    writer.append(RawBlock("h", {"v": rng.random(2000)}))
    axis = TimeAxis.uniform(2000, 100.0) if times is None else TimeAxis.of_times(times)
    about = {
        "losses": ["3 rows are damaged"],
        "remarks": ["no twin"],
        "counts": {"bad_rows": 3},
        "repairs": {},
    }
    written = writer.finish(
        {"g": TimeAxis.uniform(SIZE, 2500.0), "h": axis}, {"h": [(7, 9, Quality.GAP)]}, about
    )
    write_file(written, path)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The bytes of the run that `write` makes."""
    path = tmp_path_factory.mktemp("written") / "r.h5"
    write(path)
    return path.read_bytes()


def told(path: Path) -> dict[str, object]:
    """All that a recording says, and its samples' bytes."""
    with open_run(path, "r.h5") as read:
        out: dict[str, object] = {
            "setup": read.setup.text,
            "about": str(read.provenance),
            "remarks": read.remarks,
        }
        for name, channel in read.channels.items():
            out[name] = (
                channel.read().tobytes(),
                channel.axis.time(0, channel.axis.size).tobytes(),
                channel.flags,
            )
        return out | {"losses": list(read.losses)}


def test_nothing_lies_in_the_heap(tmp_path: Path) -> None:
    write(tmp_path / "r.h5", np.linspace(0.0, 20.0, 2000) ** 1.1)
    assert (
        b"GCOL" not in (tmp_path / "r.h5").read_bytes()
    )  # where HDF5 keeps what is of variable length
    kinds = set()
    with h5py.File(tmp_path / "r.h5") as file:
        file.visititems(
            lambda _, item: kinds.update(item.attrs.get_id(name).dtype.kind for name in item.attrs)
        )
        assert check_columns(file) == []
    assert kinds <= set("iufS")


def _flip(clean: bytes, path: Path, at: int, bit: int) -> None:
    damaged = bytearray(clean)
    damaged[at] ^= 1 << bit
    path.write_bytes(damaged)


def test_a_flipped_bit_is_noticed_or_changes_nothing(tmp_path: Path) -> None:
    """Everywhere, and in the texts that stand in a run: a radius of 0.305 must not become one of
    0.315.
    """
    path = tmp_path / "r.h5"
    write(path, np.linspace(0.0, 20.0, 2000) ** 1.1)
    truth, clean = told(path), path.read_bytes()
    rng = random.Random(5)
    places = [rng.randrange(len(clean)) for _ in range(20)]
    for text in (
        b"rolling_radius_m = 0.305",
        b"rows are damaged",
        b"contents_sha256",
        b"rate_Hz",
        b"decimals",
    ):
        start = clean.index(text)
        places += [rng.randrange(start, start + len(text) + 8) for _ in range(8)]
    noticed = 0
    for at in places:
        _flip(clean, path, at, rng.randrange(8))
        try:
            found = told(path)
        except (ReadError, SetupError):
            noticed += 1
            continue
        if found == truth:
            continue
        noticed += 1
        assert any("damaged (checksum)" in loss for loss in found["losses"])
        assert {key: found[key] for key in ("setup", "about", "remarks")} == {
            key: truth[key] for key in ("setup", "about", "remarks")
        }
    assert noticed > len(places) // 2


@pytest.mark.parametrize("left", [0.1, 0.5, 0.99])
def test_a_run_that_is_cut_off_is_not_asked_for_a_setup(
    tmp_path: Path, written: bytes, left: float
) -> None:
    path = tmp_path / "run.h5"
    path.write_bytes(written[: int(left * len(written))])
    with pytest.raises(ReadError, match="is cut off at"), open_recording(str(path)):
        pass


def _external_link(file: h5py.File, folder: Path) -> None:
    with h5py.File(folder / "other.h5", "w") as other:
        other["s"] = file["channels/s"][:]
    del file["channels/s"]
    file["channels/s"] = h5py.ExternalLink(str(folder / "other.h5"), "s")


def _soft_groups(file: h5py.File, folder: Path) -> None:
    file.move("groups", "hidden")
    file["groups"] = h5py.SoftLink("/hidden")


def _replaced(file: h5py.File, path: str, **dataset: object) -> None:
    """Another dataset at `path`, with the attributes of the old one."""
    old = dict(file[path].attrs) if path in file else {}
    if path in file:
        del file[path]
    file.create_dataset(path, **dataset)  # type: ignore[arg-type]
    for name, value in old.items():
        file[path].attrs[name] = value


def _raw_storage(file: h5py.File, folder: Path) -> None:
    (folder / "secret.bin").write_bytes(bytes(4 * SIZE))
    _replaced(
        file,
        "channels/s",
        shape=(SIZE,),
        dtype="i4",
        external=[(str(folder / "secret.bin"), 0, 4 * SIZE)],
    )


def _virtual(file: h5py.File, folder: Path) -> None:
    layout = h5py.VirtualLayout((SIZE,), "i4")
    layout[:] = h5py.VirtualSource(str(folder / "other.h5"), "s", (SIZE,))
    old = dict(file["channels/s"].attrs)
    del file["channels/s"]
    file.create_virtual_dataset("channels/s", layout)
    for name, value in old.items():
        file["channels/s"].attrs[name] = value


def _fletcher32(data: bytes) -> int:
    """As HDF5's specification words it."""
    low = high = 0
    for word in np.frombuffer(data + b"\0" * (len(data) % 2), ">u2").tolist():
        low += word
        high += low
        low, high = (low & 0xFFFF) + (low >> 16), (high & 0xFFFF) + (high >> 16)
    return (high << 16) | low


@cache
def _packed() -> bytes:
    """A chunk of 300 kB that grows to 300 MB when it is unpacked."""
    packer = zlib.compressobj(1)
    packed = b"".join(packer.compress(bytes(1 << 20)) for _ in range(300)) + packer.flush()
    return packed + _fletcher32(packed).to_bytes(4, "little")


def _inflating_chunk(file: h5py.File, folder: Path) -> None:
    _replaced(file, "channels/s", shape=(SIZE,), dtype="i4", chunks=(CHUNK,), **FILTERS)
    file["channels/s"].id.write_direct_chunk((0,), _packed())


def _text(file: h5py.File, name: str, text: bytes) -> None:
    _replaced(file, name, data=np.frombuffer(text, np.uint8), chunks=True)
    file[name].attrs["size"] = len(text)


def _attribute(path: str, name: str, value: object) -> Callable[[h5py.File, Path], None]:
    return lambda file, folder: file[path].attrs.__setitem__(name, value)


HOSTILE: dict[str, Callable[[h5py.File, Path], None]] = {
    "external link": _external_link,
    "link for a group": _soft_groups,
    "raw storage of another file": _raw_storage,
    "virtual over another file": _virtual,
    "a chunk of 2 GB": lambda f, d: _replaced(
        f, "channels/s", shape=(SIZE,), maxshape=(None,), dtype="i4", chunks=(1 << 29,), **FILTERS
    ),
    "a chunk that grows": _inflating_chunk,
    "a chunk of 2 GB of text": lambda f, d: _replaced(
        f, "setup", shape=(1 << 31,), dtype="u1", chunks=(1 << 31,), **FILTERS
    ),
    "a size of 1e15": _attribute("groups/g", "size", 1e15),
    "half of the size": _attribute("groups/g", "size", SIZE // 2),
    "an infinite rate": _attribute("groups/g", "rate_Hz", np.inf),
    "no rate": lambda f, d: f["groups/g"].attrs.__delitem__("rate_Hz"),
    "samples of text": lambda f, d: _replaced(
        f, "channels/s", data=np.array([b"a"] * SIZE), chunks=(CHUNK,)
    ),
    "complex samples": lambda f, d: _replaced(
        f, "channels/s", data=np.zeros(SIZE, complex), chunks=(CHUNK,)
    ),
    "samples of two axes": lambda f, d: _replaced(
        f, "channels/s", data=np.zeros((SIZE, 2)), chunks=(CHUNK, 2)
    ),
    "lists for samples": lambda f, d: _replaced(
        f, "channels/s", shape=(SIZE,), dtype=h5py.vlen_dtype("i4"), chunks=(CHUNK,)
    ),
    "no samples": lambda f, d: _replaced(
        f, "channels/s", shape=(0,), maxshape=(None,), dtype="i4", chunks=(CHUNK,)
    ),
    "a start beyond all time": lambda f, d: _replaced(
        f, "groups/g/start_s", data=[1e300], chunks=True
    ),
    "a period of nothing": lambda f, d: _replaced(
        f, "groups/g/period_s", data=[np.nan], chunks=True
    ),
    "no start": lambda f, d: _replaced(
        f, "groups/g/start_s", data=np.zeros(0), chunks=(1,), maxshape=(None,)
    ),
    "flags from nowhere": lambda f, d: _replaced(
        f, "flags/s/start", data=np.array([-5]), chunks=True
    ),
    "decimals without end": _attribute("channels/s", "decimals", 1e9),
    "another group": _attribute("channels/s", "group", np.bytes_(b"nowhere")),
    "a group in the heap": _attribute("channels/s", "group", "g"),
    "a version of text": _attribute("/", "tirelog_run", "2"),
    "the version before": _attribute("/", "tirelog_run", 1),
    "a setup of other text": lambda f, d: _text(f, "setup", b"\xff\xfe"),
    "deep provenance": lambda f, d: _text(f, "provenance", b"[" * 100_000),
    "provenance that counts words": lambda f, d: _text(f, "provenance", b'{"counts": {"a": "b"}}'),
    "provenance that is a list": lambda f, d: _text(f, "provenance", b"[1]"),
    "nothing but the attribute": lambda f, d: [f.__delitem__(name) for name in list(f)] and None,
}


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("name", HOSTILE)
def test_a_run_of_somebody_else_is_checked_as_any_file(
    tmp_path: Path, written: bytes, name: str, signed: bool
) -> None:
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
    with pytest.raises(ReadError, match=r"^log: the run is damaged"), open_run(path, "log"):
        pass


def test_columns_that_were_exchanged_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path / "r.h5")
    with h5py.File(tmp_path / "r.h5", "r+") as file:
        file["channels/s"][7] = 1
        assert check_columns(file) == ["s"]
    assert run(["info", str(tmp_path / "r.h5"), "--quiet"]) == 3  # for its lost rows
    assert "is not what was written" not in capsys.readouterr().err
    assert run(["info", str(tmp_path / "r.h5"), "--quiet", "--verify"]) == 3
    assert "r.h5: s is not what was written (sha256)" in capsys.readouterr().err


def test_a_closed_recording_says_so(tmp_path: Path) -> None:
    """Kept longer than it is open: a run, a log that went through a temporary run, and times of
    their own.
    """
    write(tmp_path / "r.h5", np.linspace(0.0, 20.0, 2000) ** 1.1)
    rows = [f"{k / 100 + 0.003 * (k % 3)},{k % 7}" for k in range(3000)]
    (tmp_path / "log.csv").write_text("time_s,c\n" + "\n".join(rows) + "\n")
    (tmp_path / "log.toml").write_text('[channels.v]\nkind = "vehicle_speed"\nsource = "c"\n')
    with (
        suppress(typer.Exit),
        Session(None, quiet=True) as session,
    ):  # the run says that it has lost rows
        kept = list(session.recordings([str(tmp_path / "r.h5"), str(tmp_path / "log.csv")]))
    assert len(kept) == 2
    for recording in kept:
        for channel in recording.channels.values():
            with pytest.raises(ReadError, match="the recording is closed"):
                channel.read()
    with pytest.raises(ReadError, match="the recording is closed"):
        kept[0].channels["v"].axis.time(0, 10)


def test_an_ingested_log_is_what_was_read(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(
        "time_s,c\n" + "\n".join(f"{k / 100:.2f},{k % 7}" for k in range(3000)) + "\n"
    )
    (tmp_path / "log.toml").write_text('[channels.v]\nkind = "vehicle_speed"\nsource = "c"\n')
    write_run(str(tmp_path / "log.csv"), None, tmp_path / "r.h5")
    with (
        open_recording(str(tmp_path / "log.csv")) as log,
        open_recording(str(tmp_path / "r.h5")) as stored,
    ):
        assert np.array_equal(log.channels["v"].read(), stored.channels["v"].read())
    with h5py.File(tmp_path / "r.h5") as file:
        assert check_columns(file) == []
