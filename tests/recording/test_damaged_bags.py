"""Bags that are cut off, broken or hostile end with an error that names them."""

import bz2
import re
import sqlite3
import struct
import sys

import lz4.frame
import numpy as np
import pytest
from tests.bags import joint_states, typestore, write_bag

from pivident.errors import FileFormatError
from pivident.recording import decompression, files
from pivident.recording.message_definitions import parse_definition
from pivident.recording.read_bag import open_bag

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
