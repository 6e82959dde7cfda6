"""Property: what comes out of an MCAP log is what was written, by whatever path it is decoded."""

import io

import numpy as np
import pytest

from tests.readers.logs import Pipe
from tests.readers.mcap_files import (
    LZ4,
    MULTI_ARRAY,
    NONE,
    STAMPED,
    START_NS,
    ZSTD,
    protobuf_class,
    read,
    write_json,
    write_protobuf,
    write_ros2,
)
from tirelog.readers.mcap import decode as mcap_decode
from tirelog.readers.mcap import records as mcap_order
from tirelog.readers.mcap.fields import extract, parse_path, topic_and_field

STEP_NS = 400_000
N = 1500


@pytest.fixture
def path(tmp_path):
    return tmp_path / "log.mcap"


def times(n=N, step=STEP_NS):
    return (START_NS + step * np.arange(n)).tolist()


def timed(messages, topic="/t", step=STEP_NS):
    """The messages of a topic with their times."""
    return [(topic, START_NS + step * i, message) for i, message in enumerate(messages)]


def counted(n=N):
    """Messages that hold their number as x."""
    return timed([{"x": i} for i in range(n)])


def assert_stamps(stamps, step_s=STEP_NS * 1e-9, n=N):
    np.testing.assert_allclose(stamps["clock_1"], np.arange(n) * step_s, rtol=0, atol=1e-9)


@pytest.mark.parametrize("compression", [NONE, LZ4, ZSTD])
def test_json_one_sample_a_message(path, compression):
    wl = 1550 + np.random.default_rng(1).normal(size=(N, 3)).round(4)
    messages = timed([{"wl": row.tolist(), "ok": True} for row in wl], "/fbg")
    write_json(path, messages, compression=compression)
    values, stamps, reader = read(path, {"a": "/fbg:wl[0]", "b": "/fbg:wl[2]", "c": "/fbg:ok"})
    np.testing.assert_array_equal(values["a"], wl[:, 0])
    np.testing.assert_array_equal(values["b"], wl[:, 2])
    np.testing.assert_array_equal(values["c"], np.ones(N))
    assert [g.channels for g in reader.groups] == [("a", "b", "c")]
    assert_stamps(stamps)
    assert reader.report.start == "2023-11-14T22:13:20+00:00"
    assert (reader.report.losses, reader.report.remarks) == ([], [])


@pytest.mark.parametrize("name", ["FBG 1 [nm]", "wl[0]", "a.b", "a..b", "#7", "2", "Größe, außen"])
def test_a_field_of_json_may_have_any_name(path, name):
    write_json(path, timed([{name: i, "other": [-i], "wl": [-1.0]} for i in range(N)]))
    values, _, _ = read(path, {"x": f"/t:{name}"})
    np.testing.assert_array_equal(values["x"], np.arange(N))


@pytest.mark.parametrize(
    ("name", "unit"), [("T (°C)", "degC"), ("T [K]", "K"), ("T", None), ("T[1]", None)]
)
def test_the_unit_of_a_name_is_the_channel_s(path, name, unit):
    write_json(path, timed([{name: i, "T": [1.0, 2.0]} for i in range(N)]))
    assert read(path, {"x": f"/t:{name}"})[2].setup.channels["x"].unit == unit


def test_a_stream_that_cannot_seek_gives_the_same(path):
    write_json(path, counted())
    stream = io.BufferedReader(Pipe(path.read_bytes()))
    np.testing.assert_array_equal(read(stream, {"x": "/t:x"})[0]["x"], np.arange(N))


