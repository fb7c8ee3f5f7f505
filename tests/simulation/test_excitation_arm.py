"""All joints together: what the criterion is of, and that the trajectories are better than the joints' own."""

from dataclasses import replace

import numpy as np
import pytest

from davinci_forces.maths.excitation.arm import ArmExcitationProblem, arm_observation, arm_problem, design_together
from davinci_forces.maths.excitation.fourier import Fourier, determinant, instants, motion
from davinci_forces.maths.excitation.joint import ExcitationProblem, design
from davinci_forces.maths.mechanics.rigid_body import inverse_dynamics
from davinci_forces.robots.davinci import ROBOT

LIMITS = {joint.name: (joint.limits.q, joint.limits.dq, joint.limits.ddq) for joint in ROBOT.joints}


@pytest.fixture(scope="module")
def arm() -> ArmExcitationProblem:
    joints = [ExcitationProblem(joint.terms, LIMITS[joint.name], 8.0, 2, samples=60) for joint in ROBOT.joints]
    return arm_problem(ROBOT.chain, joints)


def series(seed: int) -> list[Fourier]:
    x = np.random.default_rng(seed).uniform(-0.1, 0.1, (3, 5))
    return [Fourier.from_coefficients(each, 8.0) for each in x]


def test_the_base_columns_explain_the_efforts_of_links_rotors_and_friction(arm):
    F = arm_observation(arm, series(1))
    t = instants(8.0, 60)
    q, dq, ddq = (np.column_stack(columns) for columns in zip(*(motion(s, t) for s in series(1)), strict=True))
    tau = inverse_dynamics(ROBOT.chain, ROBOT.bodies, q, dq, ddq)
    tau += 0.1 * ddq + np.array([0.3, 0.9, 3.0]) * dq + np.array([0.2, 0.4, 4.0]) * np.sign(dq)
    residual = tau.ravel() - F @ np.linalg.lstsq(F, tau.ravel(), rcond=None)[0]
    assert np.abs(residual).max() < 1e-9 * np.abs(tau).max()


def test_no_base_column_can_be_left_out(arm):
    assert np.isfinite(determinant(arm_observation(arm, series(2))))


@pytest.mark.slow
def test_trajectories_for_the_arm_are_better_for_it_than_the_joints_own_and_keep_every_limit(arm):
    own = [design(joint, 4, 0)[0] for joint in arm.joints]
    heard = []
    together, optima = design_together(arm, 2, 0, lambda *start: heard.append(start))
    assert determinant(arm_observation(arm, together)) < determinant(arm_observation(arm, own)) - 0.3
    assert determinant(arm_observation(arm, together)) == pytest.approx(optima.min(), abs=1e-5)
    assert heard == [(1, 2, optima[0]), (2, 2, optima[1])]
    for joint, one in zip(arm.joints, together, strict=True):
        for values, (low, high) in zip(motion(one, instants(8.0, 100_000)), joint.limits, strict=True):
            assert low <= values.min()
            assert values.max() <= high


def test_limits_that_an_arm_cannot_keep_are_refused(arm):
    impossible = replace(arm, joints=(arm.joints[0], replace(arm.joints[1], limits=((-1, 1), (0.1, 0.5), (-1, 1)))))
    with pytest.raises(ValueError, match="velocity"):
        design_together(impossible, 1, 0)
