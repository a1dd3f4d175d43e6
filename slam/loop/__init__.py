"""Loop closing: places that were seen before are proposed, verified by walls, and become closures.

The room promises that no closure contradicts dead reckoning. It may import the rooms of graph, filter and odometry.
"""
