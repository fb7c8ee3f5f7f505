"""What the data tell of parameters, and whom messages blame for an inertia that is not positive."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.estimators import estimator
from davinci_forces.estimators.problem import Estimate, StandardErrors, factorise
from davinci_forces.identification.identifiability import (
    advice,
    describe_correlated,
    describe_insignificant,
    excite_command,
    hardly_described,
    moving_with,
    why_not_positive,
)
from davinci_forces.maths.estimation import least_squares
from davinci_forces.maths.estimation.least_squares import (
    analyse_columns,
    correlated_pairs,
    std_of_sum,
    triangle,
    uncertain_combinations,
)
from davinci_forces.records import Diagnostic, Identifiability, Spectrum
from davinci_forces.records.catalogue import Catalogue
from davinci_forces.report.sections.joints import unidentified_parameters
from davinci_forces.robots.davinci import ROBOT
from davinci_forces.robots.robot import UNLIMITED
from davinci_forces.stages.model import fit
from tests import arm
from tests.contracts.test_estimators import NAMES, PHI, SIGMA, THETA, K, M, problem
from tests.test_estimation import trajectory

ROLL = arm.joint("hand_roll")


def test_a_command_that_needs_limits_says_so_where_a_robot_s_file_states_none():
    joint = ROBOT.joints[0]
    first_unlimited = (replace(joint, limits=UNLIMITED), *ROBOT.joints[1:])
    filed = replace(ROBOT, file="my.toml", joints=first_unlimited)
    lacking = " in the study's folder (once my.toml states limits of q and dq)"
    for name, more in ((joint.name, lacking), ("all", lacking), (ROBOT.joints[1].name, " in the study's folder")):
        assert excite_command(filed, name) == f"`davinci-forces excite my.toml {name}`{more}"
    assert excite_command(ROBOT, "all") == "`davinci-forces excite davinci all`"


def of(Phi: np.ndarray):
    return analyse_columns(triangle(Phi, PHI @ THETA, np.ones(len(Phi))))


def test_the_correlation_of_parameters_is_that_of_their_errors():
    found = analyse_columns(factorise(problem(seed=0), np.full(K, float(M))))
    thetas = np.array([estimator("lse")(problem(seed)).theta for seed in range(1000)])
    assert_allclose(found.correlation, np.corrcoef(thetas.T), atol=4 / np.sqrt(1000))
    assert_allclose(np.diag(found.correlation), 1.0, rtol=1e-12)


def test_the_condition_is_that_of_scaled_columns_whatever_their_units():
    assert of(PHI * [1e6, 1.0, 1e-6, 1.0]).condition == pytest.approx(of(PHI).condition, rel=1e-9)
    assert of(PHI).condition == pytest.approx(np.linalg.cond(PHI / np.linalg.norm(PHI, axis=0)), rel=1e-9)


def test_the_deviation_of_a_sum_of_parameters_is_that_of_its_errors():
    weights, seeds = np.array([1.0, 2.0, 0.0, -1.0]), 2000
    found = analyse_columns(factorise(problem(seed=0), np.full(K, float(M))))
    std = SIGMA / np.sqrt(M) * np.sqrt(np.diag(np.linalg.inv(PHI.T @ PHI)))
    sums = [estimator("lse")(problem(seed)).theta @ weights for seed in range(seeds)]
    assert std_of_sum(found.correlation, std, weights) == pytest.approx(np.std(sums), rel=4 / np.sqrt(2 * seeds))


def test_parameters_that_move_together_are_named_with_their_correlation():
    near = np.column_stack([PHI, PHI[:, 1] * (1 + 0.1 * np.random.default_rng(0).normal(size=K))])
    found = of(near)
    ((i, j, r),) = correlated_pairs(found, 0.95)
    assert (i, j) == (1, 4)
    names = [*NAMES, "gravity, cosine"]
    assert f'the estimates of "gravity, sine" and "gravity, cosine" are correlated: {r:.2f}' in describe_correlated(
        names, found
    )
    assert describe_correlated(NAMES, of(PHI)) == []


def test_a_combination_of_three_is_named_where_no_two_of_them_are_alike():
    sum_of_three = PHI[:, 0] / np.linalg.norm(PHI[:, 0]) + PHI[:, 2] / np.linalg.norm(PHI[:, 2])
    random = np.random.default_rng(0)
    found = of(np.column_stack([PHI, sum_of_three + 1e-3 * random.normal(size=K)]))
    ((members, ratio),) = uncertain_combinations(found, 20.0, 0.1)
    assert members == (0, 2, 4)
    assert ratio == pytest.approx(found.condition)


def test_a_combination_of_two_is_named_unless_they_are_a_reported_pair_or_one_alone(monkeypatch):
    combinations = [((0, 1), 30.0), ((1, 2), 40.0), ((3,), 50.0)]
    monkeypatch.setattr(least_squares, "correlated_pairs", lambda *given: [(1, 2, 0.97)])
    monkeypatch.setattr(least_squares, "uncertain_combinations", lambda *given: combinations)
    pair, combination = describe_correlated(list("abcd"), of(PHI))
    assert pair == "the estimates of b and c are correlated: 0.97"
    assert combination.startswith("one combination of a and b is 30 times less certain")


def test_a_parameter_that_cannot_be_told_from_zero_is_not_seen_and_its_share_is_bounded():
    """Gravity, of which there is none."""
    p = problem(seed=0)
    p = replace(p, tau=p.tau - PHI[:, 1] * THETA[1])
    found = estimator("lse")(p)
    (said,) = [text for text in describe_insignificant(p, found) if text.startswith("gravity, sine")]
    most = (abs(found.theta[1]) + 2 * found.theta_std[1]) * np.linalg.norm(PHI[:, 1]) / np.linalg.norm(p.tau)
    assert said.endswith(f"at most {100 * most:.2g} % of the effort")
    assert describe_insignificant(problem(), estimator("lse")(problem())) == []


@pytest.mark.parametrize(("ratio", "is_named"), [(1.9, True), (-1.9, True), (2.1, False)])
def test_a_parameter_is_told_from_zero_at_two_standard_errors(ratio, is_named):
    share = " at most 100 % of the effort"  # never more, however large the error is
    texts = describe_insignificant(problem(seed=0), guess([ratio * 1e3, *[1e3] * 3], [1e3, 1.0, 1.0, 1.0]))
    assert [text.endswith(share) for text in texts] == [True] * is_named


@pytest.mark.parametrize(("noise", "is_named"), [(0.15, True), (0.18, False)])
def test_a_combination_is_named_that_is_twenty_times_less_certain_than_the_best(noise, is_named):
    sum_of_three = PHI[:, 0] / np.linalg.norm(PHI[:, 0]) + PHI[:, 2] / np.linalg.norm(PHI[:, 2])
    found = of(np.column_stack([PHI, sum_of_three + noise / np.sqrt(K) * np.random.default_rng(0).normal(size=K)]))
    assert (20.0 < found.condition < 28.0) if is_named else (15.0 < found.condition < 20.0)
    texts = [text for text in describe_correlated([*NAMES, "sum"], found) if "less certain" in text]
    assert [text.split(" is ")[1][:9] for text in texts] == [f"{found.condition:.0f} times "] * is_named


def test_advice_is_a_command_for_that_joint_and_only_where_something_is_wanting():
    assert advice(ROBOT, ROBOT.joint("hand_pitch"), ()) == ""
    assert "`davinci-forces excite davinci hand_pitch`" in advice(
        ROBOT, ROBOT.joint("hand_pitch"), ("x is not significant",)
    )
    assert "`davinci-forces excite arm.toml hand_roll` in the study's folder designs" in advice(
        arm.ARM, ROLL, ("x is not significant",)
    )


def guess(theta, std) -> Estimate:
    std = np.array(std)
    return Estimate(np.array(theta), lambda: StandardErrors(std, std, 0.0 * std, 0.0))


def blamed(theta, std, others=()) -> str:
    return why_not_positive(arm.ARM, ROLL, guess(theta, std), of(PHI), others)


def test_an_inertia_that_was_not_excited_is_not_blamed_on_signs():
    said = blamed([-0.07, 0.01, 0.37, 0.22], [0.25, 0.01, 0.01, 0.01])
    assert "-0.07 ± 0.2 kg m^2 cannot be distinguished from 0, because the motion hardly excites it" in said
    assert "with larger accelerations: `davinci-forces excite arm.toml hand_roll`" in said
    assert "sign" not in said


def test_an_effort_against_the_motion_is_blamed_on_a_sign():
    said = blamed([-0.45, 0.01, -0.37, -0.22], [0.01] * 4)
    assert "and friction is negative, too" in said
    assert "correct the `sign`" in said
    assert "correct the `sign`" in blamed([-0.07, 0.01, -0.37, -0.22], [0.25, 0.01, 0.01, 0.01])  # hardly excited, too


def test_a_sign_is_blamed_on_half_of_the_friction_if_that_is_surely_negative():
    assert "correct the `sign`" in blamed([-0.45, 0.01, -0.37, 0.22], [0.01] * 4)
    assert "friction is not negative" in blamed([-0.45, 0.01, -0.37, -0.22], [0.01, 0.01, 0.19, 0.12])
    assert "correct the `sign`" in blamed([-0.45, 0.01, -0.37, 0.22], [0.23, 0.01, 0.01, 0.01])
    assert "cannot be distinguished from 0" in blamed([-0.45, 0.01, 0.37, 0.22], [0.23, 0.01, 0.01, 0.01])


def test_an_inertia_that_is_negative_alone_is_blamed_on_what_the_model_leaves_out():
    said = blamed([-0.45, 0.01, 0.37, 0.22], [0.01] * 4)
    assert "the signs are right" in said
    assert "logged at different times" in said
    coupled = blamed([-0.45, 0.01, 0.37, 0.22], [0.01] * 4, ["pan", "lift"])
    assert "leaves out the effects of pan and lift in the same logs" in coupled
    assert "record the joint by itself" in coupled


def test_an_effort_that_its_own_terms_do_not_describe_is_said_to_be_one():
    assert hardly_described(ROLL, 0.51, ["pan"]) == ""
    assert "explain 49 % of" in hardly_described(ROLL, 0.49, ["pan"])
    assert "explain 0 % of" in hardly_described(ROLL, -3.0, [])
    assert "pan moves in the same logs" in hardly_described(ROLL, 0.26, ["pan"])
    assert "explain 26 % of the effort's variance: check" in hardly_described(ROLL, 0.26, [])


def test_a_fit_to_a_motion_that_lacks_a_large_harmonic_does_not_blame_the_channels():
    signal = arm.signal("hand_roll")
    noise = replace(signal, tau=np.random.default_rng(0).normal(size=len(signal.tau)))
    for share, is_blamed in ((0.35, False), (0.02, True)):
        cut = Spectrum(signal.log, "hand_roll", 2, np.arange(4.0), np.array([0.0, 1.0, 0.5, share]))
        other = replace(cut, joint="hand_pitch", amplitude=np.array([0.0, 1.0, 0.5, 0.9]))
        records = fit.run([trajectory(noise)], [], arm.ARM, [cut, other], lowpass=17.0)
        texts = [text for record in records if isinstance(record, Diagnostic) for text in record.text]
        assert any("are channels of one joint" in text for text in texts) == is_blamed


def test_only_joints_that_move_in_the_same_logs_are_others():
    moves = [("one", "roll"), ("one", "pan"), ("two", "pan"), ("two", "lift"), ("three", "slide")]
    assert moving_with("roll", ["one", "two"], moves) == ["pan", "lift"]


def made(signal, kind) -> list:
    return [record for record in fit.run([trajectory(signal)], [], arm.ARM, lowpass=17.0) if isinstance(record, kind)]


def test_a_fit_comes_with_what_its_data_tell():
    (found,) = made(arm.signal("hand_pitch"), Identifiability)
    names = [term.name for term in arm.joint("hand_pitch").terms]
    assert found.parameter.tolist() == [name for name in names for _ in names]
    assert found.beside.tolist() == names * len(names)
    assert found.scaled_condition > 1.0
    keys = {p.key: p for p in found.published()}
    assert len(keys) == 1 + len(names) * (len(names) - 1) // 2
    row = keys["correlation.hand_pitch.independent.inertia.gravity_sine"].row
    assert (found.parameter[row], found.beside[row]) == ("inertia", "gravity, sine")


def test_the_report_says_what_is_wanting_and_what_to_record_next():
    def about(**changes):
        (found,) = made(arm.signal("hand_pitch"), Identifiability)
        told = replace(found, **{"together": (), "not_seen": (), "advice": "", **changes})
        return list(
            unidentified_parameters(SimpleNamespace(catalogue=Catalogue(lambda kind: [told])), "hand_pitch", True)
        )

    assert about() == []
    insignificant = "inertia is not significant: 0.1 ± 0.2"
    (said,) = about(not_seen=(insignificant,), advice="`davinci-forces excite a b` designs a motion")
    assert said.text == "Inertia is not significant: 0.1 ± 0.2. `davinci-forces excite a b` designs a motion."


def test_effort_of_the_wrong_sign_is_said_once_for_all_estimators():
    signal = arm.signal("hand_roll")
    said = [(*d.severity, *d.text) for d in made(replace(signal, tau=-signal.tau), Diagnostic)]
    ((severity, wrong),) = [each for each in said if "not positive" in each[-1]]
    assert (
        severity == "note"
    )  # `predict` warns of it if this model is used, and the joint's page shows it beside the fits
    assert wrong.startswith("hand_roll: lse, wlse,")
    assert "the effort opposes the motion" in wrong


def test_a_parameter_that_only_the_model_makes_uncertain_is_seen():
    """Its noise excludes zero, and so do the data; another model would change it."""
    small, large = 0.1 * np.abs(THETA), 10.0 * np.abs(THETA)
    by_model, by_noise = (
        Estimate(THETA, lambda noise=noise, model=model: StandardErrors(small, noise, model, 0.0))
        for noise, model in ((small, large), (large, small))
    )
    assert describe_insignificant(problem(), by_model) == []
    assert len(describe_insignificant(problem(), by_noise)) == len(THETA)
