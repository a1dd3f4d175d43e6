"""What a run yields: trajectories, the record of every frame, and the figures of the run.

The room holds values and how they are put together and written; it estimates nothing. It may import all rooms below it:
loop, map, trust, graph, filter and odometry.
"""
