"""Reads messages of bags without an index, such as those of a killed recording or an incomplete copy."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from struct import unpack
from typing import BinaryIO

from rosbags.rosbag1.reader import Header, RecordType, decompressors, normalize, read_bytes, read_uint32
from rosbags.rosbag2.storage_mcap import decompress, read_sized, read_string
from rosbags.typesys.msg import normalize_msgtype

from drivers.ros_bag.kind import MAGIC, BagKind, bag_kind, storage_files

MCAP_SCHEMA, MCAP_CHANNEL, MCAP_MESSAGE, MCAP_CHUNK = 3, 4, 5, 6


@dataclass(frozen=True, slots=True)
class Message:
    """A serialised message of a bag.

    Parameters
    ----------
    topic : on which it was sent.
    type : of the message, as ``sensor_msgs/msg/LaserScan``.
    received : when it was recorded [s].
    data : its serialised fields.
    """

    topic: str
    type: str
    received: float
    data: bytes


def salvage(path: Path) -> Iterator[Message]:
    """Yield the messages of a bag, in the order of the file, up to where it is cut short or damaged."""
    for file in storage_files(path) if path.is_dir() else [path]:
        kind = bag_kind(file)
        try:
            if kind is not None:
                yield from SALVAGERS[kind](file)
        except Exception:  # parsing of damaged data raises exceptions of many types
            return


def _rosbag1(path: Path) -> Iterator[Message]:
    connections: dict[int, tuple[str, str]] = {}
    with path.open("rb") as file:
        file.readline()
        while True:
            header = Header.read(file)
            if header.get_uint8("op") != RecordType.CHUNK:
                file.seek(read_uint32(file), 1)
                continue
            # The last chunk may be incomplete; uncompressed, its messages up to the cut can be read.
            data = file.read(read_uint32(file))
            yield from _rosbag1_chunk(BytesIO(decompressors[header.get_string("compression")](data)), connections)


def _rosbag1_chunk(chunk: BinaryIO, connections: dict[int, tuple[str, str]]) -> Iterator[Message]:
    size = chunk.seek(0, 2)
    chunk.seek(0)
    while chunk.tell() < size:
        header = Header.read(chunk)
        data = read_bytes(chunk, read_uint32(chunk))
        connection = header.get_uint32("conn")
        if header.get_uint8("op") == RecordType.CONNECTION:
            fields = Header.read(BytesIO(len(data).to_bytes(4, "little") + data))
            connections[connection] = (
                normalize(header.get_string("topic")),
                normalize_msgtype(fields.get_string("type")),
            )
        else:
            yield Message(*connections[connection], 1e-9 * header.get_time("time"), data)


def _mcap(path: Path) -> Iterator[Message]:
    with path.open("rb") as file:
        file.seek(len(MAGIC["mcap"]))
        yield from _mcap_records(file, {}, {})


def _mcap_records(
    records: BinaryIO, schemas: dict[int, str], channels: dict[int, tuple[str, str]]
) -> Iterator[Message]:
    while kind := records.read(1):
        if kind[0] == MCAP_CHUNK:
            yield from _mcap_records(BytesIO(_mcap_chunk(records)), schemas, channels)
            continue
        record = BytesIO(read_sized(records))
        if kind[0] == MCAP_SCHEMA:
            (number,) = unpack("<H", record.read(2))
            schemas[number] = read_string(record)
        elif kind[0] == MCAP_CHANNEL:
            number, schema = unpack("<HH", record.read(4))
            channels[number] = read_string(record), schemas.get(schema, "")
        elif kind[0] == MCAP_MESSAGE:
            number, _, received, _ = unpack("<HIQQ", record.read(22))
            yield Message(*channels[number], 1e-9 * received, record.read())


def _mcap_chunk(records: BinaryIO) -> bytes:
    """Content of a chunk; an uncompressed one may be incomplete."""
    records.read(8 + 16)
    size, crc = unpack("<QI", records.read(12))
    compression = read_string(records)
    (stored,) = unpack("<Q", records.read(8))
    data = records.read(stored)
    return data if not compression else decompress(data, compression, size, crc)


def _sqlite3(path: Path) -> Iterator[Message]:
    with closing(_database(path)) as database:
        database.execute("PRAGMA writable_schema=ON")  # else a file with fewer pages than it should have is refused
        topics = {number: (name, kind) for number, name, kind in database.execute("SELECT id, name, type FROM topics")}
        for topic, received, data in database.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id"):
            yield Message(*topics[topic], 1e-9 * received, data)


def _database(path: Path) -> sqlite3.Connection:
    """Open a database without a last page that is cut short, which would be read with zeros after the cut."""
    page, _, size = database_size(path)
    if size % page == 0:
        return sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)
    database = sqlite3.connect(":memory:")
    with path.open("rb") as file:
        database.deserialize(file.read(size - size % page))
    return database


def database_size(path: Path) -> tuple[int, int, int]:
    """Size of a page of a database [bytes], of all its pages as its first one says, and of its file."""
    with path.open("rb") as file:
        page, pages = unpack(">16xH10xI", file.read(32))
    page = 65_536 if page == 1 else page
    return page, page * pages, path.stat().st_size


SALVAGERS: dict[BagKind, Callable[[Path], Iterator[Message]]] = {
    "rosbag1": _rosbag1,
    "mcap": _mcap,
    "sqlite3": _sqlite3,
}
