"""The containers of bags: ROS 1 ``.bag``, MCAP, and the SQLite files of ROS 2.

Each is read once from its beginning to its end, chunk by chunk, without its index: an index can
point anywhere, and a recorder that was killed never wrote one. Nothing but one chunk is held.
"""

from __future__ import annotations

import contextlib
import sqlite3
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from urllib.parse import quote

from pivident.data.logs.bags.decompression import ZSTD_MAGIC, unpacked
from pivident.foundation.errors import FileFormatError

#: Largest record that is held in memory [bytes]; recorders write chunks of about a megabyte.
MAX_RECORD = 2**29

#: Largest message that may hold joints [bytes]; images and point clouds are larger.
MAX_MESSAGE = 2**16

#: Most topics of a bag.
MAX_TOPICS = 10_000

ROS1_MAGIC, MCAP_MAGIC = b"#ROSBAG V2.0\n", b"\x89MCAP0\r\n"


@dataclass(frozen=True)
class Topic:
    """Messages of one type under one name."""

    name: str  # name of the topic
    type: str  # type of its messages as the bag names it
    definition: str  # text of the definition, empty where the bag has none
    cdr: bool  # whether messages are encoded as ROS 2 does it, not as ROS 1
    readable: bool = True  # whether encoding and definition are of a kind that is known here


#: A message: its topic, when it was received [ns], and its bytes.
Message = tuple[Topic, int, bytes]


def ros1_messages(path: Path) -> Iterator[Message]:
    """Messages of a ROS 1 bag, version 2.0, in the order of the file."""
    topics: dict[int, Topic] = {}
    expanded = 0
    with path.open("rb") as stream:
        if stream.read(len(ROS1_MAGIC)) != ROS1_MAGIC:
            raise FileFormatError(f"{path.name} is no ROS 1 bag of version 2.0")
        while head := stream.read(4):
            header = _ros1_fields(path, _whole(path, stream, _size(path, head, "<I")))
            data = _whole(path, stream, _size(path, stream.read(4), "<I"))
            if header.get(b"op") == b"\x05":
                declared = _size(path, header.get(b"size", b""), "<I")
                kind = header.get(b"compression", b"").decode("latin-1")
                data = unpacked(path, kind, data, declared, expanded)
                expanded += len(data)
                yield from _ros1_records(path, data, topics)
            elif header.get(b"op") in (b"\x02", b"\x07"):
                yield from _ros1_record(path, header, data, topics)


def _ros1_records(path: Path, data: bytes, topics: dict[int, Topic]) -> Iterator[Message]:
    """Messages of a chunk."""
    at = 0
    while at < len(data):
        parts = []
        for _ in range(2):
            end = at + 4 + _size(path, data[at : at + 4], "<I")
            if end > len(data):
                raise _damaged(path, "a record reaches beyond its chunk")
            parts.append(data[at + 4 : end])
            at = end
        yield from _ros1_record(path, _ros1_fields(path, parts[0]), parts[1], topics)


def _ros1_record(
    path: Path, header: dict[bytes, bytes], data: bytes, topics: dict[int, Topic]
) -> Iterator[Message]:
    """A message, or nothing from a record that introduces a topic."""
    kind = header.get(b"op")
    if kind not in (b"\x02", b"\x07"):
        return
    number = _size(path, header.get(b"conn", b""), "<I")
    if kind == b"\x02":
        if number not in topics or len(header.get(b"time", b"")) != 8:
            raise _damaged(path, f"a message belongs to connection {number}, which is unknown")
        seconds, rest = struct.unpack("<II", header[b"time"])
        yield topics[number], seconds * 1_000_000_000 + rest, data
        return
    about = _ros1_fields(path, data)
    values = header.get(b"topic"), about.get(b"type"), about.get(b"message_definition")
    texts = [(value or b"").decode("utf-8", "replace") for value in values]
    topics[number] = Topic(texts[0], texts[1], texts[2], cdr=False)
    if len(topics) > MAX_TOPICS:
        raise _damaged(path, f"it has more than {MAX_TOPICS} connections")


