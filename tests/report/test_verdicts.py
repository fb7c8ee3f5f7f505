"""From where on a verdict of the report is good, cautious or bad."""

from dataclasses import replace

import pytest
from report_records import free_space, prediction

from davinci_forces.report.verdicts import Trust, band, band_in_words, grade, thresholds, verdict_words


def trust(error: float = 0.05, path: str = "another path", level: float = 0.3, sought: float | None = None) -> Trust:
    return Trust("roll", prediction(model_error=error, path=path), free_space(detection_level=level), sought)


@pytest.mark.parametrize(("error", "level"), [(0.1, "good"), (0.101, "warn"), (0.25, "warn"), (0.251, "bad")])
def test_without_an_effort_that_is_sought_the_model_error_over_the_effort_decides(error, level):
    assert trust(error).level == level


@pytest.mark.parametrize(("detection", "level"), [(0.333, "good"), (0.34, "warn"), (1.0, "warn"), (1.01, "bad")])
def test_where_an_effort_is_sought_the_detection_level_over_it_decides(detection, level):
    assert trust(error=10.0, level=detection, sought=1.0).level == level


def test_the_path_that_was_fitted_is_never_good_and_does_not_excuse_a_problem():
    assert trust(0.05, "same path").level == "warn"
    assert trust(0.5, "same path").level == "bad"
    assert trust(level=0.1, path="same path", sought=1.0).level == "warn"


def test_what_is_not_known_calls_for_caution():
    assert Trust("roll", None, None, None).level == "warn"
    assert Trust("roll", None, None, 1.0).level == "warn"
    assert replace(trust(), prediction=prediction(effort_rms=0.0)).level == "warn"
    assert grade(float("nan"), 0.1, 0.2) == "warn"


@pytest.mark.parametrize("level", ["good", "warn", "bad"])
@pytest.mark.parametrize("same_path", [False, True])
@pytest.mark.parametrize("narrow", [False, True])
def test_good_never_stands_beside_a_caveat(level, same_path, narrow):
    words = verdict_words(level, same_path and level != "good", narrow)
    assert ("Good" in words) == (level == "good" and not narrow)
    assert ("same path" in words) == (same_path and level != "good")


def test_a_joint_whose_band_is_too_narrow_is_not_called_good_and_keeps_its_level():
    narrow = replace(trust(), space=free_space(coverage=0.5))
    right = replace(trust(), space=free_space(coverage=0.95))
    assert narrow.level == right.level == "good"
    assert "narrow band" in narrow.words
    assert "Good" not in narrow.words
    assert "Good" in right.words


@pytest.mark.parametrize(
    ("coverage", "level", "said"),
    [(0.57, "bad", "too narrow"), (0.9, "good", "right"), (0.98, "good", "right"), (0.99, "info", "too wide")],
)
def test_a_band_is_right_where_it_covers_what_it_says(coverage, level, said):
    assert (band(coverage), band_in_words(coverage)) == (level, said)


def test_the_table_of_thresholds_says_what_the_verdicts_do():
    said = " ".join(str(cell) for row in thresholds() for cell in row)
    for threshold in ("10 %", "25 %", "33 %", "100 %", "90 % to 98 %"):
        assert threshold in said
