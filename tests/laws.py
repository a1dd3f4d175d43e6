"""How the laws of this folder are sampled: the same examples in every run and no deadline, for compiling takes time."""

from hypothesis import settings

law = settings(derandomize=True, deadline=None, max_examples=60)
