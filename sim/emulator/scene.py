"""The scene of an emulated scanner: the world around it, and the motion of its robot."""

from dataclasses import dataclass, replace

import numpy as np

from features.se2 import Array
from features.sensor import sensor_preset
from sim.motion.true_trajectory import TrueTrajectory
from sim.sensing.lidar import Lidar
from sim.worlds.world import World


def single_beams(preset: str) -> Lidar:
    """Make a scanner with the noise and the limits of a sensor preset, for a :class:`Scene`, which sets its beams."""
    model = sensor_preset(preset)
    return Lidar(
        angles=np.zeros(0),
        sigma_range=model.sigma_range,
        sigma_bearing=model.sigma_bearing,
        range_min=model.range_min,
        range_max=model.range_max,
        rate=10.0,  # not used
    )


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A world, the noise of a scanner, and the motion of its robot.

    Parameters
    ----------
    world : the walls.
    lidar : noise and mounting; its angles and its rate are not used.
    trajectory : motion of the robot; before and after it the robot stands still.
    """

    world: World
    lidar: Lidar
    trajectory: TrueTrajectory

    def __post_init__(self) -> None:
        # Compile or load the kernels before the clock of the device starts.
        self.ranges(np.zeros(2), np.array([0.0, 0.1]), np.inf, np.random.default_rng(0))

    def ranges(self, angles_clockwise: Array, times: Array, max_distance: float, rng: np.random.Generator) -> Array:
        """Measure along single beams, each from the pose of the robot at its time.

        Parameters
        ----------
        angles_clockwise : directions in the sensor frame, clockwise seen from above, shape (n,) [rad].
        times : time of each beam since the departure of the robot, shape (n,) [s].
        max_distance : largest range; farther walls give no return [m].
        rng : source of the noise.

        Returns
        -------
        Ranges, shape (n,) [m]; 0 where nothing returns.
        """
        lidar = replace(self.lidar, angles=-angles_clockwise, range_max=min(max_distance, self.lidar.range_max))
        ranges = lidar.scan(self.world, self.trajectory.at(times), 0.0, rng).ranges
        return np.where(np.isfinite(ranges), ranges, 0.0)
