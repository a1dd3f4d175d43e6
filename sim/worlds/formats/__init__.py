"""Readers of world files: our own JSON, Gazebo SDF, occupancy grids of ROS, and DXF drawings.

Each reader promises a ``Site``, or a ``WorldError`` that names the file. The room may import the other modules of
worlds, but not the built-in ones.
"""
