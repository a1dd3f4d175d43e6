"""The landmark map: what a run knows of the building at its end.

The room promises values that need no filter and no graph to be used. It may import the rooms of graph and filter.
"""
