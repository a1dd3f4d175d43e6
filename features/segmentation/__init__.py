"""Segmentation: from the beams of a scan to segments, each the points of one wall.

The room promises the returns of a scan in counter-clockwise order, clusters that end at jumps, their splits by IEPF,
and breaks moved to where two walls meet, as compiled kernels. It imports fitting and the values of ``features``.
"""
