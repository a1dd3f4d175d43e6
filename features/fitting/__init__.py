"""Fitting: from the points of a segment to a line, and from two lines to a corner, each with its covariance.

The room promises fits and an intersection by the equations of the paper, as functions of one line or one pair of lines
and as compiled kernels. It imports the values of ``features`` (lines, sensor, configuration), not segmentation.
"""
