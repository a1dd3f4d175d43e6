"""ROS 1 bags, ROS 2 bags and MCAP files as a source of frames in the order of their stamps."""

import itertools
import logging
import os
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from drivers.errors import LogFormatError
from drivers.frame import Frame, FrameSource, SourceInfo
from drivers.reorder import REORDER_WINDOW, ReorderWindow
from drivers.ros_bag.file import ODOMETRY, SCAN, TRANSFORMS, BagFile
from drivers.ros_bag.frames import laser_scan, planar_pose, stamp_of, with_odometry
from drivers.ros_bag.kind import SUFFIXES
from drivers.ros_bag.salvage import Message
from drivers.ros_bag.tf import TransformTree, frame_name
from features.errors import ScanFormatError
from features.sensor import Mounting

logger = logging.getLogger(__name__)

TRANSFORM_MESSAGES = 5_000
"""Largest number of messages of moving transforms that are searched for the mounting."""


class RosBag(FrameSource):
    """A ROS bag: scans of sensor_msgs/LaserScan, odometry of nav_msgs/Odometry or tf, mounting of tf.

    Without a topic of odometry the transform from the frame ``odom`` to its child is the odometry; without this, there
    is none. The robot's frame is that whose pose the odometry describes, else the scanner's ``base_footprint`` or
    ``base_link``. Each frame with a scan has the odometry at the scan's stamp, interpolated; scans before the first and
    after the last odometry are left out, with a warning in the log of this package. The mounting is that of the first
    transforms; a scanner that moves on the robot is not supported.

    Parameters
    ----------
    path : a ``.bag``, ``.mcap`` or ``.db3`` file, or the folder of a ROS 2 bag.
    scan_topic : topic of the scans; None for the only one.
    odom_topic : topic of the odometry; None for the only one.

    Raises
    ------
    LogFormatError
        When made: it cannot be opened, a topic is missing or ambiguous, or the scanner is inclined.
        When iterated: a message is unusable, a stamp goes back by more than :data:`REORDER_WINDOW`, the bag is cut
        short or damaged, or no scan has odometry; the frames before are yielded first.
    """

    def __init__(
        self, path: str | os.PathLike[str], scan_topic: str | None = None, odom_topic: str | None = None
    ) -> None:
        self._path = Path(path)
        self._bag = BagFile(self._path)
        chosen = self._choose(SCAN, scan_topic, "--scan-topic")
        if chosen is None:
            listed = self._listed(self._bag.topics)
            raise LogFormatError(f"{self._path} has no scans: expected a topic of {_shown(SCAN)}: {listed}")
        self._scan_topic = chosen
        self._odom_topic = self._choose(ODOMETRY, odom_topic, "--odom-topic")
        self._odom_frames: tuple[str, str] | None = None
        self._mounting = self._look_up_mounting()
        self._read = self._scans = 0

    @property
    def info(self) -> SourceInfo:
        """Name of the bag, and the mounting of tf, else the identity; a bag does not say which scanner it was."""
        path = self._path.resolve()
        name = path.stem if path.suffix.lower() in SUFFIXES else path.name
        return SourceInfo(name, "rplidar-s1", self._mounting, self._has_odometry)

    @property
    def progress(self) -> float:
        """Share of the messages that has been read, 0 to 1."""
        return min(self._read / sum(self._bag.topics[topic].count for topic in self._topics), 1.0)

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames in the order of their stamps; each call starts at the first."""
        failures: list[LogFormatError] = []
        frames = self._sorted(failures)
        yielded = 0
        for frame in with_odometry(frames) if self.has_odometry else frames:
            yielded += frame.scan is not None
            yield frame
        if failures:
            raise failures[0]
        if not self._scans:
            raise LogFormatError(f"{self._path} has no scan on {self._scan_topic}: expected one at least")
        if not yielded:
            raise LogFormatError(
                f"{self._path}: no scan of {self._scan_topic} lies between two odometry poses of "
                f"{self._odom_topic or 'tf'}: expected stamps of one clock"
            )
        if yielded < self._scans:
            logger.warning(
                "%s: %d of %d scans are left out: they have no odometry of %s before and after them",
                self._path, self._scans - yielded, self._scans, self._odom_topic or "tf",
            )  # fmt: skip

    @property
    def _has_odometry(self) -> bool:
        """Whether there is odometry, of a topic or of tf."""
        return self._odom_topic is not None or self._odom_frames is not None

    @property
    def _topics(self) -> list[str]:
        """Topics that frames come from."""
        odometry = [self._odom_topic] if self._odom_topic else self._of_type(TRANSFORMS) if self._odom_frames else []
        return [self._scan_topic, *odometry]

    def _sorted(self, failures: list[LogFormatError]) -> Iterator[Frame]:
        """Yield scans and odometry as separate frames, in the order of their stamps, up to a failure."""
        window = ReorderWindow()
        self._read = self._scans = 0
        try:
            for message in self._bag.messages(self._topics):
                self._read += 1
                for frame in self._frames(message):
                    if frame.stamp < window.yielded:
                        raise LogFormatError(
                            f"{self._path}, {message.topic}: stamp {frame.stamp:.3f} goes back by "
                            f"{window.newest - frame.stamp:.3f} s: expected stamps in order to within "
                            f"{REORDER_WINDOW:g} s"
                        )
                    self._scans += frame.scan is not None
                    yield from window.push(frame, self._read)
        except LogFormatError as error:
            failures.append(error)
        yield from window.flush()

    def _frames(self, message: Message) -> list[Frame]:
        """Frames of a message: a scan without odometry, or odometry without a scan."""
        fields = self._bag.decode(message)
        try:
            if message.topic == self._scan_topic:
                stamp = stamp_of(fields.header, message.received)
                return [Frame(stamp, np.zeros(3), laser_scan(fields, stamp))]
            if message.topic == self._odom_topic:
                body = fields.pose.pose
                pose_odom_robot = planar_pose(body.position, body.orientation)
                return [Frame(stamp_of(fields.header, message.received), pose_odom_robot)]
            return [
                Frame(
                    stamp_of(stamped.header, message.received),
                    planar_pose(stamped.transform.translation, stamped.transform.rotation),
                )
                for stamped in fields.transforms
                if _frames_of(stamped) == self._odom_frames
            ]
        except (LogFormatError, ScanFormatError) as error:
            raise LogFormatError(f"{self._path}, {message.topic} at {message.received:.3f} s: {error}") from None

    def _choose(self, kind: str, wanted: str | None, option: str) -> str | None:
        """Return the wanted topic, or the only one of a type; None where there is none."""
        if wanted is not None and wanted not in self._bag.topics:
            raise LogFormatError(f"{self._path} has no topic {wanted}: {self._listed(self._bag.topics)}")
        if wanted is not None and self._bag.topics[wanted].type != kind:
            raise LogFormatError(f"{self._path}: expected a topic of {_shown(kind)}: {self._listed([wanted])}")
        found = self._of_type(kind) if wanted is None else [wanted]
        if len(found) > 1:
            raise LogFormatError(f"{self._path}: choose one with {option}: {self._listed(found)}")
        return next(iter(found), None)

    def _of_type(self, kind: str) -> list[str]:
        return [name for name, topic in self._bag.topics.items() if topic.type == kind and topic.count]

    def _listed(self, names: Iterable[str]) -> str:
        topics = ((name, self._bag.topics[name]) for name in sorted(names))
        return "it has " + ", ".join(f"{name} ({_shown(topic.type)}, {topic.count})" for name, topic in topics)

    def _look_up_mounting(self) -> Mounting:
        """Find the mounting in tf, and the odometry where it has no topic."""
        sensor = next((frame_name(scan.header.frame_id) for scan in self._first([self._scan_topic], 1)), "")
        static, moving = ([t for t in self._of_type(TRANSFORMS) if ("static" in t) is still] for still in (True, False))
        tree = TransformTree()
        try:
            for message in itertools.chain(self._first(static, None), self._first(moving, TRANSFORM_MESSAGES)):
                for stamped in message.transforms:
                    tree.add(stamped)
            if self._odom_topic is not None:
                robots = [frame_name(odometry.child_frame_id) for odometry in self._first([self._odom_topic], 1)]
            else:
                self._odom_frames = tree.odometry(sensor)
                robots = [] if self._odom_frames is None else [self._odom_frames[1]]
            for robot in [*robots, *tree.bases(sensor)]:
                if (mounting := tree.mounting(robot, sensor)) is not None:
                    return mounting
        except LogFormatError as error:
            raise LogFormatError(f"{self._path}, tf: {error}") from None
        if self._has_odometry:
            logger.warning(
                "%s: the mounting of the scanner %r is not in tf: "
                "its origin is assumed, unless [sensor.mounting] says otherwise",
                self._path,
                sensor,
            )
        return Mounting()

    def _first(self, topics: Collection[str], count: int | None) -> Iterator[Any]:
        """Yield the fields of the first messages of some topics; None for all."""
        for message in itertools.islice(self._undamaged(topics), count):
            yield self._bag.decode(message)

    def _undamaged(self, topics: Collection[str]) -> Iterator[Message]:
        with suppress(LogFormatError):  # raised again when the frames are read
            yield from self._bag.messages(topics)


def _frames_of(stamped: Any) -> tuple[str, str]:
    return frame_name(stamped.header.frame_id), frame_name(stamped.child_frame_id)


def _shown(kind: str) -> str:
    return kind.replace("/msg/", "/")
