"""Emulated scanners on their way through the apartment; ``of_real_time`` is the share of a core that they take."""

import pytest

from drivers.rplidar.protocol.requests import express_scan, motor_pwm
from sim import Robot, find_site
from sim.emulator import MODELS, Device, Motor, Scene, single_beams

SECONDS = 2.0


@pytest.mark.parametrize("name", MODELS)
def test_emulator(benchmark, name):
    model = MODELS[name]
    site = find_site("apartment")
    device = Device(model, Scene(site.world(), single_beams("rplidar-s1"), Robot().drive(site.waypoints, 50.0)))
    if model.motor is Motor.PWM:
        device.write(motor_pwm(660), 0.0)
    device.write(express_scan(model.typical), 0.0)
    device.read(5.0)
    time = 5.0

    def run():
        nonlocal time
        time += SECONDS
        return device.read(time)

    assert len(benchmark.pedantic(run, rounds=5)) > 10000
    if benchmark.stats is not None:
        benchmark.extra_info["of_real_time"] = round(benchmark.stats.stats.median / SECONDS, 3)
