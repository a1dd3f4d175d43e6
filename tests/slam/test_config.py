"""Configuration: TOML in and out, presets, and errors that name file and key in one sentence."""

import math
import tomllib
from pathlib import Path

import pytest
from pydantic import ValidationError

from drivers.frame import SourceInfo
from features.errors import CwlfError
from features.sensor import SENSOR_PRESETS, Mounting
from slam.config import SlamConfig
from slam.config_file import load_config, to_toml
from slam.errors import ConfigError

WITHOUT_ODOMETRY = SourceInfo("hall", "sick-lms", has_odometry=False)

OTHER = """
seed = 7
[sensor]
preset = "rplidar-s1"
sigma_range_mm = 33.0
[sensor.mounting]
yaw_deg = 180.0
upside_down = true
[extraction]
fit = "cwlf"
covariance = "paper"
[odometry]
heading_per_turn_deg = 9.5
[front_end]
match_probability = 0.95
[back_end]
max_iterations = 5
[map]
min_observations = 1
"""


@pytest.fixture
def write(tmp_path):
    def write_file(content: str | bytes) -> Path:
        path = tmp_path / "own.toml"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write_file


@pytest.mark.parametrize("preset", sorted(SENSOR_PRESETS))
def test_defaults_survive_toml(write, preset):
    config = SlamConfig.of_preset(preset)
    assert load_config(write(to_toml(config))) == config


def test_other_values_survive_toml(write):
    config = load_config(write(OTHER))
    text = to_toml(config)
    assert load_config(write(text)) == config
    assert to_toml(load_config(write(text))) == text


def test_toml_has_every_key_with_its_meaning():
    text = to_toml(SlamConfig.of_preset("sick-lms"))

    def leaves(table):
        return [leaf for value in table.values() for leaf in (leaves(value) if isinstance(value, dict) else [value])]

    lines = [line for line in text.splitlines() if "=" in line]
    assert len(lines) == len(leaves(tomllib.loads(text))) == len(leaves(SlamConfig.of_preset("sick-lms").model_dump()))
    assert [line for line in lines if "#" not in line] == []


def test_file_overrides_only_what_it_names(write):
    config = load_config(write("[front_end]\nbirth_distance_m = 0.2\n"), source=SourceInfo("hall", "rplidar-s1"))
    expected = SlamConfig.of_preset("rplidar-s1").model_dump()
    expected["front_end"]["birth_distance_m"] = 0.2
    assert config.model_dump() == expected
    assert load_config(write(OTHER)).sensor.range_max_m == SENSOR_PRESETS["rplidar-s1"].range_max


def test_a_whole_number_stands_for_a_number(write):
    assert load_config(write("[front_end]\nbirth_distance_m = 2\n")).front_end.birth_distance_m == 2.0


def test_units_are_turned_into_si():
    config = load_config(None, source=SourceInfo("hall", "rplidar-s1", Mounting(0.1, -0.2, math.radians(30.0), True)))
    model, preset = config.sensor.model(), SENSOR_PRESETS["rplidar-s1"]
    assert model.sigma_range == pytest.approx(preset.sigma_range)
    assert model.sigma_bearing == pytest.approx(preset.sigma_bearing)
    assert (model.range_min, model.range_max) == (preset.range_min, preset.range_max)
    assert model.mounting.theta == pytest.approx(math.radians(30.0))
    assert (model.mounting.x, model.mounting.y, model.mounting.upside_down) == (0.1, -0.2, True)


def test_asked_for_comes_before_the_file_and_the_file_before_the_source(write):
    source = SourceInfo("hall", "sick-lms", Mounting(x=0.3))
    s1 = SourceInfo("hall", "rplidar-s1")
    assert load_config(None, source=s1).sensor.preset == "rplidar-s1"
    assert load_config(None, preset="sick-lms", source=s1).sensor.preset == "sick-lms"
    from_file = load_config(write(OTHER), source=source, seed=3)
    assert (from_file.sensor.preset, from_file.seed) == ("rplidar-s1", 3)
    assert from_file.sensor.mounting.x_m == 0.3
    assert from_file.sensor.mounting.yaw_deg == 180.0
    assert load_config(write(OTHER)).seed == 7


