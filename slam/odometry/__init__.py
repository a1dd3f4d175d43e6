"""Odometry: the motion of the robot by wheels, by scans registered to recent walls, or by both.

The room promises a pose and, for any two moments that were asked for, the motion between them with its covariance.
It imports :mod:`features` and :mod:`drivers`, and nothing else of :mod:`slam` but its errors.
"""
