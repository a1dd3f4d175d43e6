"""Exact ray casting: which wall each beam of a scan hits first, and at which range.

The room promises ranges without a grid or a step, to the accuracy of float64, for scans and for single beams. It knows
walls as arrays of end points only, and may import no other room of the simulator.
"""
