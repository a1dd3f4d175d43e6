"""What the emulated devices answer to GET_LIDAR_CONF."""

import struct

from drivers.rplidar import Conf, pack_conf
from sim.emulator.models import DEFAULT_PWM, DEFAULT_RPM, HIGHEST_RPM, LOWEST_RPM, Model

_ROTATION, _LOWEST_ROTATION, _HIGHEST_ROTATION = 0x01, 0x04, 0x05


def conf_answer(model: Model, payload: bytes) -> bytes:
    """Content of the answer; the type asked for and nothing behind it where the device does not know the value.

    Parameters
    ----------
    model : that is asked.
    payload : of the request: the type, and the id of a mode where the value is one of a mode.
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
