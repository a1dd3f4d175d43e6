"""An emulated scanner in the middle of a room, in memory or at the end of a pseudo-terminal."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from drivers.rplidar import RequestReader
from sim.emulator import MODELS, Device, Scene
from sim.emulator.terminal import Terminal
from sim.motion.true_trajectory import TrueTrajectory
from sim.sensing.lidar import Lidar
from sim.worlds.built_in.demo_room import room


def make_device(model="S1", faults=(), seed=1):
    standing = TrueTrajectory(1.0, np.array([[2.0, 2.0, 0.5]]))
    return Device(MODELS[model], Scene(room(), Lidar.of_preset("rplidar-s1"), standing), seed, faults)


class Scanner:
    """A scanner at the end of a pseudo-terminal that a link leads to; ``heard`` are the requests it got."""

    def __init__(self, link, device):
        self.port, self.device, self.heard = str(link), device, []
        self._plugged = threading.Event()
        self._unplugged = threading.Event()
        self._changed = threading.Condition()
        reader, write = RequestReader(), device.write

        def listen(data, time, baud=None):
            write(data, time, baud)
            with self._changed:
                self.heard += reader.feed(data)
                self._changed.notify_all()

        device.write = listen
        self._terminal = Terminal(device, link, lambda path: self._plugged.set())
        self._thread = threading.Thread(target=self._serve)

    def _serve(self):
        with self._terminal as terminal:
            terminal.serve(self._unplugged.is_set)

    def hears_last(self, *requests):
        """Whether these bytes are the last requests, now or soon."""

        def heard():
            return [request.pack() for request in self.heard[-len(requests) :]] == list(requests)

        with self._changed:
            return self._changed.wait_for(heard, 30.0)

    def plug_in(self):
        self._thread.start()
        assert self._plugged.wait(30.0)

    def unplug(self):
        self._unplugged.set()
        self._thread.join(30.0)
        assert not self._thread.is_alive()


@pytest.fixture
def device():
    return make_device


@pytest.fixture
def scanner(tmp_path):
    """Plug a scanner in; it is pulled out at the end of the context."""

    @contextmanager
    def plugged_in(model="S1", faults=()) -> Iterator[Scanner]:
        emulated = Scanner(tmp_path / "scanner", make_device(model, faults))
        emulated.plug_in()
        try:
            yield emulated
        finally:
            emulated.unplug()

    return plugged_in
