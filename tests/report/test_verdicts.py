"""From where on a verdict of the report is good, cautious or bad."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from report_records import free_space, prediction, stiffness, weight

from davinci_forces.maths.periods.shift import SAME_PATH
from davinci_forces.records import PathShare, TorqueConstant, Weight
from davinci_forces.records.catalogue import Catalogue
from davinci_forces.report import verdicts
from davinci_forces.report.context import name_in_sentence
from davinci_forces.report.sections.parts import grade_of_mass
from davinci_forces.report.sections.summary import caveats
from davinci_forces.report.sections.summary.opening import verdict_sentence
from davinci_forces.report.verdicts import (
    Trust,
    band,
    band_in_words,
    decisive,
    doubt_of_mass,
    grade,
    is_impossible,
    is_mostly_constant,
    mass_level,
    percent,
    stiffness_level,
    thresholds,
    truth_level,
    verdict_words,
)


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
    assert replace(trust(error=0.01), space=None).level == "warn"  # it has no effort that could be good
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
    assert narrow.words.replace("\N{NO-BREAK SPACE}", " ") == "▲ Narrow band"  # two words leave page one a line a joint
    assert narrow.words[0] == verdicts.WORDS["warn"][0]
    assert "Good" not in narrow.words
    assert "Good" in right.words


@pytest.mark.parametrize(
    ("coverage", "level", "said"),
    [
        (0.57, "bad", "too narrow"),
        (0.9, "good", "wide enough"),
        (0.98, "good", "wide enough"),
        (0.99, "info", "too wide"),
    ],
)
def test_a_band_is_right_where_it_covers_what_it_says(coverage, level, said):
    assert (band(coverage), band_in_words(coverage)) == (level, said)
    assert band_in_words(coverage, 0.06) == (said if said != "too wide" else "wide enough")


@pytest.mark.parametrize(("mean", "std", "named"), [(0.6, 0.0, False), (-0.8, 0.1, True), (0.8, 0.3, False)])
def test_the_constant_part_of_an_error_is_named_where_it_is_most_of_it_and_certain(mean, std, named):
    assert is_mostly_constant(prediction(model_error=1.0, mean_error=mean, mean_error_std=std)) == named


# The run that decides


def test_a_path_is_new_to_the_report_where_it_is_new_to_the_stages():
    assert pytest.approx(1.0 - SAME_PATH**2) == verdicts.MIN_NEW_PATH


def path_share(log, path_new=1.0, moving=1.0):
    return PathShare(log, "roll", "identification", path_new, moving, 1.0, 0.0)


def by_blocks(log="one", error=0.05):
    return prediction(log=log, role="identification", scheme="leave a block of path out", model_error=error)


def by_log(log="one", error=0.2):
    return prediction(log=log, role="identification", scheme="leave one log out", model_error=error)


def level_of(predictions, shares):
    run, about = decisive(predictions, shares)
    return Trust("roll", run, free_space(), None, about)


def test_a_whole_log_left_out_decides_and_not_its_blocks_of_path():
    shares = [path_share("one"), path_share("two")]
    both = level_of([by_blocks("one"), by_blocks("two"), by_log("one", 0.15), by_log("two", 0.2)], shares)
    assert (both.level, both.prediction.model_error, both.new_path) == ("warn", 0.2, "100 %")
    worse = level_of([by_blocks("one", 0.3), by_log("one", 0.05), by_log("two", 0.05)], shares)
    assert (worse.level, worse.prediction.model_error) == ("good", 0.05)
    alone = level_of([by_blocks()], shares[:1])
    assert (alone.level, alone.new_path) == ("good", "–")  # a single log has no other


def test_the_worst_of_alike_runs_has_the_largest_error_whatever_its_effort():
    large, slow = prediction(log="one", model_error=0.3, effort_rms=5.0), prediction(log="two", model_error=0.2)
    for given in ([large, slow], [slow, large]):
        chosen = level_of(given, [])
        assert (chosen.prediction.log, chosen.level) == ("one", "good")


def test_a_log_left_out_whose_path_other_logs_repeat_is_not_good_whatever_its_scheme_says():
    same = level_of([by_log(error=0.05)], [path_share("one", path_new=0.02)])
    assert (same.level, same.words, same.new_path) == ("warn", "▲\N{NO-BREAK SPACE}Caution, same path", "2 %")
    assert level_of([by_log(error=0.05)], [path_share("one", path_new=0.5)]).level == "good"


def test_the_role_of_a_log_turns_no_verdict():
    """A log judged as validation log, or left out of two identification logs, gets the same verdict."""
    shares = [path_share("one"), path_share("two")]
    validation = level_of([by_blocks("one"), prediction(log="two", model_error=0.14)], shares)
    left_out = level_of([by_blocks("one"), by_blocks("two"), by_log("one", 0.1), by_log("two", 0.14)], shares)
    assert validation.level == left_out.level == "warn"


def test_a_validation_log_on_the_fitted_path_says_less_than_a_log_left_out_on_a_new_one():
    shares = [path_share("one"), path_share("two"), path_share("check", path_new=0.0)]
    decided = level_of([by_log("one", 0.06), by_log("two", 0.08), prediction(log="check", model_error=0.01)], shares)
    assert (decided.level, decided.prediction.log) == ("good", "two")


def test_a_joint_at_rest_is_no_problem_and_does_not_decide_where_another_run_moves():
    rest = prediction(log="rest", model_error=3.0)
    shares = [path_share("rest", moving=0.1), path_share("move")]
    assert level_of([rest, prediction(log="move")], shares).prediction.log == "move"
    alone = level_of([rest], shares)
    assert (alone.level, alone.words) == ("warn", "▲\N{NO-BREAK SPACE}Caution, at rest")
    assert level_of([prediction(log="move", model_error=3.0)], shares).level == "bad"


# Masses, stiffnesses, parameters


@pytest.mark.parametrize(
    ("mass", "std", "stated", "level"),
    [
        (0.058, 0.030, 0.097, "warn"),  # its interval contains the stated mass, and zero
        (0.095, 0.005, 0.097, "good"),
        (0.080, 0.005, 0.097, "warn"),
        (0.0979, 0.0001, 0.097, "good"),  # no torque constant is known to a hundredth
        (0.0981, 0.0001, 0.097, "warn"),
        (0.080, 0.005, float("nan"), "info"),
    ],
)
def test_a_mass_is_good_where_a_narrow_interval_contains_it(mass, std, stated, level):
    assert mass_level(weight(mass=mass, mass_std=std, stated_mass=stated), [])[0] == level
    exact = {"mass": 0.097, "mass_std": 0.001, "stated_mass": 0.097}
    assert mass_level(weight(**exact, side="the other one"), []) == ("warn", "side")
    assert mass_level(weight(**exact, differing="roll"), []) == ("warn", "joints")
    for known in (0.097, float("nan")):
        assert mass_level(weight(mass=-0.09, mass_std=0.04, stated_mass=known), []) == ("warn", "sign")


@pytest.mark.parametrize(
    ("agreement", "side", "told"),
    [(0.015, "as stated", " (its joints agree poorly: p-value 0.015)"), (0.06, "as stated", ""),
     (1e-5, "as stated", " (its joints agree poorly: p-value < 0.001)"), (0.015, "the other one", "")],
)  # fmt: skip
def test_joints_that_agree_poorly_on_a_mass_are_told_of(agreement, side, told):
    assert doubt_of_mass(weight(agreement=agreement, side=side)) == told


@pytest.mark.parametrize(
    ("used", "log", "why"),
    [
        (12.64, "run", "taken"),
        (12.643, "run", "taken"),
        (12.63, "run", "right"),
        (12.6, "run", "right"),
        (12.64, "b", "right"),
    ],
)
def test_a_mass_does_not_test_the_torque_constant_that_its_own_log_gave(used, log, why):
    constant = TorqueConstant(log, "lift", 0.5, used, 12.643, 0.17)
    assert mass_level(weight(mass=0.5, mass_std=0.004, stated_mass=0.5), [constant])[1] == why


@pytest.mark.parametrize(("changed", "why"), [({}, "right"), ({"lift": {"gear_ratio": 3.0}}, "right"),
                                             ({"lift": {"torque_constant": 12.64}}, "taken")])  # fmt: skip
def test_only_a_torque_constant_that_the_study_states_can_be_of_the_mass_s_own_log(changed, why):
    constant = TorqueConstant("run", "lift", 0.5, 12.64, 12.643, 0.17)
    catalogue = Catalogue(lambda kind: [constant] if kind is TorqueConstant else [])
    context = SimpleNamespace(catalogue=catalogue, study=SimpleNamespace(changed=changed))
    assert grade_of_mass(context, weight(mass=0.5, mass_std=0.004, stated_mass=0.5))[1] == why


@pytest.mark.parametrize(
    ("mass", "size"), [(0.103, "3 % too large, by 3.0"), (0.1015, ""), (53.6, "536 times too large, by 53500.0")]
)
def test_a_mass_that_differs_from_the_stated_one_is_to_be_looked_at_first(mass, size):
    of = weight(log="hung", mass=mass, mass_std=0.001, stated_mass=0.1)
    context = SimpleNamespace(catalogue=Catalogue(lambda kind: [of] if kind is Weight else []))
    told = [text for _, text in caveats.looks_at_masses(context)]
    assert told == [f"**hung**: the mass is estimated {size} standard errors. See [@weight]."] * bool(size)


def test_a_negative_mass_is_to_be_looked_at_before_all_that_it_spoils():
    of = weight(log="hung", mass=-0.103, mass_std=0.001, stated_mass=0.1)
    context = SimpleNamespace(catalogue=Catalogue(lambda kind: [of] if kind is Weight else []))
    [(first, text)] = caveats.looks_at_masses(context)
    assert first == caveats.FIRST
    assert text == "**hung**: the mass is negative, so a direction is reversed. See [@weight]."


def test_of_motions_faster_or_farther_than_all_fitted_ones_the_most_extreme_is_to_be_looked_at():
    known = {"slow": (1.45, 0.05), "unknown": (np.nan, np.nan), "fast": (1.6, 0.0), "most": (3.1, 0.23)}
    shares = [replace(path_share(log), speed_ratio=ratio, outside=out) for log, (ratio, out) in known.items()]
    fastest = "**Roll, most**: it moves 3.1 times as fast as in any fitted log"
    farthest = "**Roll, most**: 23 % of its samples are beyond all fitted positions by more than 5 % of their range"
    for count, expected in ((2, []), (4, [fastest, farthest])):
        context = SimpleNamespace(catalogue=Catalogue(lambda kind, n=count: shares[:n] if kind is PathShare else []))
        looks = [text.partition(", so ")[0] for _, text in caveats.looks_at_reach(context, ["roll"])]
        assert looks == expected
        assert not [*caveats.looks_at_reach(context, ["pitch"])]


@pytest.mark.parametrize(("used", "level"), [(72, "warn"), (180, "good"), (359, "good"), (1, "warn"), (0, "bad")])
def test_a_stiffness_of_a_minority_of_pushes_is_not_good(used, level):
    """72 of 359 pushes count: the median is of the few that a straight line fits."""
    assert stiffness_level(stiffness(359, pushes=used, stiffness=320.6, stiffness_std=5.8)) == level


def test_a_share_that_is_not_zero_is_not_printed_as_zero():
    shares = {0.0: "0 %", 0.004: "< 1 %", 0.006: "1 %", -0.001: "0 %", 1.0: "100 %", float("nan"): "–"}
    assert {share: percent(share) for share in shares} == shares


def test_a_negative_mass_within_its_error_of_zero_is_not_impossible():
    assert not is_impossible(-0.0045, 0.02)
    assert is_impossible(-0.0045, 0.002)


def test_estimates_against_truth_pass_as_95_percent_intervals_do_and_can_fail():
    """Three of five within four standard errors would pass; of 14, three beyond two standard errors are too many."""
    right = [0.1, 0.3, 0.5, 0.6, 0.8, 0.9, 1.1, 1.2, 1.3, 1.6, 1.9, 0.2, 0.7, 2.1]
    assert truth_level(right) == ("good", "8 within 1, 13 within 2, 14 within 4 standard errors")
    beyond = [*right[:10], 2.5, 3.0, 3.3, 3.9]
    assert truth_level(beyond)[0] == "bad"
    assert truth_level([*right[:-1], 6.0])[0] == "bad"
    assert truth_level([0.1] * 14)[0] == "info"  # intervals so wide that nothing could miss them
    rng = np.random.default_rng(0)
    draws = [truth_level(np.abs(rng.normal(size=14)).tolist())[0] for _ in range(2000)]
    assert draws.count("bad") / len(draws) < 0.02
    assert draws.count("info") / len(draws) < 0.02


def test_the_table_of_thresholds_says_what_the_verdicts_do():
    said = " ".join(str(cell) for row in thresholds() for cell in row)
    for threshold in ("10 %", "25 %", "33 %", "100 %", "90 % to 98 %"):
        assert threshold in said


def test_a_numbered_joint_has_no_article_in_a_sentence():
    assert name_in_sentence("hand_roll") == "the hand roll"
    assert name_in_sentence("joint_1") == "joint 1"
    narrow = [replace(trust(error=0.5), joint=name, space=free_space(coverage=0.3)) for name in ("pan", "lift")]
    assert "the 95 % band is too narrow on the pan and lift" in verdict_sentence(None, narrow)


def test_bands_are_not_called_right_where_none_was_judged():
    unjudged = replace(trust(error=0.5), space=None)
    assert verdict_sentence(None, [unjudged]) == "No effort was estimated in free space on the roll."
    for role, where in (("identification", "in free motion the"), ("validation", "that was not fitted, the")):
        space = replace(free_space(coverage=0.95), role=role)
        assert f"{where} 95 % band of each joint is wide enough" in verdict_sentence(
            None, [replace(unjudged, space=space)]
        )