def _ros1_fields(path: Path, data: bytes) -> dict[bytes, bytes]:
    """The fields ``name=value`` of a header."""
    fields, at = {}, 0
    while at < len(data):
        end = at + 4 + _size(path, data[at : at + 4], "<I")
        name, equals, value = data[at + 4 : end].partition(b"=")
        if end > len(data) or not equals:
            raise _damaged(path, "the header of a record is broken")
        fields[name] = value
        at = end
    return fields


def mcap_messages(path: Path) -> Iterator[Message]:
    """Messages of an MCAP file, in the order of the file."""
    state = _McapState(path, {}, {})
    with path.open("rb") as stream:
        if stream.read(len(MCAP_MAGIC)) != MCAP_MAGIC:
            raise FileFormatError(f"{path.name} is no MCAP file of version 0")
        while True:
            head = stream.read(9)
            if not head:
                raise _cut_off(path)
            kind, size = head[0], _size(path, head[1:], "<Q")
            if kind in (0x0F, 0x02):  # the end of the data
                return
            data = _whole(path, stream, size)
            if kind == 0x06:
                yield from state.chunk(data)
            else:
                yield from state.record(kind, data)


@dataclass
class _McapState:
    """Schemas and channels that were met, and how much was unpacked."""

    path: Path
    schemas: dict[int, tuple[str, str, str]]
    channels: dict[int, Topic]
    expanded: int = 0

    def chunk(self, data: bytes) -> Iterator[Message]:
        """Messages of a compressed chunk."""
        try:
            declared, check = struct.unpack_from("<QI", data, 16)
            (length,) = struct.unpack_from("<I", data, 28)
            kind = data[32 : 32 + length].decode("latin-1")
            (packed,) = struct.unpack_from("<Q", data, 32 + length)
        except struct.error:
            raise _damaged(self.path, "the header of a chunk is broken") from None
        content = data[40 + length : 40 + length + packed]
        content = unpacked(self.path, kind, content, declared, self.expanded)
        self.expanded += len(content)
        if check and zlib.crc32(content) != check:
            raise _damaged(self.path, "the checksum of a chunk is wrong")
        at = 0
        while at < len(content):
            if at + 9 > len(content):
                raise _damaged(self.path, "a record reaches beyond its chunk")
            kind_of, size = struct.unpack_from("<BQ", content, at)
            at += 9
            if at + size > len(content):
                raise _damaged(self.path, "a record reaches beyond its chunk")
            yield from self.record(kind_of, content[at : at + size])
            at += size

    def record(self, kind: int, data: bytes) -> Iterator[Message]:
        """A message, or nothing from a record of another kind."""
        try:
            if kind == 0x05:
                number, _, received = struct.unpack_from("<HIQ", data)
                if len(data) < 22 or number not in self.channels or received >= 2**63:
                    raise _damaged(
                        self.path, f"a message of channel {number} has no channel or time"
                    )
                yield self.channels[number], received, data[22:]
            elif kind == 0x03:
                (number,) = struct.unpack_from("<H", data)
                name, at = _mcap_text(data, 2)
                encoding, at = _mcap_text(data, at)
                self.schemas[number] = name, encoding, _mcap_text(data, at)[0]
            elif kind == 0x04:
                number, schema = struct.unpack_from("<HH", data)
                topic, at = _mcap_text(data, 4)
                encoding, _ = _mcap_text(data, at)
                name, language, text = self.schemas.get(schema, ("", "", ""))
                readable = encoding in ("cdr", "ros1") and language in (
                    "ros1msg",
                    "ros2msg",
                    "ros2idl",
                )
                own = text if language in ("ros1msg", "ros2msg") else ""
                self.channels[number] = Topic(topic, name, own, encoding == "cdr", readable)
                if len(self.channels) > MAX_TOPICS:
                    raise _damaged(self.path, f"it has more than {MAX_TOPICS} channels")
        except struct.error:
            raise _damaged(self.path, "a record is too short") from None


def _mcap_text(data: bytes, at: int) -> tuple[str, int]:
    """A text behind its length, and where it ends."""
    (length,) = struct.unpack_from("<I", data, at)
    end = at + 4 + length
    if end > len(data):
        raise struct.error
    return data[at + 4 : end].decode("utf-8", "replace"), end


