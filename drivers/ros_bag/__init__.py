"""ROS 1 and ROS 2 bags as sources of frames, without ROS; bags that are cut short are read as far as they go."""

from drivers.ros_bag.bag import RosBag

__all__ = ["RosBag"]
