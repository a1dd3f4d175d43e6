"""An emulated RPLIDAR: it takes requests and returns bytes, each with a time of its own clock."""

import math
import struct
from collections.abc import Iterable, Iterator

import numpy as np

from drivers.rplidar import (
    FORMATS,
    Answer,
    Command,
    Descriptor,
    Health,
    Request,
    RequestReader,
    Status,
)
from features.se2 import Array
from sim.emulator.conf import conf_answer
from sim.emulator.faults import Faults
from sim.emulator.ledger import Ledger
from sim.emulator.line import Line
from sim.emulator.models import BANNER, BAUDS, DEFAULT_PWM, DEFAULT_RPM, HIGHEST_RPM, LOWEST_RPM, Mode, Model, Motor
from sim.emulator.rotor import Rotor
from sim.emulator.scene import Scene
from sim.emulator.stream import ScanStream

REQUEST_TIME = 5.0
"""A request is dropped when its bytes take longer than this [s], as the protocol states."""

LATENCY = 1e-3
"""Time from a request to the first byte of its answer [s], assumed."""

_ERROR_CODE = 0x8001
"""Error code in protection stop, assumed: the protocol does not define the codes."""


class Device:
    """An emulated scanner as a state machine: idle, scanning, in protection stop, booting, or without power.

    All times are those of the clock of the device, which starts at zero. The output is a function of the arguments and
    of the requests with their times; no method waits. The robot that carries the scanner departs with the first sample.

    Parameters
    ----------
    model : model of the scanner.
    scene : the world around the scanner and its motion.
    seed : seed of all randomness.
    faults : names of the faults that are switched on.

    Attributes
    ----------
    ledger : counts of what was sent, and of what the faults destroyed.
    baud : baud rate of the line.
    departure : time at which the robot departed [s]; None before.
    away_until : time at which an unplugged cable is plugged in again [s]; None while it is plugged in.

    Raises
    ------
    ValueError
        No fault has this name.
    """

    def __init__(self, model: Model, scene: Scene, seed: int = 0, faults: Iterable[str] = ()) -> None:
        rotor_seed, self._scan_seed, fault_seed = np.random.SeedSequence(seed).generate_state(3)
        self.model, self._scene = model, scene
        self._faults = Faults(faults, int(fault_seed))
        self.baud = model.baud
        if "wrong-baud" in self._faults:
            # A faster line can carry the samples too; the fastest model gets the next slower rate.
            faster = [baud for baud in BAUDS if baud > model.baud] or [BAUDS[-2]]
            self.baud = int(self._faults.rng["wrong-baud"].choice(faster))
        self.ledger = Ledger()
        self._line = Line(self.baud, self._faults, self.ledger)
        self._rotor = Rotor(np.random.default_rng(rotor_seed))
        self._rpm = float(DEFAULT_RPM)
        self._scans = 0
        self._made_until = 0.0
        self._asked: tuple[Mode, bool] | None = None
        self._stream: ScanStream | None = None
        self._counted = True
        self.departure: float | None = None
        self.away_until: float | None = None
        self._power_up(0.0)
        self._stopped = "protection-stop" in self._faults
        if "stale-samples" in self._faults and not self._stopped:
            self._counted = False
            if model.motor is Motor.PWM:
                self._rotor.command(DEFAULT_RPM / 60.0, 0.0)
            self._scan(model.modes[model.typical], 0.0, force=False)

    @property
    def next_time(self) -> float:
        """Time at which the next bytes arrive at the host [s]; inf where none arrive without a request."""
        while self._stream is not None and not self._line:
            for packet in self._stream.block():
                self._line.send_packet(packet, self._mode.answer, counted=self._counted)
        return self._line.next_time

    def read(self, until: float, baud: int | None = None) -> bytes:
        """Return the bytes that arrive at the host up to a time [s].

        ``baud`` is the baud rate of the host, None for that of the device; at a wrong rate the bytes are random.
        """
        parts: list[bytes] = []
        while self.away_until is None and self.next_time <= until:
            parts.append(self._take()[1])
        data = b"".join(parts)
        if baud is not None and baud != self.baud:
            return self._faults.rng["wrong-baud"].bytes(len(data))
        return data

    def chunks(self, until: float) -> Iterator[tuple[float, bytes]]:
        """Yield the pieces of data that arrive at the host up to a time [s], each with its own time [s]."""
        while self.away_until is None and self.next_time <= until:
            yield self._take()

    def write(self, data: bytes, time: float, baud: int | None = None) -> None:
        """Take bytes from the host.

        Parameters
        ----------
        data : the bytes.
        time : when they arrive [s]; not before the time of the last read.
        baud : baud rate of the host, None for that of the device; at a wrong rate the bytes are ignored.
        """
        if self.away_until is not None or (baud is not None and baud != self.baud) or time < self._deaf_until:
            return
        if time > self._last_heard + REQUEST_TIME:
            self._requests = RequestReader()
        self._last_heard = time
        for request in self._requests.feed(data):
            self._handle(request, time)

    def plug_in(self) -> None:
        """Power up again after the cable was unplugged."""
        assert self.away_until is not None
        self._power_up(self.away_until)
        self.away_until = None

    def end(self, time: float) -> None:
        """Complete the ledger at a time [s]: a scan in progress ends there."""
        self._end_scan("stop", time)

    def _take(self) -> tuple[float, bytes]:
        """Take the next bytes off the line; return none if a fault strikes before they arrive."""
        time = self._line.next_time
        if self._stream is not None and self._counted:
            if self._faults.strikes("unplug", time):
                self._end_scan("unplug", time)
                self._rotor.stop(self._now(time))
                self.away_until = time + self._faults.rng["unplug"].uniform(1.0, 3.0)
                return time, b""
            if self._faults.strikes("protection-stop", time):
                self._end_scan("protection-stop", time)
                self._rotor.stop(self._now(time))
                self._stopped = True
                return time, b""
        return self._line.take()

    def _now(self, time: float) -> float:
        """Return when a command reaches the motor [s]: not before the samples that were already computed in advance."""
        ahead = self._made_until if self._stream is None else self._stream.next_sample
        return max(time, ahead, self._rotor.since)

    def _power_up(self, time: float) -> None:
        self._requests, self._last_heard = RequestReader(), time
        self._deaf_until = self._busy_until = time
        self._stopped = False
        self._rpm = float(DEFAULT_RPM)
        if self.model.motor is Motor.DTR:
            self._rotor.command(self._rpm / 60.0, self._now(time))

    def _reset(self, time: float) -> None:
        self._line.cut()
        self._rotor.stop(self._now(time))
        self._power_up(time)
        silence = 2.0 if "silent-reset" in self._faults else self.model.boot_time
        banner = self.model.banner or (BANNER if "banner" in self._faults else b"")
        self._deaf_until = self._line.send(banner, time + silence) if banner else time + silence

    def _handle(self, request: Request, time: float) -> None:
        """Execute a request; one that arrives during the answer to another is discarded."""
        if time < self._busy_until:
            return
        command, payload = request.command, request.payload
        if command in {Command.MOTOR_SPEED, Command.SET_MOTOR_PWM}:
            self._command_motor(command, payload, time)
            return
        stale = self._end_scan("stop", time)
        if stale:
            self._busy_until = self._line.send(stale, time)
        match command:
            case Command.RESET:
                self._reset(time)
            case Command.SCAN | Command.FORCE_SCAN:
                self._start_scan(self.model.modes[0], time, force=command is Command.FORCE_SCAN)
            case Command.EXPRESS_SCAN:
                if len(payload) == 5 and payload[0] < len(self.model.modes):
                    self._start_scan(self.model.modes[payload[0]], time, force=False)
            case _:
                if (answer := self._answer(command, payload)) is not None:
                    kind, content = answer
                    self._send(Descriptor(len(content), multiple=False, kind=kind).pack() + content, time)

    def _answer(self, command: Command, payload: bytes) -> tuple[Answer, bytes] | None:
        """Return the type and the content of a single answer; None where the request has no answer."""
        match command:
            case Command.GET_INFO:
                return Answer.INFO, self.model.info.pack()
            case Command.GET_HEALTH:
                health = Health(Status.ERROR, _ERROR_CODE) if self._stopped else Health(Status.GOOD)
                return Answer.HEALTH, health.pack()
            case Command.GET_SAMPLERATE:
                return Answer.SAMPLE_RATE, self.model.sample_rate.pack()
            case Command.GET_LIDAR_CONF if len(payload) >= 4 and not self._stopped:
                return Answer.LIDAR_CONF, conf_answer(self.model, payload)
            case Command.GET_ACC_BOARD_FLAG:
                return Answer.ACC_BOARD_FLAG, struct.pack("<I", self.model.motor is Motor.PWM)
            case _:
                return None

    def _start_scan(self, mode: Mode, time: float, *, force: bool) -> None:
        if self._stopped:
            return
        self._counted = True
        self._send(Descriptor(FORMATS[mode.answer].size, multiple=True, kind=mode.answer).pack(), time)
        self._scan(mode, time, force=force)

    def _scan(self, mode: Mode, time: float, *, force: bool) -> None:
        """Start to scan when the rotation is stable, or at once if forced."""
        if self.model.motor is Motor.RPM:
            self._rotor.command(self._rpm / 60.0, self._now(time))
        self._asked, self._mode = (mode, force), mode
        self._try_to_start(time)

    def _try_to_start(self, time: float) -> None:
        if self._asked is None or self._stream is not None:
            return
        mode, force = self._asked
        start = self._now(max(time, self._busy_until))
        if not force:
            start = self._rotor.stable_from(start)
        if math.isinf(start):
            return
        self._scans += 1
        rng = np.random.default_rng([self._scan_seed, self._scans])
        if self._counted and self.departure is None:
            self.departure = start

        def measure(angles_clockwise: Array, times: Array) -> Array:
            driven = times - (self.departure if self.departure is not None else math.inf)
            return self._scene.ranges(angles_clockwise, driven, mode.max_distance, rng)

        self._stream = ScanStream(mode, start, self.baud, self._rotor, measure, self._faults)

    def _end_scan(self, cause: str, time: float) -> bytes:
        """End the scan; return those of its bytes that the host still receives before the next answer."""
        stream, self._asked, self._stream = self._stream, None, None
        if self.model.motor is Motor.RPM:
            self._rotor.command(0.0, self._now(time))
        if stream is None:
            return b""
        self._made_until = stream.next_sample
        if self._counted:
            self.ledger.end(cause)
            self.ledger.loss(cause).events += 1
        stale = "stale-samples" in self._faults
        return self._line.cut(int(self._faults.rng["stale-samples"].integers(1, 400)) if stale else 0)

    def _command_motor(self, command: Command, payload: bytes, time: float) -> None:
        """Execute a motor command, if this model has it."""
        if len(payload) != 2:
            return
        (value,) = struct.unpack("<H", payload)
        if command is Command.MOTOR_SPEED and self.model.motor is Motor.RPM:
            if value == 0:
                self._end_scan("stop", time)
                return
            self._rpm = float(min(max(value, LOWEST_RPM), HIGHEST_RPM))
            if self._asked is not None:
                self._rotor.command(self._rpm / 60.0, self._now(time))
        elif command is Command.SET_MOTOR_PWM and self.model.motor is Motor.PWM:
            self._rotor.command(min(value, 1023) / DEFAULT_PWM * DEFAULT_RPM / 60.0, self._now(time))
            self._try_to_start(time)

    def _send(self, data: bytes, time: float) -> None:
        self._busy_until = self._line.send(data, max(time, self._busy_until) + LATENCY)
