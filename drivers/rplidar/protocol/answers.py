"""Answers of the device other than samples, with their descriptors: packed and parsed."""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Self

from drivers.errors import DriverError

DESCRIPTOR_SYNC = b"\xa5\x5a"
DESCRIPTOR_SIZE = 7


class Answer(IntEnum):
    """Type of an answer: the last byte of its descriptor."""

    INFO = 0x04
    HEALTH = 0x06
    SAMPLE_RATE = 0x15
    LIDAR_CONF = 0x20
    SET_LIDAR_CONF = 0x21
    STANDARD = 0x81
    EXPRESS = 0x82
    HQ = 0x83
    ULTRA = 0x84
    DENSE = 0x85
    ULTRA_DENSE = 0x86
    ACC_BOARD_FLAG = 0xFF


@dataclass(frozen=True, slots=True)
class Descriptor:
    """Header of an answer.

    Parameters
    ----------
    size : size of one packet, 30 bits [bytes].
    multiple : whether packets without further descriptors follow until the scan is stopped.
    kind : type of the answer.
    """

    size: int
    multiple: bool
    kind: int

    def pack(self) -> bytes:
        """Bytes on the wire."""
        return DESCRIPTOR_SYNC + struct.pack("<IB", self.size | self.multiple << 30, self.kind)

    @classmethod
    def unpack(cls, data: bytes) -> Self | None:
        """Parse 7 bytes; None where they are no descriptor."""
        if len(data) != DESCRIPTOR_SIZE or data[:2] != DESCRIPTOR_SYNC:
            return None
        word, kind = struct.unpack("<IB", data[2:])
        mode = word >> 30
        return cls(word & 0x3FFFFFFF, mode == 1, kind) if mode < 2 else None


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """Answer to GET_INFO.

    Parameters
    ----------
    model : byte of the model; high nibble the family, low nibble the version.
    firmware : major and minor number.
    hardware : revision.
    serial : serial number, 16 bytes in the order of the wire, in hexadecimal.
    """

    model: int
    firmware: tuple[int, int]
    hardware: int
    serial: str

    def pack(self) -> bytes:
        """Payload of the answer."""
        major, minor = self.firmware
        return bytes([self.model, minor, major, self.hardware]) + bytes.fromhex(self.serial)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Parse the payload; :class:`DriverError` where it has not 20 bytes."""
        model, minor, major, hardware, serial = _unpack("<BBBB16s", payload, "GET_INFO")
        return cls(model, (major, minor), hardware, serial.hex().upper())


class Status(IntEnum):
    """Health status that the device reports."""

    GOOD = 0
    WARNING = 1
    ERROR = 2


@dataclass(frozen=True, slots=True)
class Health:
    """Answer to GET_HEALTH: the status, 0 good, 1 warning, 2 protection stop, and the code of the error."""

    status: int
    error_code: int = 0

    def pack(self) -> bytes:
        """Payload of the answer."""
        return struct.pack("<BH", self.status, self.error_code)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Parse the payload; :class:`DriverError` where it has not 3 bytes."""
        return cls(*_unpack("<BH", payload, "GET_HEALTH"))


@dataclass(frozen=True, slots=True)
class SampleRate:
    """Answer to GET_SAMPLERATE: time per sample of the standard and of the express scan [us]."""

    standard_us: int
    express_us: int

    def pack(self) -> bytes:
        """Payload of the answer."""
        return struct.pack("<HH", self.standard_us, self.express_us)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Parse the payload; :class:`DriverError` where it has not 4 bytes."""
        return cls(*_unpack("<HH", payload, "GET_SAMPLERATE"))


class Conf(IntEnum):
    """Values of the configuration; those of a scan mode are requested with its id."""

    MODE_COUNT = 0x70
    US_PER_SAMPLE = 0x71
    MAX_DISTANCE_M = 0x74
    ANSWER_TYPE = 0x75
    TYPICAL_MODE = 0x7C
    MODE_NAME = 0x7F


_NUMBERS = {
    Conf.MODE_COUNT: ("<H", 1),
    Conf.US_PER_SAMPLE: ("<I", 256),
    Conf.MAX_DISTANCE_M: ("<I", 256),
    Conf.ANSWER_TYPE: ("<B", 1),
    Conf.TYPICAL_MODE: ("<H", 1),
}
"""Format, and the factor of the fixed-point number."""


def pack_conf(kind: Conf, value: float | str) -> bytes:
    """Payload of an answer to GET_LIDAR_CONF: the requested type, then its value."""
    echo = struct.pack("<I", kind)
    if isinstance(value, str):
        return echo + value.encode("ascii") + b"\0"
    layout, scale = _NUMBERS[kind]
    return echo + struct.pack(layout, round(value * scale))


def unpack_number(kind: Conf, payload: bytes) -> float:
    """Value of an answer to GET_LIDAR_CONF; :class:`DriverError` where it is of another type, or too short."""
    layout, scale = _NUMBERS[kind]
    value = _conf_value(kind, payload)
    (number,) = _unpack(layout, value[: struct.calcsize(layout)], f"GET_LIDAR_CONF {kind.name}")
    return number / scale


def unpack_name(payload: bytes) -> str:
    """Name of a scan mode; :class:`DriverError` where the answer is of another type."""
    return _conf_value(Conf.MODE_NAME, payload).partition(b"\0")[0].decode("ascii", errors="replace")


def _conf_value(kind: Conf, payload: bytes) -> bytes:
    if payload[:4] != struct.pack("<I", kind):
        raise DriverError(f"GET_LIDAR_CONF {kind.name} was answered with {payload[:4].hex()}: expected its own type")
    return payload[4:]


def _unpack(layout: str, payload: bytes, name: str) -> tuple[Any, ...]:
    expected = struct.calcsize(layout)
    if len(payload) != expected:
        raise DriverError(f"{name} was answered with {len(payload)} bytes: expected {expected}")
    return struct.unpack(layout, payload)
