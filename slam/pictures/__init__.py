"""Pictures: maps of runs, worlds, studies, and the live view.

The room alone imports matplotlib and rerun. It may import everything below the pipeline.
"""
