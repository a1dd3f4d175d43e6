"""Map a CARMEN log: python examples/map_a_log.py LOG RUN_FOLDER."""

import sys

from drivers import CarmenLog
from slam import Slam, SlamConfig, save_run

log, folder = sys.argv[1:]

source = CarmenLog(log)
slam = Slam(SlamConfig.of_preset(source.sensor, source.mounting))
for frame in source:
    slam.process(frame)
result = slam.finish()
save_run(folder, result)
print(f"{result.metrics.scans} scans, {len(result.landmarks)} landmarks, last pose {result.trajectory.poses[-1]}")