def stamped(i, rng):
    stamp = START_NS + 5_000_000 + i * STEP_NS
    return {
        "header": {
            "stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9},
            "frame_id": ("tire", "wheel_of_the_car")[i // 700 % 2],
        },
        "names": ["a", "bc"][: 1 + i // 400 % 2],
        "position": rng.normal(size=2).tolist(),
        "on": bool(i % 2),
        "counts": [i % 100, -i % 100, 7],
        "subs": [{"small": -3, "value": 0.5 * i}] * (1 + i // 500 % 2),
        "fixed": [1.0, 2.0, 3.0, float(i % 1000)],
        "last": float(i),
    }


ROS_SOURCES = {
    "position": "/joint:position[1]", "on": "/joint:on", "counts": "/joint:counts[1]",
    "value": "/joint:subs[0].value", "fixed": "/joint:fixed[3]", "last": "/joint:last",
    "all": "/joint:position", "some": "/joint:fixed[1::2]",
}  # fmt: skip


def test_ros2_of_every_kind_with_its_own_stamp_by_layouts_and_by_the_library(path, monkeypatch):
    rng = np.random.default_rng(2)
    messages = [stamped(i, rng) for i in range(N)]
    kind = ("my_msgs/msg/Joint", STAMPED)
    write_ros2(path, [("/joint", t, *kind, m) for t, m in zip(times(), messages, strict=True)])
    one_a_message = dict(list(ROS_SOURCES.items())[:-2])
    values, stamps, reader = read(path, one_a_message)
    np.testing.assert_array_equal(values["position"], [m["position"][1] for m in messages])
    np.testing.assert_array_equal(values["on"], np.arange(N) % 2)
    np.testing.assert_array_equal(values["counts"], -np.arange(N) % 100)
    np.testing.assert_array_equal(values["value"], 0.5 * np.arange(N))
    np.testing.assert_array_equal(values["fixed"], np.arange(N) % 1000)
    np.testing.assert_array_equal(values["last"], np.arange(N))
    assert_stamps(stamps)
    assert reader.report.start.startswith("2023-11-14T22:13:20.005")
    decoder = next(iter(reader.decoders.values()))
    assert decoder.learned == len(decoder.layouts)
    # two frames, one or two names, one or two subs: no message by the library
    assert 4 <= len(decoder.layouts) <= 12
    fast, fast_stamps, _ = read(path, ROS_SOURCES)
    monkeypatch.setattr(mcap_decode, "MOST_LEARNED", 0)  # the library alone decodes
    plain, plain_stamps, reader = read(path, ROS_SOURCES)
    for ours, theirs in ((fast, plain), (fast_stamps, plain_stamps)):
        assert ours.keys() == theirs.keys()
        for name in ours:
            np.testing.assert_array_equal(ours[name], theirs[name])
    assert len(next(iter(reader.decoders.values())).layouts) == 0


def test_ros2_messages_of_one_size_that_are_laid_out_otherwise(path):
    """A name grows by the bytes that another gives up, and the number between them moves."""
    kind = ("my_msgs/msg/Named", "string a\nfloat64 x\nstring b\n")
    rows = [
        {"a": "n" * (20 - 16 * (i % 2)), "x": float(i), "b": "n" * (4 + 16 * (i % 2))}
        for i in range(100)
    ]
    write_ros2(path, [("/t", t, *kind, row) for t, row in zip(times(100), rows, strict=True)])
    values, _, reader = read(path, {"x": "/t:x"})
    np.testing.assert_array_equal(values["x"], np.arange(100))
    layouts = next(iter(reader.decoders.values())).layouts
    assert len(layouts) == 2
    assert layouts[0].size == layouts[1].size


def sample(i, rng):
    stamp = START_NS + i * STEP_NS
    made = protobuf_class()[0]()
    made.stamp.seconds, made.stamp.nanos = stamp // 10**9, stamp % 10**9
    made.strain = 0.0 if i % 97 == 0 else rng.normal()
    made.load, made.steps, made.note = float(i % 50), i % 300 - 150, "x" * (i // 400)
    made.count = -1 if i % 200 == 0 else i
    made.batch.extend(rng.normal(size=5))
    return made


def test_protobuf_of_every_kind_with_its_own_stamp(path):
    rng = np.random.default_rng(3)
    messages = [sample(i, rng) for i in range(N)]
    write_protobuf(path, [("/tire", t + 99, m) for t, m in zip(times(), messages, strict=True)])
    plain = ("strain", "load", "steps", "count")
    sources = {name: f"/tire:{name}" for name in plain} | {"third": "/tire:batch[2]"}
    values, stamps, _ = read(path, sources)
    for name in plain:
        np.testing.assert_array_equal(values[name], [getattr(m, name) for m in messages])
    np.testing.assert_array_equal(values["third"], [m.batch[2] for m in messages])
    assert_stamps(stamps)


@pytest.mark.parametrize("log", ["sampling_rate_Hz = 2500.0", ""])
def test_batches_begin_at_their_stamp_and_go_on_at_the_rate(path, log):
    """250 samples a message at 2.5 kHz; without a rate the median step between batches gives it."""
    batches = np.random.default_rng(5).normal(size=(40, 250))
    kind = ("std_msgs/msg/Float64MultiArray", MULTI_ARRAY)
    layout = {"dim": [], "data_offset": 0}
    messages = [
        ("/fbg", t, *kind, {"layout": layout, "data": row.tolist()})
        for t, row in zip(times(40, 100_000_000), batches, strict=True)
    ]
    write_ros2(path, messages)
    values, stamps, reader = read(path, {"x": "/fbg:data"}, log=log)
    np.testing.assert_array_equal(values["x"], batches.ravel())
    assert_stamps(stamps, 1 / 2500, 10_000)
    assert reader.groups[0].rate_Hz is None


def test_the_rate_is_read_from_a_field_of_the_message(path):
    write_json(path, timed([{"fs": 100.0, "x": [1.0, 2.0]}] * 30, step=500_000_000))
    _, stamps, reader = read(path, {"x": "/t:x"})
    assert reader.groups[0].rate_Hz == 100.0
    np.testing.assert_allclose(stamps["clock_1"][:4], [0.0, 0.01, 0.5, 0.51], atol=1e-12)


def test_rows_of_gratings_laid_end_to_end_and_lists_of_lists(path):
    data = np.arange(40 * 10 * 4.0).reshape(40, 10, 4)
    write_json(path, timed([{"flat": m.ravel().tolist(), "rows": m.tolist()} for m in data]))
    sources = {"a": "/t:flat[1::4]", "b": "/t:flat[3::4]", "c": "/t:rows[:][3]"}
    values, _, reader = read(path, sources, log="sampling_rate_Hz = 25000.0")
    np.testing.assert_array_equal(values["a"], data[:, :, 1].ravel())
    np.testing.assert_array_equal(values["b"], data[:, :, 3].ravel())
    np.testing.assert_array_equal(values["c"], data[:, :, 3].ravel())
    assert [g.channels for g in reader.groups] == [("a", "b", "c")]


@pytest.mark.parametrize("raw", [b"\x01\x02", b"", [1, 2.5, True], [None, 3]])
def test_bytes_and_lists_are_batches_of_numbers(raw):
    wanted = [np.nan if number is None else float(number) for number in raw]
    np.testing.assert_array_equal(extract({"a": raw}, ("a", slice(None))), wanted)


def test_lists_within_a_list_are_named():
    with pytest.raises(ValueError, match="has lists within a list; allowed is one axis of time"):
        extract({"a": [[1, 2], [3]]}, ("a", slice(None)))


def test_batches_of_unlike_lengths(path):
    sizes = [3, 5, 0, 4, 1] * 60
    write_json(path, timed([{"x": list(range(k))} for k in sizes]))
    values, stamps, _ = read(path, {"x": "/t:x"}, log="sampling_rate_Hz = 100000.0")
    np.testing.assert_array_equal(values["x"], np.concatenate([np.arange(k) for k in sizes]))
    assert stamps["clock_1"][3] == pytest.approx(STEP_NS * 1e-9, abs=1e-12)


def test_the_time_that_the_setup_names(path):
    clock = [{"x": i, "clock_ms": 5.0 + 0.4 * i} for i in range(N)]
    write_json(path, [(topic, at + at % 7, message) for topic, at, message in timed(clock)])
    _, stamps, reader = read(path, {"x": "/t:x"}, log='time = "clock_ms"\ntime_unit = "ms"')
    assert_stamps(stamps, 0.4e-3)
    assert ["another origin" in remark for remark in reader.report.remarks] == [True]


def test_topics_are_groups_with_one_origin(path):
    slow = [("/slow", t + 1_000_000, {"y": i}) for i, t in enumerate(times(50))]
    write_json(path, sorted(counted() + slow, key=lambda m: m[1]))
    values, stamps, reader = read(path, {"x": "/t:x", "y": "/slow:y"})
    assert sorted(g.channels for g in reader.groups) == [("x",), ("y",)]
    group = next(g.name for g in reader.groups if g.channels == ("y",))
    assert stamps[group][0] == pytest.approx(0.001, abs=1e-12)
    np.testing.assert_array_equal(values["y"], np.arange(50))


def test_messages_out_of_order_across_chunks_are_put_in_order(path):
    order = np.random.default_rng(6).permutation(N)
    messages = counted()
    write_json(path, [messages[i] for i in order], chunk_size=2000)
    values, stamps, reader = read(path, {"x": "/t:x"})
    np.testing.assert_array_equal(values["x"], np.arange(N))
    assert (np.diff(stamps["clock_1"]) > 0).all()
    assert reader.report.losses == []


def test_what_comes_too_late_for_bounded_memory_is_said(path, monkeypatch):
    monkeypatch.setattr(mcap_order, "HELD_VALUES", 200)
    messages = counted()
    write_json(path, [*messages[5:], *messages[:5]], chunk_size=2000)
    values, _, reader = read(path, {"x": "/t:x"})
    np.testing.assert_array_equal(values["x"], np.arange(5, N))
    assert ["5 samples came too late" in loss for loss in reader.report.losses] == [True]


@pytest.mark.parametrize("held", [7, 100, 1 << 19])
@pytest.mark.parametrize("chunk_size", [100, 5000, 1 << 20])
def test_blocks_of_any_size_give_the_same_samples(path, monkeypatch, held, chunk_size):
    monkeypatch.setattr(mcap_order, "HELD_VALUES", held)
    pairs = np.stack([np.arange(300), -np.arange(300)], 1)
    write_json(path, timed([{"x": pair} for pair in pairs.tolist()]), chunk_size=chunk_size)
    values, stamps, _ = read(path, {"x": "/t:x", "y": "/t:x[1]"}, log="sampling_rate_Hz = 5000.0")
    np.testing.assert_array_equal(values["x"], pairs.ravel())
    np.testing.assert_array_equal(values["y"], -np.arange(300))
    assert_stamps(stamps, 1 / 5000, 600)


def test_a_topic_that_begins_late_is_not_lost(path, monkeypatch):
    monkeypatch.setattr("tirelog.readers.mcap.reader.READ_AHEAD_BYTES", 5000)
    late = [("/late", times()[-1], {"y": [i, i + 1]}) for i in range(10)]
    write_json(path, counted() + late, chunk_size=2000)
    values, _, reader = read(path, {"x": "/t:x", "y": "/late:y", "z": "/late:y[0]"})
    assert len(reader.groups) == 3
    np.testing.assert_array_equal(values["x"], np.arange(N))
    np.testing.assert_array_equal(values["y"], np.ravel([(i, i + 1) for i in range(10)]))
    np.testing.assert_array_equal(values["z"], np.arange(10))


@pytest.mark.parametrize("checked", [False, True])
def test_messages_outside_of_chunks(path, checked):
    write_json(path, counted(), use_chunking=False, enable_data_crcs=checked)
    values, _, reader = read(path, {"x": "/t:x"})
    np.testing.assert_array_equal(values["x"], np.arange(N))
    said = ["no checksum" in remark for remark in reader.report.remarks]
    assert said == ([] if checked else [True])


@pytest.mark.parametrize(
    ("source", "topic", "tokens"),
    [
        ("/a/b:c.d[3]", "/a/b", ("c", "d", 3)),
        ("ns::t:c[2::16]", "ns::t", ("c", slice(2, None, 16))),
        ("/t:c[:].d", "/t", ("c", slice(None), "d")),
        ("/t:c[][1]", "/t", ("c", slice(None), 1)),
        ("/t:c[4:8]", "/t", ("c", slice(4, 8))),
    ],
)
def test_sources(source, topic, tokens):
    found, path = topic_and_field(source)
    assert (found, parse_path(path).tokens) == (topic, tokens)


def test_json_messages_of_changing_shapes(path):
    texts = ['{"a": 1, "b": [2.5, null]}', '{"b": [10, -1], "z": {"a": 7}, "a": true}']
    texts += ['{"a": null, "a": 3, "b": []}', f'{{"b": [{10**400}, 4]}}', '{"a": 5, "b": ["7"]}']
    write_json(path, timed([text.encode() for text in texts]))
    values, _, reader = read(path, {"a": "/t:a", "b": "/t:b"})
    np.testing.assert_array_equal(values["a"], [1.0, 1.0, 3.0, np.nan, 5.0])
    np.testing.assert_array_equal(values["b"], [2.5, np.nan, 10.0, -1.0, np.nan, 4.0])
    said = " ".join(reader.report.losses)
    assert "has no field 'a'" in said
    assert "holds text where a number is expected" in said
