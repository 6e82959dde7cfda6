"""Faults: what a store says is told by its codes and never by its words, and within its time."""

import errno
import gzip
import io
import time
from pathlib import Path

import pytest

from tirelog.cli import run
from tirelog.errors import OutputError, ReadError, is_outside_log
from tirelog.storage import remote
from tirelog.storage.remote import address, list_remote, match_remote, read_several, write_remote

SAMPLES = Path(__file__).parents[2] / "sample_data"


def test_a_store_out_of_order_is_no_fault_of_what_is_in_it(monkeypatch):
    class Store:
        protocol = "s3"

        def pipe_file(self, *_):
            raise ValueError("ServiceUnavailable")

    monkeypatch.setattr(remote, "_filesystem", lambda url: Store())
    with pytest.raises(OutputError, match="cannot be reached") as refused:
        write_remote("s3://bucket/a", b"")
    assert is_outside_log(refused.value)


def test_several_objects_are_waited_for_no_longer_than_one(monkeypatch):
    class Silent:
        _strip_protocol = staticmethod(str)

        def cat(self, *_, **__):
            time.sleep(30.0)
            return {}

    monkeypatch.setattr(remote, "_filesystem", lambda url: Silent())
    monkeypatch.setattr(remote, "ANSWER_S", 0.05)
    with pytest.raises(ReadError, match=r"no answer within 0\.05 s"):
        read_several(["s3://bucket/a", "s3://bucket/b"])


def test_an_address_of_this_machine_is_one_place_however_it_is_spelt(tmp_path):
    pytest.importorskip("fsspec")
    there = f"file://{tmp_path}/a.txt"
    assert there.startswith("file:///")
    assert address(there) == address(Path(there)) == there
    write_remote(there, b"whole")
    assert (tmp_path / "a.txt").read_bytes() == b"whole"
    assert list_remote(f"file://{tmp_path}") == ["a.txt"]
    assert match_remote(f"file://{tmp_path}/*.txt") == [there]


@pytest.mark.parametrize("name", ["drive.csv", "drive.csv.gz", "encoder.h5", "drive_messages.mcap"])
def test_a_store_that_goes_is_no_damage_of_the_log(tmp_path, monkeypatch, capfd, name):
    """A store that answers with an error from the second half of the object on."""
    memory = pytest.importorskip("fsspec").filesystem("memory")
    source = SAMPLES / name
    data = (
        source.read_bytes()
        if source.exists()
        else gzip.decompress(Path(f"{source}.gz").read_bytes())
    )

    class Going(io.BytesIO):
        def readinto(self, room):
            if self.tell() + len(room) > len(data) // 2:
                raise OSError(errno.EBUSY, "SlowDown")
            return super().readinto(room)

        def read(self, size=-1):
            room = bytearray(size if size and size > 0 else len(data))
            return bytes(room[: self.readinto(room)])

    monkeypatch.setattr(type(memory), "open", lambda *_, **__: Going(data))
    output = tmp_path / "t.csv"
    table = "phase-shift" if name.endswith("h5") else "speed"
    setup = str(source.with_suffix("").with_suffix("")) + ".toml"
    assert run([table, f"memory://b/{name}", "--setup", setup, "-o", str(output)]) == 4
    assert "cannot be reached (OSError: [Errno 16] SlowDown)" in capfd.readouterr().err
    assert not output.exists()
