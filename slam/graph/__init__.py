"""The factor-graph back-end: key frames, landmarks and loop closures, solved step by step and as a whole.

The room promises poses and landmarks with marginal covariances. It alone imports gtsam, and what other rooms exchange
with it (:mod:`slam.graph.values`) does not. It may import the rooms of filter and odometry.
"""
