"""The emulated models of scanners: identity, baud rates, scan modes, motor and boot behaviour."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto
from types import MappingProxyType

from drivers.rplidar.protocol.answers import Answer, DeviceInfo, SampleRate


@dataclass(frozen=True, slots=True)
class Mode:
    """A scan mode of a model.

    Parameters
    ----------
    name : name that the device reports.
    answer : type of the packets of samples.
    us_per_sample : time from sample to sample [us].
    max_distance : largest range; farther walls give no return [m].
    """

    name: str
    answer: Answer
    us_per_sample: float
    max_distance: float


class Motor(Enum):
    """How the rotation is controlled."""

    DTR = auto()
    """By the DTR modem line; a pseudo-terminal has none, so that the motor turns while the device has power."""
    PWM = auto()
    """By SET_MOTOR_PWM through the accessory board; the motor stands still until the first command."""
    RPM = auto()
    """By the scan: the motor turns while a scan is requested, at the speed that MOTOR_SPEED sets."""


@dataclass(frozen=True, slots=True)
class Model:
    """A model of the RPLIDAR.

    Parameters
    ----------
    name : name of the model.
    info : answer to GET_INFO.
    baud : baud rate of the line.
    sample_rate : answer to GET_SAMPLERATE.
    modes : scan modes; their indices are their ids, the first is the one of SCAN.
    typical : id of the mode that the device recommends.
    motor : how the rotation is controlled.
    banner : text that the device prints after booting.
    boot_time : time from a reset until the device answers [s].
    """

    name: str
    info: DeviceInfo
    baud: int
    sample_rate: SampleRate
    modes: tuple[Mode, ...]
    typical: int
    motor: Motor
    banner: bytes = b""
    boot_time: float = 0.5


BANNER = b"RP LIDAR System.\r\nFirmware Ver 1.29 - 2b7, HW Ver 7\r\nModel: 18\r\n"
"""Boot banner that the fault ``banner`` gives to a model without one."""

BAUDS = (115200, 256000, 460800, 1000000)
"""Baud rates of the RPLIDAR family."""

DEFAULT_RPM, LOWEST_RPM, HIGHEST_RPM = 600, 300, 900
"""Default and limits of the speed of the motor [turns/min]: 10 Hz, and 5 Hz to 15 Hz as in the data sheets of A2 and
A3."""

DEFAULT_PWM = 660
"""PWM value at which the motor turns at :data:`DEFAULT_RPM`: the default of the vendor's SDK."""


def _info(model: int, firmware: tuple[int, int], hardware: int) -> DeviceInfo:
    return DeviceInfo(model, firmware, hardware, f"{model:02X}C1E59AF0C5E29DD2B6E39DF5D3493116"[:32])


def _a_series(firmware: str, hardware: int, model: int) -> bytes:
    return f"RP LIDAR System.\r\nFirmware Ver {firmware} - rel, HW Ver {hardware}\r\nModel: {model:02X}\r\n".encode()


MODELS: Mapping[str, Model] = MappingProxyType(
    {
        # As an A1M8 reports it.
        "A1": Model(
            name="A1",
            info=_info(0x18, (1, 29), 7),
            baud=115200,
            sample_rate=SampleRate(508, 254),
            modes=(
                Mode("Standard", Answer.STANDARD, 508.0, 12.0),
                Mode("Express", Answer.EXPRESS, 254.0, 12.0),
                Mode("Boost", Answer.ULTRA, 127.0, 12.0),
                Mode("Sensitivity", Answer.ULTRA, 127.0, 12.0),
                Mode("Stability", Answer.ULTRA, 201.0, 12.0),
            ),
            typical=3,
            motor=Motor.DTR,
            banner=_a_series("1.29", 7, 0x18),
        ),
        # As an A2M8 reports it in an issue of the ROS driver: 2,000, 4,000 and 8,000 samples per second.
        "A2": Model(
            name="A2",
            info=_info(0x28, (1, 24), 5),
            baud=115200,
            sample_rate=SampleRate(508, 254),
            modes=(
                Mode("Standard", Answer.STANDARD, 508.0, 12.0),
                Mode("Express", Answer.EXPRESS, 254.0, 12.0),
                Mode("Boost", Answer.ULTRA, 127.0, 12.0),
            ),
            typical=2,
            motor=Motor.PWM,
            banner=_a_series("1.24", 5, 0x28),
        ),
        # As an A3M1 reports it in an issue of the ROS driver: 4,000, 7,900, 15,900, 15,900 and 10,000 samples a second.
        "A3": Model(
            name="A3",
            info=_info(0x31, (1, 26), 6),
            baud=256000,
            sample_rate=SampleRate(252, 126),
            modes=(
                Mode("Standard", Answer.STANDARD, 252.0, 25.0),
                Mode("Express", Answer.EXPRESS, 126.0, 25.0),
                Mode("Boost", Answer.ULTRA, 63.0, 25.0),
                Mode("Sensitivity", Answer.ULTRA, 63.0, 25.0),
                Mode("Stability", Answer.ULTRA, 100.0, 25.0),
            ),
            typical=3,
            motor=Motor.PWM,
            banner=_a_series("1.26", 6, 0x31),
        ),
        # As an S1 reports it.
        "S1": Model(
            name="S1",
            info=_info(0x61, (1, 28), 18),
            baud=256000,
            sample_rate=SampleRate(244, 108),
            modes=(
                Mode("Standard", Answer.STANDARD, 244.0, 40.0),
                Mode("DenseBoost", Answer.DENSE, 108.0, 40.0),
            ),
            typical=1,
            motor=Motor.RPM,
            boot_time=2.0,
        ),
        # Its data sheet states 32,000 samples per second and 30 m; the standard mode is assumed.
        "S2": Model(
            name="S2",
            info=_info(0x71, (1, 1), 18),
            baud=1000000,
            sample_rate=SampleRate(62, 31),
            modes=(
                Mode("Standard", Answer.STANDARD, 62.5, 16.0),
                Mode("DenseBoost", Answer.ULTRA_DENSE, 31.25, 30.0),
            ),
            typical=1,
            motor=Motor.RPM,
            boot_time=2.0,
        ),
    }
)
"""Emulated models by the name that the command line takes."""
