"""Bags that are cut off, broken or hostile end with an error that names them."""

import bz2
import io
import re
import sqlite3
import struct
import sys

import lz4.frame
import numpy as np
import pytest

from pivident.data.logs import source_files as files
from pivident.data.logs.bags import bag_containers, decompression, joint_topics
from pivident.data.logs.bags.message_definitions import parse_definition
from pivident.data.logs.bags.read_bag import open_bag
from pivident.foundation.errors import FileFormatError
from tests.bags import joint_states, typestore, write_bag

T = np.arange(100) / 500.0
WAVE = np.column_stack([np.sin(T), np.cos(T)])


def bag(folder, kind):
    store = typestore(kind)
    states = joint_states(store, kind.endswith("bag"), ["a", "b"], T, WAVE, WAVE)
    path = write_bag(folder, kind, store, [states])
    return path if path.is_file() else next(f for f in path.iterdir() if f.suffix != ".yaml")


@pytest.mark.parametrize("kind", [".bag", "lz4.bag", "bz2.bag", "mcap", "mcap+storage"])
def test_a_bag_cut_off_anywhere_is_refused_or_whole(tmp_path, kind):
    path = bag(tmp_path, kind)
    data = path.read_bytes()
    for share in (0.001, 0.2, 0.5, 0.7):
        path.write_bytes(data[: int(share * len(data))])
        with pytest.raises(FileFormatError, match=re.escape(path.name)):
            open_bag(path)


def test_a_database_cut_off_or_not_closed_is_refused(tmp_path):
    path = bag(tmp_path, "sqlite3")
    data = path.read_bytes()
    for size in (50, 5000, len(data) - 4096):
        path.write_bytes(data[:size])
        with pytest.raises(FileFormatError, match=re.escape(path.name)):
            open_bag(path)
    path.write_bytes(data)
    path.with_name(path.name + "-wal").write_bytes(b"rest")
    with pytest.raises(FileFormatError, match="was not closed by its recorder"):
        open_bag(path)


def test_a_database_of_something_else_is_refused(tmp_path):
    path = tmp_path / "log.db3"
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE measurements (t, q)")
    with pytest.raises(FileFormatError, match="without the tables of a ROS 2 bag"):
        open_bag(path)


def test_views_in_place_of_tables_are_not_asked(tmp_path):
    path = tmp_path / "log.db3"
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE topics (id, name, type, serialization_format)")
        database.execute(
            "CREATE VIEW messages AS WITH RECURSIVE n(topic_id) AS (SELECT 1 UNION ALL SELECT "
            "topic_id + 1 FROM n) SELECT topic_id, 0 AS timestamp, x'00' AS data FROM n"
        )
    with pytest.raises(FileFormatError, match="without the tables of a ROS 2 bag"):
        open_bag(path)


def test_a_bag_may_have_no_index(tmp_path):
    path = bag(tmp_path, ".bag")
    data = bytearray(path.read_bytes())
    at = data.index(b"index_pos=") + len("index_pos=")
    data[at : at + 8] = bytes(8)
    path.write_bytes(data)
    assert len(open_bag(path).column("/joint_states/position/a")) == len(T)


@pytest.mark.parametrize(("kind", "pack"), [("bz2", bz2.compress), ("lz4", lz4.frame.compress)])
def test_chunks_that_hold_more_than_they_say_are_refused(tmp_path, kind, pack):
    path = tmp_path / "log.bag"
    path.write_bytes(b"x")
    packed = pack(bytes(10**6))
    assert decompression.unpacked(path, kind, packed, 10**6, 0) == bytes(10**6)
    for size in (10, 10**6 - 1, 10**6 + 1):
        with pytest.raises(FileFormatError, match="more or less than it says"):
            decompression.unpacked(path, kind, packed, size, 0)


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "HARMLESS_SIZE", 2**20)
    monkeypatch.setattr(decompression, "HARMLESS_SIZE", 2**20)
    path = tmp_path / "log.bag"
    chunk = bz2.compress(bytes(2**21))

    def record(fields, data):
        head = b"".join(struct.pack("<I", len(f)) + f for f in fields)
        return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data

    content = record([b"op=\x05", b"compression=bz2", b"size=" + struct.pack("<I", 2**21)], chunk)
    path.write_bytes(b"#ROSBAG V2.0\n" + content)
    with pytest.raises(FileFormatError, match="200 times"):
        open_bag(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a/B x\nMSG: a/B\na/B y\n", "contains itself"),
        ("a/B x\n", "not defined"),
        ("float64 x; import os\n", "no field"),
        ("float64[] __import__('os').system('x')\n", "no field"),
    ],
)
def test_definitions_are_tables_and_nothing_else(text, message):
    with pytest.raises(FileFormatError, match=message):
        parse_definition("p/T", text)


