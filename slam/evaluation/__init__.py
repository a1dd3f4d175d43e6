"""Evaluation of trajectories and maps against the truth: ATE, RPE, relations, NEES.

The room knows trajectories and arrays, and nothing of how they were estimated.
"""
