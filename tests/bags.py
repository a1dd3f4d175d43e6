"""Writes ROS bags of every kind with the library's own writers."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from drivers.ros_bag.file import typestore

KINDS = ("rosbag1", "sqlite3", "mcap")
ROS1, ROS2 = typestore(ros1=True), typestore(ros1=False)
START = 1_700_000_000
SCAN, ODOM, TF = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
COVARIANCE = np.zeros(36)


class Messages:
    """Messages of ROS 1 or ROS 2, collected as (topic, type, time of recording, message)."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.store = ROS1 if kind == "rosbag1" else ROS2
        self.sent: list[tuple[str, str, float, Any]] = []

    def make(self, name: str, **fields: Any) -> Any:
        return self.store.types[name](**fields)

    def header(self, time: float, frame: str) -> Any:
        whole = math.floor(time)
        stamp = self.make("builtin_interfaces/msg/Time", sec=whole, nanosec=round((time - whole) * 1e9))
        return self.make(
            "std_msgs/msg/Header", stamp=stamp, frame_id=frame, **({"seq": 0} if self.kind == "rosbag1" else {})
        )

    def scan(
        self, time: float, ranges: Any, topic: str = "/scan", received: float | None = None, **fields: Any
    ) -> None:
        values = {
            "angle_min": -1.0,
            "angle_max": 1.0,
            "angle_increment": 0.25,
            "time_increment": 0.0,
            "scan_time": 0.1,
            "range_min": 0.1,
            "range_max": 8.0,
            "intensities": np.zeros(0, np.float32),
        } | fields
        header = self.header(time, values.pop("frame_id", "laser"))
        message = self.make(SCAN, header=header, ranges=np.array(ranges, np.float32), **values)
        self.sent.append((topic, SCAN, time if received is None else received, message))

    def odometry(
        self, time: float, x: float, y: float, yaw: float, topic: str = "/odom", child: str = "base_link"
    ) -> None:
        vector = self.make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
        pose = self.make(
            "geometry_msgs/msg/Pose",
            position=self.make("geometry_msgs/msg/Point", x=x, y=y, z=0.3),
            orientation=self.quaternion(0.0, yaw),
        )
        message = self.make(
            ODOM,
            header=self.header(time, "odom"),
            child_frame_id=child,
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=COVARIANCE),
            twist=self.make(
                "geometry_msgs/msg/TwistWithCovariance",
                twist=self.make("geometry_msgs/msg/Twist", linear=vector, angular=vector),
                covariance=COVARIANCE,
            ),
        )
        self.sent.append((topic, ODOM, time, message))

    def transform(
        self,
        time: float,
        parent: str,
        child: str,
        xyz: tuple[float, float, float],
        yaw: float,
        roll: float = 0.0,
        topic: str = "/tf",
    ) -> None:
        x, y, z = xyz
        stamped = self.make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(time, parent),
            child_frame_id=child,
            transform=self.make(
                "geometry_msgs/msg/Transform",
                translation=self.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
                rotation=self.quaternion(roll, yaw),
            ),
        )
        self.sent.append((topic, TF, time, self.make(TF, transforms=[stamped])))

    def text(self, time: float, topic: str = "/chatter") -> None:
        kind = "std_msgs/msg/String"
        self.sent.append((topic, kind, time, self.make(kind, data="hello")))

    def quaternion(self, roll: float, yaw: float) -> Any:
        """Yaw after roll; of length 1."""
        c, s = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
        cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
        return self.make("geometry_msgs/msg/Quaternion", x=c * sr, y=s * sr, z=s * cr, w=c * cr)

    def write(self, folder: Path, chunk: int | None = None, **options: Any) -> Path:
        """Write a bag into a folder, in the order of recording, and return its path."""
        sent = sorted(self.sent, key=lambda item: item[2])
        if self.kind == "rosbag1":
            path = folder / "drive.bag"
            writer: Any = Writer1(path)
            if chunk is not None:
                writer.chunk_threshold = chunk
        else:
            path = folder / "drive"
            writer = Writer2(path, version=9, storage_plugin=StoragePlugin[self.kind.upper()])
        with writer:
            connections: dict[str, Any] = {}
            for topic, kind, received, message in sent:
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=self.store)
                serialize = self.store.serialize_ros1 if self.kind == "rosbag1" else self.store.serialize_cdr
                writer.write(connections[topic], round(received * 1e9), serialize(message, kind))
        return path
