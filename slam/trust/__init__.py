"""Consistency monitoring: NIS above its bounds, wheels contradicted by scans, motion without walls in view.

The room only observes; it changes no estimate. It may import the rooms of filter and odometry.
"""
