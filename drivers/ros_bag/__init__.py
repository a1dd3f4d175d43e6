"""ROS 1 and ROS 2 bags as sources of frames, without ROS.

The room promises that a bag that is cut short is read up to the cut. It may import the modules of ``drivers`` itself
and ``features``, and is alone in importing the library ``rosbags``; ``kind`` does without it.
"""

from drivers.ros_bag.bag import RosBag

__all__ = ["RosBag"]
