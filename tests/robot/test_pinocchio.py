"""The same numbers from Pinocchio, where it is installed; `test_rigid_body` has a check that needs nothing."""

import numpy as np
import pytest

from davinci_forces.maths.mechanics import kinematics, rigid_body
from davinci_forces.robots.davinci import BODIES, CHAIN
from tests.robot.pinocchio_arm import tree

pin = pytest.importorskip("pinocchio", reason="Pinocchio is not installed: a rival of benchmarks, not a dependency")


@pytest.mark.parametrize("n", [3, 6, 7])
def test_pinocchio_finds_the_same_kinematics_and_dynamics_at_100_random_motions(n):
    arm = tree(pin, CHAIN, BODIES, n)
    motions = np.random.default_rng(n).uniform(-1.5, 1.5, (3, 100, n))
    T, (J_v, J_w) = kinematics.frames(CHAIN, motions[0]), kinematics.jacobian(CHAIN, motions[0])
    M, G = rigid_body.mass_matrix(CHAIN, BODIES, motions[0]), rigid_body.gravity(CHAIN, BODIES, motions[0])
    V = rigid_body.coriolis(CHAIN, BODIES, motions[0], motions[1])
    tau = rigid_body.inverse_dynamics(CHAIN, BODIES, *motions)
    tip = arm.frames[CHAIN.names.index(CHAIN.tip) - 1]
    close = {"rtol": 0, "atol": 1e-12}
    for k, (q, dq, ddq) in enumerate(motions.swapaxes(0, 1)):
        at, rates = arm.E @ q, arm.E @ dq
        np.testing.assert_allclose(tau[k], arm.E.T @ pin.rnea(arm.model, arm.data, at, rates, arm.E @ ddq), **close)
        pin.framesForwardKinematics(arm.model, arm.data, at)
        theirs = np.array([arm.data.oMf[frame].homogeneous for frame in arm.frames])
        np.testing.assert_allclose(T[k, 1:], theirs, **close)
        J = pin.computeFrameJacobian(arm.model, arm.data, at, tip, pin.LOCAL_WORLD_ALIGNED) @ arm.E
        np.testing.assert_allclose(np.concatenate([J_v[k], J_w[k]]), J, **close)
        upper = np.triu(pin.crba(arm.model, arm.data, at))
        np.testing.assert_allclose(M[k], arm.E.T @ (upper + np.triu(upper, 1).T) @ arm.E, **close)
        gravity = arm.E.T @ pin.computeGeneralizedGravity(arm.model, arm.data, at)
        np.testing.assert_allclose(G[k], gravity, **close)
        bias = arm.E.T @ pin.nonLinearEffects(arm.model, arm.data, at, rates)
        np.testing.assert_allclose(V[k], bias - gravity, **close)
