"""ROS bags as MCAP: ROS 1 by its own definitions, the .db3 of ROS 2 message by message.

rosbags makes Python code of the definitions in a ROS 1 bag and runs it; so every name in them is
looked at first.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tirelog.readers.extra.child import Answer, NoNumbers

_TYPE = re.compile(r"[A-Za-z]\w{0,99}(/[A-Za-z]\w{0,99}){1,3}", re.ASCII)
_FIELD = re.compile(r"[A-Za-z]\w{0,99}", re.ASCII)
_HEADER = "std_msgs/msg/Header"
_ZSTD = b"\x28\xb5\x2f\xfd"
#: bytes of one message, as for MCAP, and of a chunk that is written
_MESSAGE_BYTES, _CHUNK_BYTES = 1 << 23, 1 << 20
#: types of one definition, and values of an array of fixed length in it, for which code is made
_MOST_TYPES, _MOST_VALUES = 500, 1 << 16


def load() -> None:
    """Imports what reads it."""
    import mcap.writer  # noqa: F401
    import rosbags.rosbag1
    import rosbags.rosbag2
    import rosbags.typesys  # noqa: F401
    import zstandard  # noqa: F401


def convert(source: Path, target: Path, answer: Answer) -> None:
    """Writes the messages of the bag's topics to `target`.  NoNumbers: it has none."""
    from mcap.writer import CompressionType, Writer

    with source.open("rb") as file:
        first = file.read(9) == b"#ROSBAG V"
    with target.open("wb") as made, _opened(source, target, first) as reader:
        writer = Writer(made, chunk_size=_CHUNK_BYTES, compression=CompressionType.NONE)
        writer.start(profile="ros2")
        topics = _Topics(writer, answer)
        connections = [one for one in reader.connections if topics.add(one, first)]
        if connections:
            for connection, time_ns, data in reader.messages(connections):
                topics.message(connection, time_ns, data)
        writer.finish()
    topics.finish()
    if not topics.written:
        raise NoNumbers("it holds no message that can be read")


@contextmanager
def _opened(source: Path, target: Path, first: bool) -> Iterator[Any]:
    """The library's reader.  Its name tells the library what a file is, and may not say more."""
    if first:
        from rosbags.rosbag1 import Reader as Reader1

        with Reader1(source) as one:
            yield one
    else:
        from rosbags.rosbag2 import Reader as Reader2

        link = target.with_name("bag.db3")
        link.symlink_to(source)
        with Reader2(link) as two:
            yield two


class _Topics:
    """The channels of the MCAP that is written."""

    def __init__(self, writer: Any, answer: Answer) -> None:
        self.writer, self.answer = writer, answer
        self.channels: dict[int, tuple[int, Any]] = {}  # with the store that makes ROS 1 CDR
        self.names: dict[int, str] = {}
        self.lost: dict[int, int] = {}
        self.written = 0

    def add(self, connection: Any, first: bool) -> bool:
        """True if the topic's messages can be read; else it is passed over, and said."""
        from rosbags.interfaces import MessageDefinitionFormat
        from rosbags.typesys import Stores, get_typestore

        store, text, kind = None, str(connection.msgdef.data), str(connection.msgtype)
        try:
            if first:
                store = _store(text, kind)
                text, _ = store.generate_msgdef(kind, ros_version=2)
            elif getattr(connection.ext, "serialization_format", "") != "cdr":
                raise ValueError("its messages are no CDR")
            elif connection.msgdef.format == MessageDefinitionFormat.NONE:
                text, _ = get_typestore(Stores.LATEST).generate_msgdef(kind, ros_version=2)
            elif connection.msgdef.format != MessageDefinitionFormat.MSG:
                raise ValueError("its definition is no .msg")
        # the library's own errors are of several trees, and a definition may be anything
        except Exception as problem:
            self.answer.passed_over.append(f"topic {connection.topic} of {kind} ({problem})")
            return False
        schema = self.writer.register_schema(kind, "ros2msg", text.encode())
        channel = self.writer.register_channel(str(connection.topic), "cdr", schema)
        self.channels[connection.id] = channel, store
        self.names[connection.id] = str(connection.topic)
        return True

    def message(self, connection: Any, time_ns: int, data: bytes) -> None:
        """Writes one message; one that cannot be is counted."""
        channel, store = self.channels[connection.id]
        try:
            if store is not None:
                data = bytes(store.ros1_to_cdr(data, connection.msgtype))
            elif data.startswith(_ZSTD):
                data = _unpacked(data)
            if len(data) > _MESSAGE_BYTES or not 0 <= time_ns < 1 << 63:
                raise ValueError
        except MemoryError:
            raise
        except Exception:
            self.lost[connection.id] = self.lost.get(connection.id, 0) + 1
            return
        self.writer.add_message(channel, time_ns, data, time_ns)
        self.written += 1

    def finish(self) -> None:
        """Says what was lost."""
        for number, many in self.lost.items():
            self.answer.losses.append(
                f"topic {self.names[number]}: {many} messages are damaged and lost"
            )


def _unpacked(data: bytes) -> bytes:
    import zstandard

    if not 0 <= zstandard.frame_content_size(data) <= _MESSAGE_BYTES:
        raise ValueError
    return zstandard.ZstdDecompressor().decompress(data)


def _store(text: str, kind: str) -> Any:
    """A store of the types in a definition of ROS 1.  ValueError: it has a name that is none."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_types_from_msg(text, kind)
    check_names(types)
    constants, fields = types.get(_HEADER, ([], []))
    if fields and fields[0][0] == "seq":  # which ROS 2 does not have, and the library leaves out
        types[_HEADER] = constants, fields[1:]
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    if kind not in store.fielddefs:
        raise ValueError(f"it defines {', '.join(store.fielddefs)[:80]}")
    return store


def check_names(types: dict[str, Any]) -> None:
    """ValueError: a name in parsed definitions is more than a name, or an array is too long."""
    if len(types) > _MOST_TYPES:
        raise ValueError(f"it defines more than {_MOST_TYPES} types")
    for name, (constants, fields) in types.items():
        for field, described in fields:
            _check(field, _FIELD)
            for word, size in _named(described):
                _check(word, _TYPE if "/" in word else _FIELD)
                if size > _MOST_VALUES:
                    raise ValueError(f"it has an array of {size} values")
        for field, word, value in constants:
            _check(field, _FIELD)
            _check(word, _FIELD)
            if not isinstance(value, bool | int | float | str):
                raise ValueError("it has a constant that is none")
        _check(name, _TYPE)


def _check(name: object, pattern: re.Pattern[str]) -> None:
    if not isinstance(name, str) or not pattern.fullmatch(name):
        raise ValueError(f"{str(name)[:40]!r} is no name")


def _named(described: Any) -> Iterable[tuple[str, int]]:
    """(name of a type, length of an array of it) in the library's description of a field."""
    kind, inside = described
    if int(kind) == 1:  # a number or a text
        yield str(inside[0]), int(inside[1])
    elif int(kind) == 2:
        yield str(inside), 0
    else:
        yield from ((word, max(size, int(inside[1]))) for word, size in _named(inside[0]))
