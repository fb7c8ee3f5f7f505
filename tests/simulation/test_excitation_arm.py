"""All joints together: what the criterion is of, and that the trajectories are better than the joints' own."""

import numpy as np
import pytest

from pipeline.maths.excitation.arm import ArmExcitationProblem, arm_observation, arm_problem, design_together
from pipeline.maths.excitation.arm import _cost as cost
from pipeline.maths.excitation.fourier import Fourier, determinant, instants, motion
from pipeline.maths.excitation.joint import ExcitationProblem, design
from pipeline.maths.mechanics.rigid_body import inverse_dynamics
from pipeline.robots.davinci import ROBOT

LIMITS = {joint.name: (joint.limits.q, joint.limits.dq, joint.limits.ddq) for joint in ROBOT.joints}


@pytest.fixture(scope="module")
def arm() -> ArmExcitationProblem:
    joints = [ExcitationProblem(joint.terms, LIMITS[joint.name], 8.0, 2, samples=60) for joint in ROBOT.joints]
    return arm_problem(ROBOT.chain, joints)


def series(seed: int) -> list[Fourier]:
    x = np.random.default_rng(seed).uniform(-0.1, 0.1, (3, 5))
    return [Fourier.of(each, 8.0) for each in x]


def test_the_base_columns_explain_the_efforts_of_links_rotors_and_friction(arm):
    F = arm_observation(arm, series(1))
    t = instants(8.0, 60)
    q, dq, ddq = (np.column_stack(columns) for columns in zip(*(motion(s, t) for s in series(1)), strict=True))
    tau = inverse_dynamics(ROBOT.chain, ROBOT.bodies, q, dq, ddq)
    tau += 0.1 * ddq + np.array([0.3, 0.9, 3.0]) * dq + np.array([0.2, 0.4, 4.0]) * np.sign(dq)
    residual = tau.ravel() - F @ np.linalg.lstsq(F, tau.ravel(), rcond=None)[0]
    assert np.abs(residual).max() < 1e-9 * np.abs(tau).max()


def test_no_base_column_can_be_left_out(arm):
    assert np.isfinite(determinant(arm_observation(arm, series(2)))[0])


def test_the_gradient_of_the_criterion_is_its_finite_difference(arm):
    x = np.concatenate([s.x for s in series(3)])
    direction, h = np.random.default_rng(3).normal(size=len(x)), 1e-6
    slope = (cost(arm, x + h * direction)[0] - cost(arm, x - h * direction)[0]) / (2 * h)
    assert cost(arm, x)[1] @ direction == pytest.approx(slope, rel=1e-4)


def test_a_sample_at_rest_does_not_spoil_the_gradient_with_frictions_jump(arm):
    at_rest_first = np.array([[0.0, 0.0, 0.2, 0.0, 0.1]] * 3)  # dq = b_k sin is 0 in the first sample, ...
    just_later = at_rest_first + np.array([0.0, 1e-5, 0.0, 1e-5, 0.0])  # ... and not quite here
    gradients = [cost(arm, x.ravel())[1] for x in (at_rest_first, just_later)]
    # the criterion does change with that sample's friction, by some twenty; a jump over a step of 1e-7 makes thousands
    assert np.abs(gradients[0] - gradients[1]).max() < 100


@pytest.mark.slow
def test_trajectories_for_the_arm_are_better_for_it_than_the_joints_own_and_keep_every_limit(arm):
    own = [design(joint, 4, 0) for joint in arm.joints]
    together = design_together(arm, 1, 0)
    assert determinant(arm_observation(arm, together))[0] < determinant(arm_observation(arm, own))[0] - 0.3
    for joint, one in zip(arm.joints, together, strict=True):
        for values, (low, high) in zip(motion(one, instants(8.0, 10_000)), joint.limits, strict=True):
            assert low <= values.min()
            assert values.max() <= high
