"""Settings of the whole test run."""

import os

from hypothesis import Phase, settings

# As the command line does: small matrices, and tests share the cores with whatever else runs.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# No test fails on a clock: what is compiled at its first call, or a busy machine, takes its time.
settings.register_profile("cwlf", deadline=None)
# Of a mutant it is enough to know that a test fails: the same examples each time, and none is made smaller.
settings.register_profile(
    "mutants", deadline=None, derandomize=True, database=None, phases=(Phase.explicit, Phase.generate)
)
settings.load_profile("cwlf")
