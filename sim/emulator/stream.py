"""The samples of one scan, in packets, each with the time at which it arrives."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drivers.rplidar import (
    FORMATS,
    Answer,
    encode_dense,
    encode_express,
    encode_hq,
    encode_standard,
    encode_ultra,
    encode_ultra_dense,
    optical_offsets,
)
from drivers.rplidar.codecs.samples import NOMINAL_QUALITY, RADIANS_PER_Q6, TURN_Q6
from features.se2 import Array
from sim.emulator.faults import Faults
from sim.emulator.models import Mode
from sim.emulator.rotor import Rotor

_BLOCK_TIME = 0.035
"""Samples are taken in blocks of about this length [s]: a cast costs little more for many than for one."""

_NODE_TIME = 1e-3
"""Packets of one sample come in groups of about this length [s], as a USB bridge passes them on."""

_FARTHEST = {Answer.STANDARD: 16.38, Answer.EXPRESS: 16.38, Answer.ULTRA: 28.6}
"""What is farther does not fit into the packet [m]."""

_LARGEST_OFFSET = math.radians(7.875)

Measure = Callable[[Array, Array], Array]
"""Ranges [m] of beams with clockwise angles [rad] at times [s], each of shape (n,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Packet:
    """Packets that arrive together: one, or some with one sample each.

    Parameters
    ----------
    time : when the last byte arrives [s].
    data : the bytes.
    revolutions : number of the revolution of each sample, a row for each packet.
    capsule : whether its samples need the next packet.
    follows : whether the angle was kept since the packet before.
    zeroed : samples that returned, but for a fault.
    struck : faults that came since the packet before.
    """

    time: float
    data: bytes
    revolutions: npt.NDArray[np.int64]
    capsule: bool
    follows: bool
    zeroed: int
    struck: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Draft:
    """Samples of a packet before it is known how the next one begins."""

    times: Array
    turns: Array
    ranges: Array
    offsets: Array
    follows: bool
    zeroed: int
    struck: tuple[str, ...]


class ScanStream:
    """Makes the packets of one scan, the same ones for the same arguments.

    Sample k of a packet is taken at ``start + k T``; the packet arrives ``3/2 T`` after its last sample, of which one T
    is the filter's and half of one the rest of the sample, and the time of its bytes on the line later.

    Parameters
    ----------
    mode : of the scan.
    start : when the first sample is taken [s].
    baud : rate of the line.
    rotor : the turning head.
    measure : what the scanner sees.
    faults : those that come before the packets are made: ``speed-change``, ``encoder-reset``, ``zero-sectors``.
    """

    def __init__(self, mode: Mode, start: float, baud: int, rotor: Rotor, measure: Measure, faults: Faults) -> None:
        self.next_sample = start
        self._mode, self._baud, self._rotor, self._measure, self._faults = mode, baud, rotor, measure, faults
        self._format = FORMATS[mode.answer]
        self._period = mode.us_per_sample * 1e-6
        group = max(1, round(_NODE_TIME / self._period)) if self._format.samples == 1 else 1
        self._count = group * self._format.samples
        self._packets = max(1, round(_BLOCK_TIME / (self._count * self._period)))
        self._held: _Draft | None = None
        rng = faults.rng["zero-sectors"]
        self._sector = rng.uniform(), rng.uniform(10.0, 60.0) / 360.0
        self._last_revolution: int | None = None

    def block(self) -> list[Packet]:
        """Take the next samples; the last packet of them waits for the next block."""
        time, follows = self.next_sample, self._held is not None
        kinds = ("speed-change", "zero-sectors", "encoder-reset")
        struck = tuple(name for name in kinds[: 3 if follows else 2] if self._faults.strikes(name, time))
        if "speed-change" in struck:
            self._rotor.disturb(self._faults.rng["speed-change"].uniform(0.8, 1.2), time)
        if "encoder-reset" in struck:
            time += self._faults.rng["encoder-reset"].uniform(0.2, 0.9) / max(self._rotor.wanted, 1.0)
            follows = False
        times = time + self._period * np.arange(self._packets * self._count, dtype=np.float64)
        self.next_sample = time + self._period * len(times)
        turns = self._rotor.turns(times)
        if "zero-sectors" in struck:
            rng = self._faults.rng["zero-sectors"]
            self._sector = rng.uniform(), rng.uniform(10.0, 60.0) / 360.0
        ranges, offsets, zeroed = self._sample(turns, times)
        drafts = [] if self._held is None else [self._held]
        for k in range(self._packets):
            part = slice(k * self._count, (k + 1) * self._count)
            begins = k == 0
            drafts.append(
                _Draft(
                    times=times[part],
                    turns=turns[part],
                    ranges=ranges[part],
                    offsets=offsets[part],
                    follows=follows or not begins,
                    zeroed=int(zeroed[part].sum()),
                    struck=struck if begins else (),
                )
            )
        self._held = drafts[-1]
        return [self._pack(draft, after) for draft, after in itertools.pairwise(drafts)]

    def _sample(self, turns: Array, times: Array) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
        """Ranges [m], what their angles lag behind the encoder [rad], and whether a fault has taken each."""
        encoder = 2.0 * math.pi * (turns % 1.0)
        answer = self._mode.answer
        if answer in {Answer.EXPRESS, Answer.ULTRA}:
            # The offset depends on the range that is to be measured with it.
            offsets = self._offsets(self._measure(encoder - self._offsets(np.full(len(turns), 2.0)), times))
        else:
            offsets = np.zeros(len(turns))
        ranges = self._measure((encoder - offsets) % (2.0 * math.pi), times)
        ranges[ranges > _FARTHEST.get(answer, math.inf)] = 0.0
        zeroed = np.zeros(len(turns), dtype=np.bool_)
        if "zero-sectors" in self._faults:
            begin, width = self._sector
            zeroed = ((turns - begin) % 1.0 < width) & (ranges > 0.0)
            ranges[zeroed] = 0.0
        return ranges, offsets, zeroed

    def _offsets(self, ranges: Array) -> Array:
        """Angles that the beams lag behind the encoder [rad], as the packets can tell them."""
        offsets = optical_offsets(ranges)
        if self._mode.answer is Answer.ULTRA:
            return offsets
        step = math.radians(0.125)
        return np.minimum(np.rint(offsets / step) * step, _LARGEST_OFFSET)

    def _pack(self, draft: _Draft, after: _Draft) -> Packet:
        """Encode a packet, knowing the next one."""
        revolutions, first = self._revolutions(draft, after), self._last_revolution is None
        data = self._encode(draft, after, revolutions)
        self._last_revolution = int(revolutions[-1])
        arrival = draft.times[-1] + 1.5 * self._period + len(data) * 10.0 / self._baud
        return Packet(
            time=float(arrival),
            data=data,
            revolutions=revolutions.reshape(-1, self._format.samples),
            capsule=self._format.measure is not None,
            follows=draft.follows or first,
            zeroed=draft.zeroed,
            struck=draft.struck,
        )

    def _revolutions(self, draft: _Draft, after: _Draft) -> npt.NDArray[np.int64]:
        """Count the revolution of each sample, by the angle that the packets tell, shape (n,)."""
        steps = 65536 if self._mode.answer is Answer.HQ else TURN_Q6
        if self._format.measure is None or not after.follows:
            return np.rint(draft.turns * steps).astype(np.int64) // steps
        start, end = (int(np.rint(turns * steps)) for turns in (draft.turns[0], after.turns[0]))
        return (start * self._count + (end - start) * np.arange(self._count)) // (self._count * steps)

    def _encode(self, draft: _Draft, after: _Draft, revolutions: npt.NDArray[np.int64]) -> bytes:
        answer, ranges = self._mode.answer, draft.ranges
        qualities = np.where(ranges > 0.0, NOMINAL_QUALITY, 0).astype(np.uint8)
        start = round(draft.turns[0] * TURN_Q6) * RADIANS_PER_Q6
        restart, clock = not draft.follows, int(draft.times[-1] * 1e6)
        angles = 2.0 * math.pi * (draft.turns % 1.0)
        before = revolutions[0] if self._last_revolution is None else self._last_revolution
        starts = np.diff(revolutions, prepend=before) > 0
        starts[0] |= restart and self._last_revolution is not None
        match answer:
            case Answer.STANDARD:
                return encode_standard(angles, ranges, qualities, starts)
            case Answer.HQ:
                return encode_hq(angles, ranges, qualities, starts, clock)
            case Answer.EXPRESS:
                return encode_express(start, ranges, draft.offsets, restart=restart)
            case Answer.ULTRA:
                return encode_ultra(start, ranges, after.ranges[0], restart=restart)
            case Answer.DENSE:
                return encode_dense(start, ranges, restart=restart)
            case Answer.ULTRA_DENSE:
                return encode_ultra_dense(start, ranges, qualities, restart=restart, time=clock & 0xFFFFFFFF)
            case _:
                raise ValueError(f"no scan is answered with {answer!r}")
