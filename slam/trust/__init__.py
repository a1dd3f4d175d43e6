"""What speaks against a run: innovations larger than promised, odometry that scans contradict, scans without walls.

The room only observes; it changes no estimate. It may import the rooms of filter and odometry.
"""
