"""Answers of the emulated devices to GET_LIDAR_CONF."""

import struct

from drivers.rplidar import Conf, pack_conf
from sim.emulator.models import DEFAULT_PWM, DEFAULT_RPM, HIGHEST_RPM, LOWEST_RPM, Model

_ROTATION, _LOWEST_ROTATION, _HIGHEST_ROTATION = 0x01, 0x04, 0x05
"""Types of the values about the rotation, which the driver does not ask for."""


def conf_answer(model: Model, payload: bytes) -> bytes:
    """Return the content of the answer: the type of the value and the value, or the type alone where it is unknown.

    Parameters
    ----------
    model : the emulated model.
    payload : payload of the request: the type of the value, and the id of a mode where the value belongs to a mode.
    """
    kind = int.from_bytes(payload[:4], "little")
    numbers = {
        _ROTATION: (DEFAULT_RPM, DEFAULT_PWM),
        _LOWEST_ROTATION: (LOWEST_RPM,),
        _HIGHEST_ROTATION: (HIGHEST_RPM,),
    }
    if kind in numbers:
        return payload[:4] + struct.pack(f"<{len(numbers[kind])}H", *numbers[kind])
    values: dict[int, float | str] = {Conf.MODE_COUNT: len(model.modes), Conf.TYPICAL_MODE: model.typical}
    mode_id = int.from_bytes(payload[4:6], "little")
    if len(payload) == 6 and mode_id < len(model.modes):
        mode = model.modes[mode_id]
        values |= {
            Conf.US_PER_SAMPLE: mode.us_per_sample,
            Conf.MAX_DISTANCE_M: mode.max_distance,
            Conf.ANSWER_TYPE: mode.answer,
            Conf.MODE_NAME: mode.name,
        }
    return pack_conf(Conf(kind), values[kind]) if kind in values else payload[:4]
