"""Emulated scanners for the tests: a bare room, and hosts that only listen."""

import math
from dataclasses import dataclass, field

import numpy as np

from drivers.rplidar import FORMATS, AnswerSearch, Command, Counts, SampleDecoder, Samples
from drivers.rplidar.protocol.requests import express_scan, motor_pwm, request
from sim import Lidar, Robot, World
from sim.emulator import MODELS, Device, Motor, Scene

BARE_ROOM = World.from_polygons("bare-room", [[(0.0, 0.0), (7.0, 0.0), (7.0, 5.0), (0.0, 5.0)]])
"""No wall ends in front of another, so that ranges change steadily with the angle."""

TRAJECTORY = Robot().drive([(1.5, 1.0), (2.1, 1.2), (2.4, 2.0), (5.2, 3.5), (2.0, 3.8), (1.6, 1.2)], 50.0)

QUIET = Scene(BARE_ROOM, Lidar.of_preset("ideal"), TRAJECTORY)
NOISY = Scene(BARE_ROOM, Lidar.of_preset("rplidar-s1"), TRAJECTORY)

HEALED = 4.0
"""From a reset until every model answers, with a banner and a host that stalls [s]."""

LOT = 4096
"""Bytes that are decoded together."""


@dataclass
class Heard:
    """What a host has decoded."""

    samples: list[Samples] = field(default_factory=list)
    counts: Counts = field(default_factory=Counts)
    arrivals: list[float] = field(default_factory=list)
    data: list[bytes] = field(default_factory=list)

    @property
    def total(self) -> int:
        return sum(map(len, self.samples))


def listen(device: Device, mode: int, seconds: float) -> Heard:
    """Scan with a device until a time [s] of its clock; plug it in, reset it and scan again whenever it ends."""
    heard, time = Heard(), 0.0
    answer = device.model.modes[mode].answer
    while time < seconds:
        if device.away_until is not None:
            time = device.away_until
            device.plug_in()
        device.write(request(Command.RESET), time)
        time += HEALED
        device.read(time)
        if device.model.motor is Motor.PWM:
            device.write(motor_pwm(660), time)
        device.write(express_scan(mode), time)
        search, decoder = AnswerSearch({answer: FORMATS[answer].size}, multiple=True), None
        waiting = b""
        for at, data in device.chunks(seconds):
            time = at
            heard.arrivals.append(at)
            heard.data.append(data)
            waiting += data
            if len(waiting) < LOT:
                continue
            if decoder is None and search.feed(waiting):
                decoder, waiting = SampleDecoder(answer), search.rest
            if decoder is not None:
                heard.samples += decoder.feed(waiting)
            waiting = b""
        if decoder is None and search.feed(waiting):
            decoder, waiting = SampleDecoder(answer), search.rest
        if decoder is not None:
            heard.samples += decoder.feed(waiting)
            heard.counts += decoder.counts
        if device.away_until is None and math.isfinite(device.next_time):
            break
    device.end(seconds)
    return heard


def make(name: str = "S1", scene: Scene = QUIET, seed: int = 1, faults: tuple[str, ...] = ()) -> Device:
    return Device(MODELS[name], scene, seed, faults)


def angles_of(samples: list[Samples]) -> np.ndarray:
    return np.concatenate([part.angles_clockwise for part in samples])


def ranges_of(samples: list[Samples]) -> np.ndarray:
    return np.concatenate([part.ranges for part in samples])
