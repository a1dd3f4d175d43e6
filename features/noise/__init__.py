"""Noise: what the scans of a run tell about the noise of their scanner.

The room promises estimates of the standard deviation of a range, of the step of the ranges and of the value that stands
for no return, from scans alone, and a gauge that keeps them while a run goes on. It imports the values of ``features``
(scans, lines, sensor); the extraction is handed in.
"""
