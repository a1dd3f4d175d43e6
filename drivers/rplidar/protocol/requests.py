"""Requests of the host: packed as bytes, and found in a stream of bytes."""

import struct
from dataclasses import dataclass
from enum import IntEnum

from drivers.rplidar.protocol.answers import Conf

SYNC = 0xA5


class Command(IntEnum):
    """Second byte of a request; bit 7 is set where a payload follows."""

    SCAN = 0x20
    FORCE_SCAN = 0x21
    STOP = 0x25
    RESET = 0x40
    GET_INFO = 0x50
    GET_HEALTH = 0x52
    GET_SAMPLERATE = 0x59
    EXPRESS_SCAN = 0x82
    GET_LIDAR_CONF = 0x84
    SET_LIDAR_CONF = 0x85
    NEW_BAUDRATE_CONFIRM = 0x90
    MOTOR_SPEED = 0xA8
    SET_MOTOR_PWM = 0xF0
    GET_ACC_BOARD_FLAG = 0xFF

    @property
    def has_payload(self) -> bool:
        """Whether size, payload and checksum follow."""
        return bool(self & 0x80)


@dataclass(frozen=True, slots=True)
class Request:
    """A request as the device receives it."""

    command: Command
    payload: bytes = b""

    def pack(self) -> bytes:
        """Bytes on the wire.

        Raises
        ------
        ValueError
            The payload is longer than 255 bytes, or the command takes none.
        """
        if not self.command.has_payload:
            if self.payload:
                raise ValueError(f"{self.command.name} takes no payload")
            return bytes([SYNC, self.command])
        if len(self.payload) > 255:
            raise ValueError(f"payload of {len(self.payload)} bytes: at most 255 fit")
        packet = bytes([SYNC, self.command, len(self.payload)]) + self.payload
        return packet + bytes([xor(packet)])


def xor(data: bytes) -> int:
    """Exclusive or of all bytes: the checksum of a request."""
    checksum = 0
    for byte in data:
        checksum ^= byte
    return checksum


def request(command: Command) -> bytes:
    """Request without parameters."""
    return Request(command, bytes(4) if command is Command.GET_ACC_BOARD_FLAG else b"").pack()


def express_scan(mode: int) -> bytes:
    """Request to scan in the mode of this id; 0 on a device without a list of modes."""
    return Request(Command.EXPRESS_SCAN, struct.pack("<BHH", mode, 0, 0)).pack()


def motor_speed(rpm: int) -> bytes:
    """Request to turn at this speed [1/min]; 0 stops the motor."""
    return Request(Command.MOTOR_SPEED, struct.pack("<H", rpm)).pack()


def motor_pwm(pwm: int) -> bytes:
    """Request to drive the motor through the accessory board with a duty cycle of 0 to 1023."""
    return Request(Command.SET_MOTOR_PWM, struct.pack("<H", pwm)).pack()


def lidar_conf(kind: Conf, mode: int | None = None) -> bytes:
    """Request for a value of the configuration; one that each scan mode has is requested with the id of the mode."""
    mode_id = b"" if mode is None else struct.pack("<H", mode)
    return Request(Command.GET_LIDAR_CONF, struct.pack("<I", kind) + mode_id).pack()


class RequestReader:
    """Finds requests in the bytes that a device receives; other bytes are skipped."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[Request]:
        """Add bytes, and return the requests that are complete with them."""
        self._buffer += data
        found: list[Request] = []
        while (start := self._buffer.find(SYNC)) >= 0:
            del self._buffer[:start]
            if len(self._buffer) < 2:
                return found
            read = self._read()
            if read is None:
                return found
            parsed, size = read
            if parsed is not None:
                found.append(parsed)
            del self._buffer[:size]
        self._buffer.clear()
        return found

    def _read(self) -> tuple[Request | None, int] | None:
        """Request at the start of the buffer and its size; None while it is incomplete."""
        try:
            command = Command(self._buffer[1])
        except ValueError:
            return None, 1
        if not command.has_payload:
            return Request(command), 2
        if len(self._buffer) < 3 or len(self._buffer) < (size := self._buffer[2] + 4):
            return None
        packet = bytes(self._buffer[:size])
        return (Request(command, packet[3:-1]), size) if xor(packet) == 0 else (None, 1)
