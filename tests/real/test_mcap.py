"""Faults: MCAP files that ROS 2 recorded for its own tests open, with all their messages."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from tests.readers.mcap_files import read
from tirelog.errors import ReadError
from tirelog.readers.mcap.reader import McapLog

REAL = Path(__file__).parents[3] / "shared" / "real" / "rosbag2_mcap"
FILES = sorted(REAL.glob("*.mcap"))
pytestmark = pytest.mark.skipif(not FILES, reason="the recorded logs are not here")


def counted(path):
    with path.open("rb") as stream:
        return Counter(channel.topic for _, channel, _ in make_reader(stream).iter_messages())


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_message_is_met(path, monkeypatch):
    """The walk finds what the library finds, whatever the topics hold."""
    met = Counter()
    original = McapLog._messages

    def spy(self, tables, **more):
        list(original(self, tables, **more))
        for number, table in tables.items():
            met[self.records.channels[number].topic] += len(table)
        return iter(())

    monkeypatch.setattr(McapLog, "_messages", spy)
    with pytest.raises(ReadError, match="'/nowhere' is not in the log"):
        read(path, {"x": "/nowhere:data"})
    assert met == counted(path)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_topic_by_its_stamps(path):
    """Asked for a field that it does not have, or text: a sentence, never an exception."""
    for topic in counted(path):
        with pytest.raises(ReadError) as caught:
            read(path, {"x": f"{topic}:no_such_field"})
        assert topic in str(caught.value)
        assert ";" in str(caught.value)


NUMBERS = [
    (
        "cdr_test_0",
        {
            "x": "/test_topic:float64_value",
            "i": "/test_topic:int32_value",
            "b": "/test_topic:bool_value",
        },
        "/test_topic",
        1,
    ),
    ("cdr_test_0", {"x": "/array_topic:float64_values"}, "/array_topic", 3),
    ("rewriter_a_0", {"x": "b_basictypes:float32_value"}, "b_basictypes", 1),
    ("test_bag_for_seek_0", {"x": "topic1:int32_value"}, "topic1", 1),
    ("talker", {"x": "/rosout:level", "line": "/rosout:line"}, "/rosout", 1),
]


@pytest.mark.parametrize(("name", "sources", "topic", "samples"), NUMBERS)
def test_numbers_and_their_count(name, sources, topic, samples):
    path = REAL / f"{name}.mcap"
    values, stamps, reader = read(path, sources)
    assert set(values) == set(sources)
    assert {v.size for v in values.values()} == {samples * counted(path)[topic]}
    assert all(np.isfinite(v).all() for v in values.values())
    assert reader.report.losses == []
    assert next(iter(stamps.values()))[0] == 0.0


def test_an_unknown_encoding_is_named():
    with pytest.raises(
        ReadError, match=r"message encoding 'wrong_format'.*allowed are json, protobuf.*cdr"
    ):
        read(REAL / "wrong_rmw_test_0.mcap", {"x": "/test_topic:float64_value"})


def test_text_is_no_number():
    with pytest.raises(ReadError, match="holds text where a number is expected"):
        read(REAL / "multiple_files_0.mcap", {"x": "/chatter:data"})
