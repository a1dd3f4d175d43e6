"""A scanner on an open port: its health, its motor and its scan."""

import logging
import time
from contextlib import suppress
from threading import Event

from drivers.errors import DriverError
from drivers.rplidar.codecs.formats import FORMATS
from drivers.rplidar.connect import DRAIN_LIMIT, QUIET, connect, identify
from drivers.rplidar.protocol import requests
from drivers.rplidar.protocol.answer_search import AnswerSearch
from drivers.rplidar.protocol.answers import Answer, Health, Status
from drivers.rplidar.protocol.model import Motor, has_conf, model_name, motor
from drivers.rplidar.protocol.request_reply import NoAnswerError, ask, search_answer
from drivers.rplidar.protocol.requests import Command
from drivers.rplidar.revolutions import ScanStream
from drivers.rplidar.scan_mode import ScanMode, list_modes, standard_mode

logger = logging.getLogger(__name__)

RESET_LIMIT = 6.0
"""Longest wait for the first answer after a reset [s]; an S1 needs 2 s."""

RESETS = 2
"""Resets that are tried to end a protection stop."""

DEFAULT_RPM = 600
DEFAULT_PWM = 660


class Device:
    """A scanner on an open port that does not scan yet; its health is checked and its scan modes are known.

    Parameters
    ----------
    port : name of the port.
    closing : set to give up at once.
    baud : speed [bit/s], where it is known.

    Attributes
    ----------
    info : model, firmware and serial number.
    modes : its scan modes that can be decoded here.
    typical : the scan mode that the scanner recommends.

    Raises
    ------
    DriverError
        The port cannot be opened, no scanner answers, or resets do not end its protection stop.
    """

    def __init__(self, port: str, closing: Event, baud: int | None = None) -> None:
        self._link, self.info = connect(port, closing, baud)
        try:
            self._recover()
            if has_conf(self.info.model, self.info.firmware):
                self.modes, self.typical = list_modes(self._link)
            else:
                self.typical = standard_mode(self._link)
                self.modes = (self.typical,)
        except BaseException:
            self.close()
            raise

    @property
    def port(self) -> str:
        """Name of the port."""
        return self._link.port

    @property
    def name(self) -> str:
        """Model and port."""
        return f"{model_name(self.info.model)} on {self.port}"

    @property
    def baud(self) -> int:
        """Speed of the link [bit/s]."""
        return self._link.baud

    def mode(self, name: str | None) -> ScanMode:
        """Scan mode of a name, in upper or lower case; the typical one for None.

        Raises
        ------
        DriverError
            The scanner has no mode of this name.
        """
        if name is None:
            return self.typical
        found = next((mode for mode in self.modes if mode.name.lower() == name.lower()), None)
        if found is None:
            raise DriverError(f"{self.name} has no scan mode {name!r}: choose {', '.join(m.name for m in self.modes)}")
        return found

    def health(self) -> Health:
        """Health status that the device reports."""
        return Health.unpack(ask(self._link, Command.GET_HEALTH, Answer.HEALTH, 3))

    def start(self, mode: ScanMode, rpm: int | None = None) -> tuple[ScanStream, bytes]:
        """Start motor and scan.

        Returns
        -------
        stream : parameters of the scan.
        data : its first bytes.

        Raises
        ------
        DriverError
            The scan does not start.
        """
        self._start_motor(rpm)
        search = AnswerSearch({answer: form.size for answer, form in FORMATS.items()}, multiple=True)
        if not search_answer(self._link, mode.request, search) or search.descriptor is None:
            state = self.health()
            raise DriverError(
                f"{self.name} does not start to scan (health {state.status}, error 0x{state.error_code:04x}): "
                "check that nothing blocks it, then plug it in anew"
            )
        return ScanStream(Answer(search.descriptor.kind), mode.us_per_sample, self.baud), search.rest

    def read(self) -> bytes:
        """Read bytes of the scan; empty where none come within :data:`drivers.rplidar.protocol.link.READ_WAIT`."""
        return self._link.read()

    def close(self) -> None:
        """Stop scan and motor, if the device is still connected, and close the port."""
        with suppress(DriverError):
            self._link.write(requests.request(Command.STOP))
            match motor(self.info.model):
                case Motor.RPM:
                    self._link.write(requests.motor_speed(0))
                case Motor.PWM:
                    self._link.write(requests.motor_pwm(0))
                case Motor.SWITCH:
                    pass
        self._link.set_dtr(True)
        self._link.close()

    def _start_motor(self, rpm: int | None) -> None:
        self._link.set_dtr(False)
        kind = motor(self.info.model)
        if kind is Motor.RPM:
            self._link.write(requests.motor_speed(DEFAULT_RPM if rpm is None else rpm))
            return
        if kind is Motor.PWM:
            with suppress(NoAnswerError):
                flag = ask(self._link, Command.GET_ACC_BOARD_FLAG, Answer.ACC_BOARD_FLAG, 4)
                if flag[0] & 1:
                    self._link.write(requests.motor_pwm(DEFAULT_PWM))
        if rpm is not None:
            logger.warning("%s: only the speed of an S-series scanner can be set: it turns as it does", self.name)

    def _recover(self) -> None:
        """End a protection stop by resets."""
        state = self.health()
        for _ in range(RESETS):
            if state.status != Status.ERROR:
                break
            logger.warning("%s is in protection stop, error 0x%04x: it is reset", self.name, state.error_code)
            self._link.write(requests.request(Command.RESET))
            self._await_boot()
            state = self.health()
        if state.status == Status.ERROR:
            raise DriverError(
                f"{self.name} stays in protection stop after {RESETS} resets (error 0x{state.error_code:04x}): check "
                "that nothing blocks its head, leave it unplugged for a while; if that does not help it is broken"
            )
        if state.status == Status.WARNING:
            logger.warning("%s warns of its health, error 0x%04x", self.name, state.error_code)

    def _await_boot(self) -> None:
        """Repeat a request until it is answered: some models boot for seconds, and some send a text first."""
        end = time.monotonic() + RESET_LIMIT
        while time.monotonic() < end:
            self._link.drain(QUIET, DRAIN_LIMIT)
            if identify(self._link).descriptor is not None:
                return
        raise DriverError(f"{self.name} has not come back {RESET_LIMIT:g} s after a reset: plug it in anew")
