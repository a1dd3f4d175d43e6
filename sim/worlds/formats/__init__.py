"""Worlds out of files: JSON, Gazebo SDF, DXF drawings, ROS grid maps."""
