"""Bytes of an emulated scanner, without a port and without waiting."""

from drivers.rplidar import Answer, ScanStream
from drivers.rplidar.protocol.requests import express_scan, motor_speed
from sim.emulator import MODELS, Device, Scene
from sim.scenarios import site_run
from sim.sensing.lidar import Lidar
from sim.worlds.catalogue import find_site


def emulated_device(world: str = "room", seed: int = 1) -> Device:
    """S1 on a robot that drives through a world."""
    run = site_run(find_site(world), Lidar.of_preset("rplidar-s1"), "rplidar-s1", seed)
    return Device(MODELS["S1"], Scene(run.world, run.lidar, run.trajectory), seed)


def emulated_chunks(seconds: float) -> tuple[ScanStream, list[tuple[float, bytes]]]:
    """Return what it sends in its dense mode in so many seconds: how to read it, and its bytes with their times [s]."""
    device = emulated_device()
    device.write(motor_speed(600), 0.0)
    device.write(express_scan(1), 0.0)
    chunks = list(device.chunks(seconds))
    begin, first = chunks[0]
    return ScanStream(Answer.DENSE, 108.0, device.baud), [(begin, first[7:]), *chunks[1:]]
