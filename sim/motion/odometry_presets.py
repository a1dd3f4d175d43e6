"""Presets of wheel odometry, by name."""

from collections.abc import Mapping
from types import MappingProxyType

from sim.motion.alpha_odometry import AlphaOdometry
from sim.motion.odometry import Odometry, WheelOdometry

POOR_ODOMETRY = WheelOdometry(
    sigma_turn_per_radian=0.01,
    sigma_turn_per_metre=0.004,
    sigma_distance_per_metre=0.01,
    sigma_distance_per_radian=0.005,
    scale_left=1.02,
    scale_right=1.0228,
    wheel_base=0.3,
    base_factor=0.985,
)
"""Odometry of a cheap robot: wheels 2 % too large and of slightly different sizes, and a badly measured wheel base."""

ODOMETRIES: Mapping[str, Odometry] = MappingProxyType(
    {
        "exact": WheelOdometry(),
        # A well calibrated robot: about half of the random errors of the poor one, and a tenth of its systematic ones.
        "good": WheelOdometry(
            sigma_turn_per_radian=0.005,
            sigma_turn_per_metre=0.002,
            sigma_distance_per_metre=0.005,
            sigma_distance_per_radian=0.002,
            scale_left=1.002,
            scale_right=1.0022,
            base_factor=0.998,
        ),
        "poor": POOR_ODOMETRY,
        # Random errors as of the poor one at 50 records per second, and a slip of 5 cm every 10 m.
        "slipping": AlphaOdometry(
            alpha1=5e-3, alpha2=1.6e-3, alpha3=1e-2, alpha4=1.25e-3, slip_rate=0.1, slip_length=0.05
        ),
    }
)
"""Odometry by the name that the command line takes."""