def sqlite_messages(path: Path) -> Iterator[Message]:
    """Messages of a SQLite file of ROS 2, in the order of its table."""
    log = path.with_name(path.name + "-wal")
    if log.exists() and log.stat().st_size:
        raise FileFormatError(
            f"{path.name} was not closed by its recorder: part of it is still in {log.name}",
            advice=f"open it once with `sqlite3 {path.name} 'PRAGMA wal_checkpoint'`",
        )
    try:
        with contextlib.closing(_database(path)) as database:
            yield from _sqlite_rows(path, database, _sqlite_topics(path, database))
    except (sqlite3.Error, OverflowError, UnicodeDecodeError) as error:
        raise _damaged(path, str(error)) from error


def _database(path: Path) -> sqlite3.Connection:
    """The file opened for reading, with limits on what its schema may do."""
    address = f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1"
    database = sqlite3.connect(address, uri=True)
    database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, 2**26)
    database.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
    database.execute("PRAGMA trusted_schema = OFF")
    database.execute("PRAGMA cell_size_check = ON")
    return database


def _sqlite_topics(path: Path, database: sqlite3.Connection) -> dict[int, Topic]:
    """Topics by their number in the table of messages."""
    wanted = ("messages", "topics", "message_definitions")
    found = database.execute(
        "SELECT name, sql FROM sqlite_master WHERE type = 'table' AND name IN (?, ?, ?)", wanted
    ).fetchall()
    tables = {name for name, sql in found if str(sql).upper().startswith("CREATE TABLE")}
    if not {"messages", "topics"} <= tables:
        raise FileFormatError(f"{path.name} is a database without the tables of a ROS 2 bag")
    texts: dict[str, str] = {}
    if "message_definitions" in tables:
        rows = database.execute(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        ).fetchmany(MAX_TOPICS)
        texts = {str(name): str(text) for name, encoding, text in rows if encoding == "ros2msg"}
    rows = database.execute(
        "SELECT id, name, type, serialization_format FROM topics"
    ).fetchmany(MAX_TOPICS)  # fmt: skip
    return {
        number: Topic(str(name), str(kind), texts.get(str(kind), ""), True, encoding == "cdr")
        for number, name, kind, encoding in rows
    }


def _sqlite_rows(
    path: Path, database: sqlite3.Connection, topics: dict[int, Topic]
) -> Iterator[Message]:
    """The table of messages, as long as it is no larger than its file."""
    room, expanded = path.stat().st_size, 0
    for number, received, data in database.execute(
        "SELECT topic_id, timestamp, data FROM messages"
    ):
        if number not in topics or not isinstance(received, int) or not isinstance(data, bytes):
            raise _damaged(path, "a row of its messages has another form")
        room -= 4 + len(data)
        if room < 0:  # pages that point at one another in a circle
            raise _damaged(path, "its messages are larger than the file")
        if data.startswith(ZSTD_MAGIC) and topics[number].readable:
            data = unpacked(path, "zstd", data, None, expanded)
            expanded += len(data)
        yield topics[number], received, data


def _size(path: Path, data: bytes, form: str) -> int:
    """A length."""
    if len(data) != struct.calcsize(form):
        raise _cut_off(path)
    return int(struct.unpack(form, data)[0])


def _whole(path: Path, stream: BufferedReader, size: int) -> bytes:
    """So many bytes of the file."""
    if size > MAX_RECORD:
        rest = path.stat().st_size - stream.tell()
        if size > rest:
            raise _cut_off(path)
        raise _damaged(path, f"a record has {size} bytes")
    data = stream.read(size)
    if len(data) != size:
        raise _cut_off(path)
    return data


def _damaged(path: Path, reason: str) -> FileFormatError:
    """The error of a bag whose content contradicts itself."""
    return FileFormatError(
        f"{path.name} is a damaged bag ({reason})", advice="copy or record it again"
    )


def _cut_off(path: Path) -> FileFormatError:
    """The error of a bag that ends too early."""
    return FileFormatError(
        f"{path.name} is cut off: it ends inside a record",
        advice="copy it again, or repair it with `rosbag reindex` (.bag) or `mcap recover` (.mcap)",
    )
