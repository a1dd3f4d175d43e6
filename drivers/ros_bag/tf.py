"""Transforms of a ROS bag: the mounting of the scanner, and the frames of the odometry."""

import math
from typing import Any

import numpy as np

from drivers.errors import LogFormatError
from drivers.ros_bag.frames import rotation_of
from features.se2 import Array, wrap_angle
from features.sensor import Mounting

BASE_FRAMES = ("base_footprint", "base_link")
"""Names of the robot's own frame, the one on the floor first."""

ODOMETRY_FRAMES = ("odom", "odom_combined")
"""Names of the odometry frame."""

TILT = math.radians(10.0)
"""Largest inclination of a scanner whose scans are taken for horizontal [rad]."""


class TransformTree:
    """Tree of frames, each with its pose in its parent by the first transform of the frame."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Array]] = {}

    def add(self, stamped: Any) -> None:
        """Add a geometry_msgs/TransformStamped, unless its child frame is known.

        Raises
        ------
        LogFormatError
            Its quaternion is unusable.
        """
        child = frame_name(stamped.child_frame_id)
        if child not in self._parents:
            pose = np.eye(4)
            pose[:3, :3] = rotation_of(stamped.transform.rotation)
            translation = stamped.transform.translation
            pose[:3, 3] = translation.x, translation.y, translation.z
            self._parents[child] = frame_name(stamped.header.frame_id), pose

    def bases(self, sensor_frame: str) -> list[str]:
        """Ancestors of a sensor frame that are robot frames by name, in the order of :data:`BASE_FRAMES`."""
        return [frame for name in BASE_FRAMES for frame in self._ancestors(sensor_frame) if _last(frame) == name]

    def odometry(self, sensor_frame: str) -> tuple[str, str] | None:
        """Odometry frame and its child; of several pairs the one whose child is an ancestor of a sensor frame.

        None where there is no pair, or the choice is ambiguous.
        """
        pairs = [(parent, child) for child, (parent, _) in self._parents.items() if _last(parent) in ODOMETRY_FRAMES]
        above = self._ancestors(sensor_frame)
        carrying = [pair for pair in pairs if pair[1] in above]
        return next((found[0] for found in (carrying, pairs) if len(found) == 1), None)

    def mounting(self, robot_frame: str, sensor_frame: str) -> Mounting | None:
        """Pose of a sensor on the robot; None where their frames are not connected.

        Raises
        ------
        LogFormatError
            The sensor is inclined.
        """
        to_robot, to_sensor = self._ancestors(robot_frame), self._ancestors(sensor_frame)
        common = next((frame for frame in to_robot if frame in to_sensor), None)
        if common is None:
            return None
        pose = np.linalg.inv(to_robot[common]) @ to_sensor[common]
        tilt = math.acos(min(1.0, abs(pose[2, 2])))
        if tilt > TILT:
            raise LogFormatError(
                f"the scanner {sensor_frame!r} is inclined by {math.degrees(tilt):.0f} deg to {robot_frame!r} in tf: "
                f"expected one that looks along the floor, to within {math.degrees(TILT):.0f} deg"
            )
        theta = wrap_angle(math.atan2(pose[1, 0], pose[0, 0]))
        return Mounting(float(pose[0, 3]), float(pose[1, 3]), theta, upside_down=bool(pose[2, 2] < 0.0))

    def _ancestors(self, frame: str) -> dict[str, Array]:
        """Pose of a frame, shape (4, 4), in itself and in each frame above it, upwards."""
        poses = {frame: np.eye(4)}
        while frame in self._parents:
            parent, pose = self._parents[frame]
            if parent in poses:  # a circle
                break
            poses[parent] = pose @ poses[frame]
            frame = parent
        return poses


def frame_name(name: str) -> str:
    """Name of a frame as ROS 2 has it: without the slash before it."""
    return name.lstrip("/")


def _last(frame: str) -> str:
    return frame.rsplit("/", 1)[-1]
