"""Draw the pictures of worlds.md: python docs/draw_worlds.py FOLDER; part of `make docs`.

The commands that worlds.md names record a drive through each world and map it. The turtlebot3 house is drawn if the
folder CWLF_DATA (default ../shared/data) holds it.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from sim import find_site

ROOT = Path(__file__).parents[1]
PICTURES = ROOT / "docs" / "worlds"
DATA = Path(os.environ.get("CWLF_DATA", ROOT / ".." / "shared" / "data"))
WIDTH, COLORS = 860, 96
"""Width [pixels] and colours of a picture of a map, so that it is small."""


def main() -> None:
    """Draw all pictures; recordings and runs go into the folder."""
    folder = Path(sys.argv[1])
    PICTURES.mkdir(exist_ok=True)
    for name in ("cluttered-room-6", "apartment", "office-loop"):
        command("world", "show", name, "--out", PICTURES / f"{name}.png")
    subprocess.run([sys.executable, ROOT / "examples" / "draw_floor_plans.py", folder], check=True)
    path = folder / "apartment.csv"
    np.savetxt(path, np.array(find_site("apartment").waypoints), delimiter=",")
    drive_and_map(folder, folder / "apartment-map.yaml", path)
    drive_and_map(folder, folder / "apartment-plan.dxf", path)
    house = DATA / "turtlebot3-house.sdf"
    if house.is_file():
        drive_and_map(folder, house, ROOT / "examples" / "turtlebot3-house.csv")
    else:
        print(f"{house} is absent: its picture stays as it is")


def drive_and_map(folder: Path, world: Path, path: Path) -> None:
    """Simulate, run and evaluate; keep a small copy of the map."""
    recording, run = folder / f"{world.stem}.jsonl.gz", folder / world.stem
    command("simulate", "--world", world, "--path", path, "--out", recording, "--overwrite")
    command("run", recording, "--out", run, "--overwrite")
    command("evaluate", run, "--truth", recording)
    with Image.open(run / "map.png") as drawn:
        small = drawn.convert("RGB").resize(
            (WIDTH, round(WIDTH * drawn.height / drawn.width)), Image.Resampling.LANCZOS
        )
        small.quantize(COLORS, Image.Quantize.MAXCOVERAGE).save(PICTURES / f"{world.stem}.png", optimize=True)


def command(*arguments: object) -> None:
    """Run a command of cwlf-slam."""
    subprocess.run([sys.executable, "-m", "slam.cli.main", *map(str, arguments)], check=True)


main()