@pytest.mark.parametrize(
    ("content", "key", "reason"),
    [
        ("sed = 1", "sed", "no such key"),
        ("[front_end]\nmatch_probabilty = 0.9", "front_end.match_probabilty", "no such key"),
        ("[sensor.mounting]\nroll_deg = 1", "sensor.mounting.roll_deg", "no such key"),
        ("[frontend]", "frontend", "no such key"),
        ("[extraction]\ntrim = 1", "extraction.trim", "no such key"),
        ("seed = -1", "seed", "greater than or equal to 0"),
        ("[map]\nmin_observations = 2.5", "map.min_observations", "integer"),
        ('[front_end]\nbirth_distance_m = "near"', "front_end.birth_distance_m", "number"),
        ("[front_end]\nbirth_distance_m = true", "front_end.birth_distance_m", "number"),
        ('[map]\nmin_observations = "3"', "map.min_observations", "integer"),
        ('[sensor.mounting]\nupside_down = "yes"', "sensor.mounting.upside_down", "boolean"),
        ("[odometry]\nposition_per_travel = 0", "odometry.position_per_travel", "greater than 0"),
        ('[sensor]\nmounting = "left"', "sensor.mounting", "expected a table"),
        ("odometry = 3", "odometry", "expected a table"),
        ("sensor = 3", "sensor", "expected a table"),
        ("[back_end]\ncauchy_scale = inf", "back_end.cauchy_scale", "finite"),
        ("[odometry]\nposition_per_travel = nan", "odometry.position_per_travel", "finite"),
        ("[front_end]\nmatch_probability = 1.0", "front_end.match_probability", "less than 1"),
        (
            "[front_end]\nmatch_probability = 0.999\nbirth_probability = 0.99",
            "front_end",
            "match_probability 0.999 must not exceed birth_probability 0.99",
        ),
        ("[sensor]\nrange_min_m = 90.0", "sensor", "range_min_m 90 must be below range_max_m 80"),
        ("[extraction]\ncorner_angle_min_deg = 160.0", "extraction", "corner_angle_min_deg"),
        ('[extraction]\ncovariance = "own"', "extraction.covariance", "'propagated' or 'paper'"),
        ('[sensor]\npreset = "hokuyo"', "sensor.preset", "unknown sensor preset 'hokuyo': known are"),
        ('[sensor]\npreset = ""', "sensor.preset", "unknown sensor preset ''"),
        ("[sensor]\npreset = 5", "sensor.preset", "expected the name of a sensor"),
        ('[sensor]\npreset = ["sick-lms"]', "sensor.preset", "expected the name of a sensor"),
    ],
)
def test_a_wrong_value_is_named_with_file_and_key(write, content, key, reason):
    path = write(content)
    with pytest.raises(ConfigError) as error:
        load_config(path)
    message = str(error.value)
    assert message.startswith(f"{path}: {key}: ")
    assert reason in message
    assert "\n" not in message


def test_a_source_without_odometry_is_run_on_its_lines(write):
    assert load_config(None).odometry.source == "line-aided"
    assert load_config(None, source=WITHOUT_ODOMETRY).odometry.source == "lines"
    path = write("[odometry]\nkey_frames = 7\n")
    odometry = load_config(path, source=WITHOUT_ODOMETRY).odometry
    assert (odometry.source, odometry.key_frames) == ("lines", 7)
    assert load_config(write('[odometry]\nsource = "lines"\n')).odometry.source == "lines"


@pytest.mark.parametrize("wanted", ["wheel", "line-aided"])
def test_wheels_that_are_not_there_are_an_error(write, wanted):
    path = write(f'[odometry]\nsource = "{wanted}"\n')
    assert load_config(path).odometry.source == wanted
    with pytest.raises(ConfigError) as raised:
        load_config(path, source=WITHOUT_ODOMETRY)
    assert str(raised.value) == (f'{path}: odometry.source is "{wanted}" but the log has no odometry: expected "lines"')


def test_a_preset_that_the_file_contradicts_is_an_error(write):
    path = write(OTHER)
    with pytest.raises(ConfigError, match=r"own\.toml: sensor\.preset is 'rplidar-s1' but .* 'sick-lms': drop one"):
        load_config(path, preset="sick-lms")
    assert load_config(path, preset="rplidar-s1").sensor.preset == "rplidar-s1"


def test_an_unknown_preset_that_was_asked_for_is_an_error_without_a_file():
    with pytest.raises(ConfigError, match=r"^sensor\.preset: unknown sensor preset 'x'"):
        load_config(None, preset="x")
    with pytest.raises(ValueError, match="unknown sensor preset"):
        SlamConfig.of_preset("x")


@pytest.mark.parametrize(
    ("content", "reason"),
    [("a = = 1", "not valid TOML"), ("seed = 1\nseed = 2", "not valid TOML"), (b"\x1f\x8b\xff\x00", "not a text file")],
)
def test_a_file_that_is_not_toml_is_named(write, content, reason):
    path = write(content)
    with pytest.raises(CwlfError) as error:
        load_config(path)
    assert str(error.value).startswith(f"{path}: {reason}")
    assert "\n" not in str(error.value)


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    for path in (tmp_path / "absent.toml", tmp_path):
        with pytest.raises(ConfigError, match="cannot be read") as error:
            load_config(path)
        assert str(error.value).startswith(f"{path}: ")


def test_a_configuration_cannot_be_changed():
    config = SlamConfig.of_preset("sick-lms")
    with pytest.raises(ValidationError, match="frozen"):
        config.seed = 4  # type: ignore[misc]


def test_the_noise_is_measured_unless_it_is_given(write):
    assert SlamConfig.of_preset("rplidar-s1").sensor.noise == "measured"
    assert load_config(write("[sensor]\nrange_max_m = 20.0")).sensor.noise == "measured"
    assert load_config(write("[sensor]\nsigma_range_mm = 33.0")).sensor.noise == "given"
    both = load_config(write('[sensor]\nsigma_range_mm = 33.0\nnoise = "measured"')).sensor
    assert (both.noise, both.sigma_range_mm) == ("measured", 33.0)
    with pytest.raises(ConfigError, match=r"sensor\.noise"):
        load_config(write('[sensor]\nnoise = "guessed"'))


def test_a_file_may_take_the_extraction_of_the_paper_and_change_it(write):
    config = load_config(write('[extraction]\npreset = "paper"\nmin_points = 7\n'), source=WITHOUT_ODOMETRY)
    assert (config.extraction.fit, config.extraction.tested, config.extraction.min_points) == ("cwlf", False, 7)
    assert load_config(write(to_toml(config)), source=WITHOUT_ODOMETRY) == config


def test_a_key_that_is_gone_is_left_out_with_a_warning(write):
    with pytest.warns(DeprecationWarning, match=r"extraction\.corner_gap_mm"):
        config = load_config(write("[extraction]\ncorner_gap_mm = 80.0\n"), source=WITHOUT_ODOMETRY)
    assert config == load_config(None, source=WITHOUT_ODOMETRY)
