"""What the emulated devices answer to GET_LIDAR_CONF."""

import struct

from drivers.rplidar import Conf, pack_conf
from sim.emulator.models import DEFAULT_PWM, DEFAULT_RPM, HIGHEST_RPM, LOWEST_RPM, Model

_DESIRED_ROTATION, _LOWEST_ROTATION, _HIGHEST_ROTATION, _COMMERCIAL_NAME = 0x01, 0x04, 0x05, 0x81


def conf_answer(model: Model, payload: bytes) -> bytes:
    """Content of the answer; the type asked for and nothing behind it where the device does not know the value.

    Parameters
    ----------
    model : that is asked.
    payload : of the request: the type, and the id of a mode where the value is one of a mode.
    """
    kind = int.from_bytes(payload[:4], "little")
    mode_id = int.from_bytes(payload[4:6], "little")
    mode = model.modes[mode_id] if len(payload) == 6 and mode_id < len(model.modes) else None
    echo = payload[:4]
    match kind:
        case Conf.MODE_COUNT:
            return pack_conf(Conf.MODE_COUNT, len(model.modes))
        case Conf.TYPICAL_MODE:
            return pack_conf(Conf.TYPICAL_MODE, model.typical)
        case Conf.US_PER_SAMPLE if mode:
            return pack_conf(Conf.US_PER_SAMPLE, mode.us_per_sample)
        case Conf.MAX_DISTANCE_M if mode:
            return pack_conf(Conf.MAX_DISTANCE_M, mode.max_distance)
        case Conf.ANSWER_TYPE if mode:
            return pack_conf(Conf.ANSWER_TYPE, mode.answer)
        case Conf.MODE_NAME if mode:
            return pack_conf(Conf.MODE_NAME, mode.name)
        case _ if kind == _DESIRED_ROTATION:
            return echo + struct.pack("<HH", DEFAULT_RPM, DEFAULT_PWM)
        case _ if kind == _LOWEST_ROTATION:
            return echo + struct.pack("<H", LOWEST_RPM)
        case _ if kind == _HIGHEST_ROTATION:
            return echo + struct.pack("<H", HIGHEST_RPM)
        case _ if kind == _COMMERCIAL_NAME:
            return echo + model.name.encode("ascii") + b"\0"
        case _:
            return echo
