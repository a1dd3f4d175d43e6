"""Topics and messages of a ROS bag of any kind, intact or not."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag2 import Reader as Reader2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from drivers.errors import LogFormatError
from drivers.ros_bag.kind import bag_kind, storage_files
from drivers.ros_bag.salvage import Message, database_size, salvage

SCAN, ODOMETRY, TRANSFORMS = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
TYPES = {SCAN: SCAN, ODOMETRY: ODOMETRY, TRANSFORMS: TRANSFORMS, "tf/msg/tfMessage": TRANSFORMS}
"""Types that are read, by the names that bags have for them; the last one is that of old bags."""


@dataclass(frozen=True, slots=True)
class Topic:
    """Type of the messages of a topic, one of :data:`TYPES` or any other, and their number."""

    type: str
    count: int


class BagFile:
    """A ROS 1 bag, a ROS 2 bag (a folder, or one of its files) or an MCAP file.

    A bag that is cut short is read up to the cut.

    Parameters
    ----------
    path : file or folder.

    Attributes
    ----------
    topics : by their names.

    Raises
    ------
    LogFormatError
        It cannot be opened, it is no bag, or no message in it can be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        _check(path)
        self._ros1 = bag_kind(path) == "rosbag1"
        self._types = typestore(ros1=self._ros1)
        self._damage = ""
        try:
            _check_databases(path)
            with self._reader() as reader:
                self.topics = {name: self._topic(info.connections) for name, info in reader.topics.items()}
        except PermissionError as error:
            raise LogFormatError(f"{path} cannot be read ({error.strerror}): expected a ROS bag") from None
        except Exception as error:  # on damaged data the library raises whatever its parsing runs into
            self._damage = str(error).split(": (")[0].rstrip(".") or type(error).__name__
            self.topics: dict[str, Topic] = {}
            for message in salvage(path):
                before = self.topics.get(message.topic)
                kind = TYPES.get(message.type, message.type)
                self.topics[message.topic] = Topic(kind, (before.count if before else 0) + 1)
            if not self.topics:
                raise LogFormatError(f"{path} has no message that can be read ({self._damage})") from None

    def messages(self, topics: Collection[str]) -> Iterator[Message]:
        """Yield the messages of some topics in the order in which they were recorded.

        Raises
        ------
        LogFormatError
            The bag is cut short or damaged; the messages before are yielded first.
        """
        if self._damage:
            yield from (message for message in salvage(self._path) if message.topic in topics)
            raise LogFormatError(f"{self._path} is cut short or damaged ({self._damage}): expected an intact bag")
        try:
            with self._reader() as reader:
                wanted = [connection for connection in reader.connections if connection.topic in topics]
                for connection, received, data in reader.messages(wanted) if wanted else ():
                    yield Message(connection.topic, connection.msgtype, 1e-9 * received, bytes(data))
        except Exception as error:
            raise LogFormatError(f"{self._path} is damaged ({error}): expected an intact bag") from None

    def decode(self, message: Message) -> Any:
        """Fields of a message of one of :data:`TYPES`.

        Raises
        ------
        LogFormatError
            The data are not those of a message of its type.
        """
        decode = self._types.deserialize_ros1 if self._ros1 else self._types.deserialize_cdr
        try:
            return decode(message.data, TYPES[message.type])
        except Exception as error:
            raise LogFormatError(
                f"{self._path}, {message.topic} at {message.received:.3f} s: a message that cannot be decoded ({error})"
            ) from None

    def _reader(self) -> Reader1 | Reader2:
        return Reader1(self._path) if self._ros1 else Reader2(self._path)

    def _topic(self, connections: Collection[Connection]) -> Topic:
        kinds = {self._kind(connection) for connection in connections}
        return Topic(kinds.pop() if len(kinds) == 1 else "several types", sum(c.msgcount for c in connections))

    def _kind(self, connection: Connection) -> str:
        """Type of the messages, marked where its definition differs from the known one of this name."""
        kind = TYPES.get(connection.msgtype)
        if kind is None:
            return connection.msgtype
        digest = self._types.generate_msgdef(kind)[1] if self._ros1 else self._types.hash_rihs01(kind)
        return kind if connection.digest in ("", digest) else f"{kind} of another version"


def typestore(*, ros1: bool) -> Typestore:
    """Definitions of the messages of ROS 1, or of ROS 2."""
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST)
    if TRANSFORMS not in store.types:
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS))
    return store


def _check_databases(path: Path) -> None:
    """Find databases that are cut short, whose missing pages would be read as zeros.

    Raises
    ------
    ValueError
        A file is shorter than its header says.
    """
    for file in storage_files(path) if path.is_dir() else [path]:
        if bag_kind(file) == "sqlite3":
            _, expected, size = database_size(file)
            if size < expected:
                raise ValueError(f"{file.name} has {size} of {expected} bytes")


def _check(path: Path) -> None:
    """Refuse a path that is no bag.

    Raises
    ------
    LogFormatError
        It does not exist, is empty, or does not begin as a bag.
    """
    if not path.exists():
        raise LogFormatError(f"{path}: no such file or folder: expected a ROS bag")
    if path.is_dir():
        if not (path / "metadata.yaml").is_file() and not storage_files(path):
            raise LogFormatError(
                f"{path} is a folder without metadata.yaml, .db3 or .mcap files: expected a ROS 2 bag, an MRCLAM data "
                "set, or a file"
            )
    elif path.stat().st_size == 0:
        raise LogFormatError(f"{path} is empty: expected a ROS bag")
    elif bag_kind(path) is None:
        raise LogFormatError(f"{path} does not begin as a ROS bag: expected a ROS 1 or ROS 2 bag, or an MCAP file")
