import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

TWIN = Path(__file__).parents[1] / "tests" / "extraction_twin.py"


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.fixture(scope="session")
def extraction_twin() -> ModuleType:
    """The extraction in plain numpy that the tests hold the compiled one against."""
    if not TWIN.is_file():
        pytest.skip(f"{TWIN.name} is absent")
    spec = importlib.util.spec_from_file_location(TWIN.stem, TWIN)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
