"""An RPLIDAR that is not there: the other end of a serial line, its samples taken from the simulator."""

from sim.emulator.device import Device
from sim.emulator.faults import FAULTS
from sim.emulator.ledger import Ledger, Loss
from sim.emulator.models import MODELS, Mode, Model, Motor
from sim.emulator.scene import Scene, single_beams

__all__ = ["FAULTS", "MODELS", "Device", "Ledger", "Loss", "Mode", "Model", "Motor", "Scene", "single_beams"]
