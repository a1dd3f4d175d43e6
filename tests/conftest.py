"""Settings of the whole test run."""

import os

# As the command line does: small matrices, and tests share the cores with whatever else runs.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
