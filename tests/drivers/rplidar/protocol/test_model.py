import pytest

from drivers.rplidar.protocol.model import Motor, has_conf, model_name, motor, sensor_name
from features.sensor import SENSOR_PRESETS


@pytest.mark.parametrize(
    ("model", "name", "kind", "sensor"),
    [
        (0x18, "A1M8", Motor.SWITCH, "rplidar-a1"),
        (0x28, "A2M8", Motor.PWM, "rplidar-a2"),
        (0x2C, "A2M12", Motor.PWM, "rplidar-a2"),
        (0x31, "A3M1", Motor.PWM, "rplidar-a3"),
        (0x41, "C1M1", Motor.SWITCH, None),
        (0x61, "S1M1", Motor.RPM, "rplidar-s1"),
        (0x71, "S2M1", Motor.RPM, "rplidar-s2"),
        (0x82, "S3M2", Motor.RPM, None),
        (0x91, "T1M1", Motor.RPM, None),
        (0xC1, "M1M1", Motor.RPM, None),
    ],
)
def test_models_by_their_byte(model, name, kind, sensor):
    assert (model_name(model), motor(model), sensor_name(model)) == (name, kind, sensor)
    assert sensor is None or sensor in SENSOR_PRESETS


@pytest.mark.parametrize(
    ("model", "firmware", "expected"),
    [(0x18, (1, 23), False), (0x18, (1, 24), True), (0x18, (2, 0), True), (0x61, (1, 0), True)],
)
def test_old_firmware_has_no_configuration(model, firmware, expected):
    assert has_conf(model, firmware) is expected
