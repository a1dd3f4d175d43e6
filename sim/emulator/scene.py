"""What an emulated scanner sees from the robot that carries it."""

from dataclasses import dataclass, replace

import numpy as np

from features.se2 import Array
from features.sensor import sensor_preset
from sim.motion.robot import Trajectory
from sim.sensing.lidar import Lidar
from sim.worlds.world import World


def single_beams(preset: str) -> Lidar:
    """Scanner with the noise and the limits of a sensor preset, whose beams are told one by one."""
    model = sensor_preset(preset)
    return Lidar(
        angles=np.zeros(0),
        sigma_range=model.sigma_range,
        sigma_bearing=model.sigma_bearing,
        range_min=model.range_min,
        range_max=model.range_max,
        rate=10.0,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A world, the noise of a scanner, and the way of its robot.

    Parameters
    ----------
    world : the walls.
    lidar : noise and mounting; its angles and its rate are not used.
    trajectory : the robot's motion; it stands before and after.
    """

    world: World
    lidar: Lidar
    trajectory: Trajectory

    def __post_init__(self) -> None:
        # What is compiled is there before the device's clock starts.
        self.ranges(np.zeros(2), np.array([0.0, 0.1]), np.inf, np.random.default_rng(0))

    def ranges(self, angles_clockwise: Array, times: Array, max_distance: float, rng: np.random.Generator) -> Array:
        """Measure along single beams, each from where the robot is then.

        Parameters
        ----------
        angles_clockwise : directions in the sensor frame, clockwise seen from above, shape (n,) [rad].
        times : when each beam is taken, from the robot's departure on, shape (n,) [s].
        max_distance : what is farther does not return [m].
        rng : source of the noise.

        Returns
        -------
        Ranges, shape (n,) [m]; 0 where nothing returns.
        """
        lidar = replace(self.lidar, angles=-angles_clockwise, range_max=min(max_distance, self.lidar.range_max))
        ranges = lidar.scan(self.world, self.trajectory.at(times), 0.0, rng).ranges
        return np.where(np.isfinite(ranges), ranges, 0.0)
