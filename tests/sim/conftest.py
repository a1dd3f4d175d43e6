import runpy
import sys
from pathlib import Path

import pytest
from places import DATA, ROOT


@pytest.fixture(scope="session")
def house() -> Path:
    path = DATA / "turtlebot3-house.sdf"
    if not path.is_file():
        pytest.skip(f"{path} is absent: set CWLF_DATA to the folder of the test data")
    return path


@pytest.fixture(scope="session")
def plans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the map and the drawing of the apartment, as the example writes them."""
    folder = tmp_path_factory.mktemp("plans")
    arguments, sys.argv = sys.argv, ["draw_floor_plans.py", str(folder)]
    try:
        runpy.run_path(str(ROOT / "examples" / "draw_floor_plans.py"), run_name="__main__")
    finally:
        sys.argv = arguments
    return folder
