"""Sensing: the scans that a lidar takes in a world, with their errors, and which walls and corners they show.

The room promises each scan with the truth about its beams. It may import the rooms of motion, worlds and casting.
"""
