"""The arm for the simulator is the arm of the rigid-body module."""

import numpy as np
import pytest

from davinci_forces.maths.mechanics import kinematics, rigid_body
from davinci_forces.maths.mechanics.kernels import place_and_jacobian
from davinci_forces.maths.simulation.closed_loop import arm, dynamics
from davinci_forces.robots.davinci import ROBOT

random = np.random.default_rng(4)


@pytest.mark.parametrize("n", [3, 6, 7])
def test_inertia_bias_and_tip_agree_with_the_vectorised_dynamics(n):
    plant = arm(ROBOT.chain, ROBOT.bodies, np.full(n, 0.1))
    for q, dq in random.uniform(-1, 1, (20, 2, n)):
        M, b = np.empty((n, n)), np.empty(n)
        dynamics(plant, np.ascontiguousarray(q), np.ascontiguousarray(dq), M, b)
        J = np.empty((3, n))
        x = place_and_jacobian(plant.tree, plant.body, plant.tip, q, J)
        expected = rigid_body.mass_matrix(ROBOT.chain, ROBOT.bodies, q) + 0.1 * np.eye(n)
        assert np.allclose(M, expected, rtol=0, atol=1e-12)
        assert np.allclose(b, rigid_body.inverse_dynamics(ROBOT.chain, ROBOT.bodies, q, dq, 0 * q), rtol=0, atol=1e-12)
        assert np.allclose(J, kinematics.jacobian(ROBOT.chain, q)[0], rtol=0, atol=1e-12)
        assert np.allclose(x, kinematics.tip(ROBOT.chain, q), rtol=0, atol=1e-12)
