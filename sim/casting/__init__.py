"""Exact ray casting: the walls that the beams of a scan meet, by sorting beams into sectors."""
