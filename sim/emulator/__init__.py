"""An emulator of RPLIDAR scanners: it answers the serial protocol with samples from the simulator.

The room promises bytes as a real scanner sends them, reproducible from a seed, and exact counts of what its faults
destroyed. It may import the rooms of sensing, motion, worlds and casting.
"""

from sim.emulator.device import Device
from sim.emulator.faults import FAULTS
from sim.emulator.ledger import Ledger, Loss
from sim.emulator.models import MODELS, Mode, Model, Motor
from sim.emulator.scene import Scene, single_beams

__all__ = ["FAULTS", "MODELS", "Device", "Ledger", "Loss", "Mode", "Model", "Motor", "Scene", "single_beams"]