def test_no_code_is_made_of_a_definition(tmp_path):
    made = set()
    sys.addaudithook(lambda event, _: made.add(event) if event in ("exec", "compile") else None)
    path = bag(tmp_path, "mcap")
    open_bag(path)  # imports what is needed once
    path.write_bytes(path.read_bytes())
    made.clear()
    assert open_bag(path).topics
    assert not made


def mcap(path, definition, messages, channels=1):
    """A file of one type whose messages are these bytes, on so many topics each."""

    def text(words):
        return struct.pack("<I", len(words.encode())) + words.encode()

    def record(kind, data):
        return struct.pack("<BQ", kind, len(data)) + data

    parts = [record(3, struct.pack("<H", 1) + text("p/T") + text("ros1msg") + text(definition))]
    for k in range(channels):
        about = struct.pack("<HH", k, 1) + text(f"/t{k}") + text("ros1") + struct.pack("<I", 0)
        parts.append(record(4, about))
        parts += [
            record(5, struct.pack("<HIQQ", k, 0, n + 1, n + 1) + data)
            for n, data in enumerate(messages)
        ]
    path.write_bytes(b"\x89MCAP0\r\n" + b"".join(parts) + record(15, bytes(4)))
    return path


def named(number):
    """A message of another structure each time: a string of its own, and a number."""
    name = f"{number:06d}".encode()
    return struct.pack("<I", len(name)) + name + struct.pack("<d", number)


def test_a_bag_whose_every_message_is_built_differently_ends(tmp_path, monkeypatch):
    definition = "string s\n" + "p/E e\n" * 500 + "float64 x\nMSG: p/E\n"
    path = mcap(tmp_path / "log.mcap", definition, [named(k) for k in range(60)])
    assert len(open_bag(path).column("/t0/x")) == 60
    monkeypatch.setattr(joint_topics, "VISITS_OF_TOPIC", 20_000)
    path.touch()
    with pytest.raises(FileFormatError, match="built in too many ways"):
        open_bag(path)


def test_topics_share_the_work_that_a_bag_may_make(tmp_path, monkeypatch):
    monkeypatch.setattr(
        joint_topics.WorkBudget, "__init__", lambda self: setattr(self, "left", 2000)
    )
    path = mcap(tmp_path / "log.mcap", "string s\nfloat64 x\n", [named(k) for k in range(10)], 8)
    bag = open_bag(path)
    assert 0 < len(bag.topics) < 8
    assert set(bag.passed_over.values()) <= {
        "its messages are built in too many ways",
        "the messages before it are built in too many ways",
    }


def test_a_bag_has_no_more_channels_than_topics(tmp_path, monkeypatch):
    monkeypatch.setattr(bag_containers, "MAX_TOPICS", 5)
    path = mcap(tmp_path / "log.mcap", "string s\nfloat64 x\n", [named(1)], 6)
    with pytest.raises(FileFormatError, match="more than 5 channels"):
        open_bag(path)


def test_a_file_of_several_zstd_frames_is_read_to_its_end(tmp_path):
    zstd = decompression._zstd()
    path, content = tmp_path / "log.db3.zstd", np.arange(10**5).tobytes()
    frames = [zstd.compress(content[:300_000]), zstd.compress(content[300_000:])]
    path.write_bytes(b"".join(frames))
    whole = io.BytesIO()
    decompression.unpack_file(path, whole)
    assert whole.getvalue() == content
    path.write_bytes(frames[0] + frames[1][:-20])
    with pytest.raises(FileFormatError, match="no whole zstd file"):
        decompression.unpack_file(path, io.BytesIO())
    path.write_bytes(frames[0] + b"something else")
    with pytest.raises(FileFormatError, match="no whole zstd file"):
        decompression.unpack_file(path, io.BytesIO())
