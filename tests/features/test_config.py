"""The extraction's rules refuse what contradicts itself and name it."""

import pytest
from pydantic import ValidationError

from features import ExtractionConfig


def test_a_misspelt_key_is_refused_by_name():
    with pytest.raises(ValidationError, match="split_distanse_mm"):
        ExtractionConfig(split_distanse_mm=60.0)


def test_corner_angles_must_be_in_order():
    with pytest.raises(ValidationError, match="corner_angle_min_deg 120 must be below corner_angle_max_deg 60"):
        ExtractionConfig(corner_angle_min_deg=120.0, corner_angle_max_deg=60.0)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("fit", "york"),
        ("covariance", "arras"),
        ("jump_angle_deg", 0.0),
        ("jump_angle_deg", 90.0),
        ("gap_beams", 1.0),
        ("split_distance_mm", 0.0),
        ("split_sigmas", -0.1),
        ("trim_points", -1),
        ("trim_sigmas", -0.1),
        ("min_points", 1),
        ("min_length_m", 0.0),
        ("min_length_sigmas", 0.0),
        ("corner_angle_min_deg", 0.0),
        ("corner_angle_max_deg", 180.0),
        ("straight_level", 0.0),
        ("straight_level", 1.0),
        ("bend_sigmas", -0.1),
        ("near_sigmas", 0.0),
        ("end_sigmas", -0.1),
        ("corner_level", 0.0),
        ("corner_level", 1.0),
        ("unseen_end", -0.1),
        ("unseen_end", 1.0),
    ],
)
def test_a_value_without_meaning_is_refused_by_key(key, value):
    with pytest.raises(ValidationError, match=key):
        ExtractionConfig(**{key: value})


@pytest.mark.parametrize("fit", ["effective-variance", "arras-siegwart", "total-least-squares"])
def test_the_papers_covariance_belongs_to_its_fit_alone(fit):
    with pytest.raises(ValidationError, match=f"belongs to fit \"cwlf\", not to '{fit}'"):
        ExtractionConfig(fit=fit, covariance="paper")
    assert ExtractionConfig(fit="cwlf", covariance="paper").covariance == "paper"


def test_rules_cannot_be_changed_afterwards():
    with pytest.raises(ValidationError, match="frozen"):
        ExtractionConfig().min_points = 3


def test_a_rule_that_is_gone_is_dropped_with_a_warning():
    with pytest.warns(DeprecationWarning, match="corner_gap_mm is not used any more"):
        assert ExtractionConfig(**{"corner_gap_mm": 100.0}) == ExtractionConfig()


def test_the_preset_of_the_paper_sets_what_no_other_key_does() -> None:
    paper = ExtractionConfig(preset="paper")
    assert (paper.fit, paper.covariance, paper.tested) == ("cwlf", "paper", False)
    assert (paper.split_distance_mm, paper.split_sigmas, paper.trim_points, paper.trim_sigmas) == (50.0, 0.0, 0, 0.0)
    assert ExtractionConfig(preset="paper", split_distance_mm=30.0).split_distance_mm == 30.0
    assert ExtractionConfig.model_validate(paper.model_dump()) == paper


def test_a_copy_has_rules_of_its_own() -> None:
    config = ExtractionConfig()
    assert config.rules[2] == 0.05
    assert config.model_copy(update={"split_distance_mm": 30.0}).rules[2] == 0.03
    assert config.rules[2] == 0.05
