"""MCAP logs for the tests, written by the library's own writers."""

import json
from contextlib import ExitStack, contextmanager
from pathlib import Path

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.writer import CompressionType, Writer

from tests.readers.logs import setup_of, whole
from tirelog.readers.mcap.reader import McapLog

START_NS = 1_700_000_000_000_000_000
MULTI_ARRAY = """std_msgs/MultiArrayLayout layout
float64[] data
================================================================================
MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset
================================================================================
MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
"""
STAMPED = """# a stamped message of everything
uint8 LIMIT=3
std_msgs/Header header
string[] names
float64[<=9] position
bool on
int16[3] counts
Sub[] subs   # of this package
float32[4] fixed
float64 last 1.5
================================================================================
MSG: my_msgs/Sub
int8 small
float64 value
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
NONE, LZ4, ZSTD = CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD


def read(source, sources, log="", **keys):
    """(values per channel, stamps per group, the reader) of a whole log."""
    setup = setup_of(sources, log, **{"kind": "temperature", **keys})
    with ExitStack() as leaving:
        path = Path(source) if isinstance(source, str | Path) else None
        stream = source if path is None else leaving.enter_context(path.open("rb"))
        reader = McapLog(stream, setup, "log.mcap", path)
        values, stamps, _ = whole(reader)
    return values, stamps, reader


@contextmanager
def writing(path, *, compression=ZSTD, chunk_size=20_000, **options):
    """The library's writer of a log."""
    with open(path, "wb") as stream:
        writer = Writer(stream, compression=compression, chunk_size=chunk_size, **options)
        writer.start()
        yield writer
        writer.finish()


def write_json(path, messages, **options):
    """`messages`: (topic, log time in ns, object or bytes)."""
    schema = ("any", "jsonschema", b"{}")
    coded = (
        (topic, at, m if isinstance(m, bytes) else json.dumps(m).encode())
        for topic, at, m in messages
    )
    return write_messages(path, coded, "json", schema, **options)


def write_messages(path, messages, encoding, schema, **options):
    """`messages`: (topic, log time in ns, bytes), all of one schema."""
    channels = {}
    with writing(path, **options) as writer:
        number_of = writer.register_schema(*schema)
        for number, (topic, time_ns, data) in enumerate(messages):
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, encoding, number_of)
            writer.add_message(channels[topic], time_ns, data, time_ns, number)
    return path


def write_ros2(path, messages, *, compression=ZSTD, chunk_size=20_000):
    """`messages`: (topic, log time in ns, schema name, definition, message)."""
    from mcap_ros2.writer import Writer as Ros2Writer

    with open(path, "wb") as stream:
        writer = Ros2Writer(stream, compression=compression, chunk_size=chunk_size)
        schemas = {}
        for number, (topic, time_ns, name, definition, message) in enumerate(messages):
            if name not in schemas:
                schemas[name] = writer.register_msgdef(name, definition)
            writer.write_message(topic, schemas[name], message, time_ns, time_ns, number)
        writer.finish()
    return path


def protobuf_class():
    """tire.Sample: a stamp, doubles, a signed varint, a text, packed doubles."""
    file = descriptor_pb2.FileDescriptorProto(name="tire.proto", package="tire", syntax="proto3")
    F = descriptor_pb2.FieldDescriptorProto

    def message(name, *fields):
        made = file.message_type.add(name=name)
        for number, (field, kind, *rest) in enumerate(fields, 1):
            repeated = F.LABEL_REPEATED if "repeated" in rest else F.LABEL_OPTIONAL
            type_name = next((r for r in rest if r.startswith(".")), None)
            made.field.add(
                name=field, number=number, type=kind, label=repeated, type_name=type_name
            )

    message("Stamp", ("seconds", F.TYPE_INT64), ("nanos", F.TYPE_INT32))
    message(
        "Sample",
        ("stamp", F.TYPE_MESSAGE, ".tire.Stamp"),
        ("strain", F.TYPE_DOUBLE),
        ("load", F.TYPE_FLOAT),
        ("steps", F.TYPE_SINT32),
        ("note", F.TYPE_STRING),
        ("batch", F.TYPE_DOUBLE, "repeated"),
        ("count", F.TYPE_INT64),
    )
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(
        pool.FindMessageTypeByName("tire.Sample")
    ), descriptor_pb2.FileDescriptorSet(file=[file])


def write_protobuf(path, messages, **options):
    """`messages`: (topic, log time in ns, message of `protobuf_class`)."""
    schema = ("tire.Sample", "protobuf", protobuf_class()[1].SerializeToString())
    coded = ((topic, at, message.SerializeToString()) for topic, at, message in messages)
    return write_messages(path, coded, "protobuf", schema, **options)
