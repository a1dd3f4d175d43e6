"""The EKF front-end: the filter on the landmarks near the robot, and which landmark an observed corner is.

The room promises a pose and landmarks with their joint covariance after each update. It may import the room of
odometry.
"""
