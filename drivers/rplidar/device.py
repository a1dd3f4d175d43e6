"""A scanner that answers: its health, its motor and its scan."""

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
"""For the first answer after a reset [s]; an S1 needs 2 s."""

RESETS = 2
"""Resets after which a protection stop is final."""

DEFAULT_RPM = 600
DEFAULT_PWM = 660


class Device:
    """A scanner on an open port, at rest: found, healthy, its scan modes known.

    Parameters
    ----------
    port : name of the port.
    closing : set to give up at once.
    baud : speed [bit/s], where it is known.

    Attributes
    ----------
    info : model, firmware and serial number.
    modes : how it can scan.
    typical : the mode that it recommends.

    Raises
    ------
    DriverError
        The port cannot be opened, no scanner answers, or its health is beyond repair.
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
        """Mode of a name, in any case of letters; the typical one for None.

        Raises
        ------
        DriverError
            It has none of this name.
        """
        if name is None:
            return self.typical
        found = next((mode for mode in self.modes if mode.name.lower() == name.lower()), None)
        if found is None:
            raise DriverError(f"{self.name} has no scan mode {name!r}: choose {', '.join(m.name for m in self.modes)}")
        return found

    def health(self) -> Health:
        """State of the device by its own judgement."""
        return Health.unpack(ask(self._link, Command.GET_HEALTH, Answer.HEALTH, 3))

    def start(self, mode: ScanMode, rpm: int | None = None) -> tuple[ScanStream, bytes]:
        """Start motor and scan.

        Returns
        -------
        stream : how to read what follows.
        data : the first bytes of it.

        Raises
        ------
        DriverError
            It does not start.
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
        """Bytes of the scan; nothing where none came within a short wait."""
        return self._link.read()

    def close(self) -> None:
        """Stop scan and motor, as far as the device still listens, and close the port."""
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
        """Reset the device out of a protection stop."""
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
        """Ask until there is an answer: some models send a text of their own before, others nothing for seconds."""
        end = time.monotonic() + RESET_LIMIT
        while time.monotonic() < end:
            self._link.drain(QUIET, DRAIN_LIMIT)
            if identify(self._link).descriptor is not None:
                return
        raise DriverError(f"{self.name} has not come back {RESET_LIMIT:g} s after a reset: plug it in anew")
