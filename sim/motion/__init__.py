"""Motion: how robots and people move through a world, and which odometry the wheels report.

The room promises true poses within the limits of a robot, and odometry with stated errors. It may import the rooms of
worlds and casting.
"""
