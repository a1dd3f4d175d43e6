"""A run from its source to its folder: sessions, checkpoints, the run folder, interruption.

The room promises that nothing that was computed is lost. It may import the pipeline and all below it.
"""
