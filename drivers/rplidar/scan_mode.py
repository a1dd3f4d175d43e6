"""Scan modes of a scanner."""

import logging
from dataclasses import dataclass

from drivers.errors import DriverError
from drivers.rplidar.codecs.formats import FORMATS
from drivers.rplidar.protocol.answers import Answer, Conf, SampleRate, unpack_name
from drivers.rplidar.protocol.link import Link
from drivers.rplidar.protocol.request_reply import ask, ask_conf, ask_number
from drivers.rplidar.protocol.requests import Command, express_scan, request

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ScanMode:
    """A scan mode.

    Parameters
    ----------
    number : id of the mode in requests; 0 where the device has no list of modes.
    name : name that the device gives it.
    answer : type of its packets.
    us_per_sample : time from one sample to the next [us].
    max_distance : [m]; 0 where it is unknown.
    """

    number: int
    name: str
    answer: Answer
    us_per_sample: float
    max_distance: float = 0.0

    @property
    def request(self) -> bytes:
        """Request that starts the scan."""
        return request(Command.SCAN) if self.answer is Answer.STANDARD else express_scan(self.number)


def list_modes(link: Link) -> tuple[tuple[ScanMode, ...], ScanMode]:
    """Request all scan modes that can be decoded here, and the typical one.

    Raises
    ------
    DriverError
        The device does not answer, or its typical mode cannot be decoded.
    """
    modes = [_describe(link, number) for number in range(int(ask_number(link, Conf.MODE_COUNT)))]
    known = tuple(mode for mode in modes if mode is not None)
    number = int(ask_number(link, Conf.TYPICAL_MODE))
    typical = next((mode for mode in known if mode.number == number), None)
    if typical is None:
        raise DriverError(f"{link.port}: its typical scan mode {number} is not one that can be read: name another one")
    return known, typical


def standard_mode(link: Link) -> ScanMode:
    """Request the only mode of a device that has no list of modes."""
    rate = SampleRate.unpack(ask(link, Command.GET_SAMPLERATE, Answer.SAMPLE_RATE, 4))
    return ScanMode(0, "Standard", Answer.STANDARD, _checked(link, rate.standard_us))


def _describe(link: Link, number: int) -> ScanMode | None:
    name = unpack_name(ask_conf(link, Conf.MODE_NAME, number))
    kind = int(ask_number(link, Conf.ANSWER_TYPE, number))
    if kind not in FORMATS:
        logger.warning("%s: scan mode %s is left out, its packets 0x%02x are not known", link.port, name, kind)
        return None
    us_per_sample = _checked(link, ask_number(link, Conf.US_PER_SAMPLE, number))
    return ScanMode(number, name, Answer(kind), us_per_sample, ask_number(link, Conf.MAX_DISTANCE_M, number))


def _checked(link: Link, us_per_sample: float) -> float:
    if us_per_sample <= 0.0:
        raise DriverError(f"{link.port}: a scan mode takes {us_per_sample:g} us per sample: expected more than 0")
    return us_per_sample
