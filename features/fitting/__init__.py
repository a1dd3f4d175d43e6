"""From the points of a segment to a line, and from two lines to a corner, each with its covariance."""
