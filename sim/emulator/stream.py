"""The packets of one scan, each with the time at which it arrives."""

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
"""Samples are taken in blocks of about this length [s]: a cast costs little more for many beams than for one."""

_NODE_TIME = 1e-3
"""Packets of one sample come in groups of about this length [s], as a USB bridge passes them on."""

_FARTHEST = {Answer.STANDARD: 16.38, Answer.EXPRESS: 16.38, Answer.ULTRA: 28.6}
"""Largest range that fits into the packet [m]; farther walls give no return."""

_LARGEST_OFFSET = math.radians(7.875)
"""Largest offset of an angle that an express packet holds [rad]: 63 steps of 1/8 deg."""

Measure = Callable[[Array, Array], Array]
"""Ranges [m] of beams with clockwise angles [rad] at times [s], each of shape (n,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Packet:
    """Packets that arrive together: one, or several with one sample each.

    Parameters
    ----------
    time : time at which the last byte arrives [s].
    data : the bytes.
    revolutions : number of the revolution of each sample, a row for each packet.
    capsule : whether its samples need the next packet to be decoded.
    follows : whether the angle continues from the packet before.
    zeroed : number of samples whose return a fault has removed.
    struck : faults that occurred since the packet before.
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
    """Samples of a packet that is not encoded yet, because it depends on the first sample of the next."""

    times: Array
    turns: Array
    ranges: Array
    offsets: Array
    follows: bool
    zeroed: int
    struck: tuple[str, ...]


class ScanStream:
    """The source of the packets of one scan; the same arguments give the same packets.

    Sample k of a packet is taken at ``start + k T``. The packet arrives ``3/2 T`` after its last sample, plus the time
    of its bytes on the line; ``T/2`` is the rest of the sample, and one T the delay of the filter of the device.

    Parameters
    ----------
    mode : scan mode.
    start : time of the first sample [s].
    baud : baud rate of the line.
    rotor : the rotating head.
    measure : measures the ranges.
    faults : faults; those of the scanner itself are ``speed-change``, ``encoder-reset``, ``zero-sectors``.
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
        """Take the next block of samples; return its packets but the last, which needs the next block."""
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
            is_first = k == 0
            drafts.append(
                _Draft(
                    times=times[part],
                    turns=turns[part],
                    ranges=ranges[part],
                    offsets=offsets[part],
                    follows=follows or not is_first,
                    zeroed=int(zeroed[part].sum()),
                    struck=struck if is_first else (),
                )
            )
        self._held = drafts[-1]
        return [self._pack(draft, after) for draft, after in itertools.pairwise(drafts)]

    def _sample(self, turns: Array, times: Array) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
        """Return ranges [m], lags of their angles behind the encoder [rad], and whether a fault has removed each."""
        encoder = 2.0 * math.pi * (turns % 1.0)
        answer = self._mode.answer
        if answer in {Answer.EXPRESS, Answer.ULTRA}:
            # The offset depends on the range that is measured with it: a first pass uses the offset of a range of 2 m.
            offsets = self._offsets(self._measure(encoder - self._offsets(np.full(len(turns), 2.0)), times))
        else:
            offsets = np.zeros(len(turns))
        ranges = self._measure((encoder - offsets) % (2.0 * math.pi), times)
        ranges[ranges > _FARTHEST.get(answer, math.inf)] = 0.0
        zeroed = np.zeros(len(turns), dtype=np.bool_)
        if "zero-sectors" in self._faults:
            start, width = self._sector
            zeroed = ((turns - start) % 1.0 < width) & (ranges > 0.0)
            ranges[zeroed] = 0.0
        return ranges, offsets, zeroed

    def _offsets(self, ranges: Array) -> Array:
        """Return the lags of the beams behind the encoder [rad], rounded as in the packets."""
        offsets = optical_offsets(ranges)
        if self._mode.answer is Answer.ULTRA:
            return offsets
        step = math.radians(0.125)
        return np.minimum(np.rint(offsets / step) * step, _LARGEST_OFFSET)

    def _pack(self, draft: _Draft, after: _Draft) -> Packet:
        """Encode a packet, for which the next one is needed."""
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
        """Return the number of the revolution of each sample, by the rounded angle in the packets, shape (n,)."""
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
