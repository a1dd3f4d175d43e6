"""Properties of a scanner by its model byte: its name, how its motor is driven, its sensor preset."""

from enum import Enum, auto

_SERIES = ((12, "M"), (9, "T"), (6, "S"), (4, "C"))


class Motor(Enum):
    """How the speed of the motor is set, beside the line DTR, which switches it."""

    SWITCH = auto()
    """Not at all."""
    PWM = auto()
    """By the accessory board, where there is one."""
    RPM = auto()
    """By the scanner itself."""


def model_name(model: int) -> str:
    """Name as on the label, such as A1M8 or S1M1."""
    family, version = model >> 4, model & 0x0F
    first, letter = next(((base, letter) for base, letter in _SERIES if family >= base), (1, "A"))
    return f"{letter}{family - first + 1}M{version}"


def motor(model: int) -> Motor:
    """How the motor of a model is driven."""
    family = model >> 4
    if family >= 6:
        return Motor.RPM
    return Motor.PWM if family in {2, 3} else Motor.SWITCH


def has_conf(model: int, firmware: tuple[int, int]) -> bool:
    """Whether a scanner answers GET_LIDAR_CONF."""
    return model >> 4 >= 4 or firmware >= (1, 24)


def sensor_name(model: int) -> str | None:
    """Sensor preset of a model; None where there is none."""
    return {1: "rplidar-a1", 2: "rplidar-a2", 3: "rplidar-a3", 6: "rplidar-s1", 7: "rplidar-s2"}.get(model >> 4)
