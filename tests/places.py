"""Folders that tests read from."""

import os
from pathlib import Path

ROOT = Path(__file__).parents[1]
"""The checkout."""

DATA = Path(os.environ.get("CWLF_DATA", ROOT / ".." / "shared" / "data"))
"""Real logs; tests that need one skip where it is not there."""
