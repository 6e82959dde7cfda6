"""Faults: what a store says is told by its codes and never by its words, and within its time."""

import time
from pathlib import Path
from typing import Any

import pytest

from tirelog.errors import OutputError, ReadError
from tirelog.storage import remote
from tirelog.storage.remote import (
    address,
    create_remote,
    list_remote,
    match_remote,
    read_several,
    write_remote,
)


class Refusal(Exception):
    """As stores raise it: with a response, or with a status."""

    def __init__(self, text: str, **told: Any) -> None:
        super().__init__(text)
        vars(self).update(told)


def refusing(monkeypatch: pytest.MonkeyPatch, problem: Exception) -> None:
    """A store that answers everything with `problem`."""

    class Store:
        def pipe_file(self, *_: Any, **__: Any) -> None:
            raise problem

    monkeypatch.setattr(remote, "_filesystem", lambda url: Store())


def caused_by(cause: Exception) -> OSError:
    problem = OSError("translated")
    problem.__cause__ = cause
    return problem


@pytest.mark.parametrize(
    "problem",
    [
        FileExistsError(),
        Refusal("no", response={"Error": {"Code": "PreconditionFailed"}}),
        Refusal("no", status=412),
        caused_by(Refusal("no", code=412)),
    ],
)
def test_what_a_store_has_is_not_created(
    monkeypatch: pytest.MonkeyPatch, problem: Exception
) -> None:
    refusing(monkeypatch, problem)
    assert create_remote("s3://bucket/lock", b"") is False


@pytest.mark.parametrize(
    "problem",
    [
        Refusal("ServiceUnavailable, request id 94120AF412C", response={"Error": {"Code": "503"}}),
        Refusal("PreconditionFailed is not what it is", status=500),
    ],
)
def test_a_store_out_of_order_holds_nothing(
    monkeypatch: pytest.MonkeyPatch, problem: Exception
) -> None:
    refusing(monkeypatch, problem)
    with pytest.raises(OutputError, match="cannot be reached"):
        create_remote("s3://bucket/lock", b"")


def test_several_objects_are_waited_for_no_longer_than_one(monkeypatch: pytest.MonkeyPatch) -> None:
    class Silent:
        _strip_protocol = staticmethod(str)

        def cat(self, *_: Any, **__: Any) -> dict[str, bytes]:
            time.sleep(30.0)
            return {}

    monkeypatch.setattr(remote, "_filesystem", lambda url: Silent())
    monkeypatch.setattr(remote, "ANSWER_S", 0.05)
    with pytest.raises(ReadError, match=r"no answer within 0\.05 s"):
        read_several(["s3://bucket/a", "s3://bucket/b"])


def test_an_address_of_this_machine_is_one_place_however_it_is_spelt(tmp_path: Path) -> None:
    pytest.importorskip("fsspec")
    there = f"file://{tmp_path}/a.txt"
    assert there.startswith("file:///")
    assert address(there) == address(Path(there)) == there
    write_remote(there, b"whole")
    assert (tmp_path / "a.txt").read_bytes() == b"whole"
    assert list_remote(f"file://{tmp_path}") == ["a.txt"]
    assert match_remote(f"file://{tmp_path}/*.txt") == [there]
