"""Which program this is: its sources, and the libraries that its numbers depend on."""

import functools
import hashlib
import platform
from importlib.metadata import version
from pathlib import Path

import drivers
import features
import sim
import slam

LIBRARIES = "filterpy", "gtsam", "llvmlite", "numba", "numpy", "scipy"


@functools.cache
def fingerprint() -> str:
    """Digest of sources and library versions; where it is equal, equal seeds give equal results."""
    digest = hashlib.sha256(platform.python_version().encode())
    for library in LIBRARIES:
        digest.update(f"{library} {version(library)}".encode())
    for package in (features, drivers, sim, slam):
        folder = Path(str(package.__file__)).parent
        for source in sorted(folder.rglob("*.py")):
            digest.update(source.relative_to(folder).as_posix().encode() + source.read_bytes())
    return digest.hexdigest()[:16]
