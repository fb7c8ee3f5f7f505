"""The chain: frames, Jacobians, remote centre and singular poses."""

import numpy as np
import pytest

from davinci_forces.maths.mechanics import kinematics, tip_force
from davinci_forces.robots.davinci import CHAIN, ROBOT
from tests.robot import thesis_matrices as thesis

LIMITS = np.array([joint.limits.q for joint in ROBOT.joints])


def random_poses(n: int, count: int = 100) -> np.ndarray:
    return np.random.default_rng(n).uniform(-1.5, 1.5, (count, n))


@pytest.mark.parametrize("n", [3, 6, 7])
def test_every_frame_is_that_of_the_thesis_s_matrices(n):
    q = random_poses(n)
    T = kinematics.frames(CHAIN, q)
    for name, expected in thesis.poses(q).items():
        np.testing.assert_allclose(T[:, CHAIN.names.index(name)], expected, rtol=0, atol=1e-14)


def test_at_zero_the_tool_points_down_and_the_hand_rolls_about_y():
    T = kinematics.frames(CHAIN, np.zeros(6))
    np.testing.assert_allclose(T[CHAIN.names.index("6"), :3, 2], [0, 0, -1], atol=1e-15)
    _, J_w = kinematics.jacobian(CHAIN, np.zeros(6))
    np.testing.assert_allclose(J_w[:, 0], [0, 1, 0], atol=1e-15)


def test_a_pose_alone_gives_what_it_gives_among_many():
    q = random_poses(6, 5)
    np.testing.assert_array_equal(kinematics.frames(CHAIN, q[2]), kinematics.frames(CHAIN, q)[2])
    np.testing.assert_allclose(kinematics.jacobian(CHAIN, q[2])[0], kinematics.jacobian(CHAIN, q)[0][2], atol=1e-16)


def test_coordinates_that_are_missing_are_held_at_zero():
    q = random_poses(3, 5)
    padded = np.hstack([q, np.zeros((5, 4))])
    np.testing.assert_array_equal(kinematics.frames(CHAIN, q), kinematics.frames(CHAIN, padded))
    np.testing.assert_allclose(
        kinematics.jacobian(CHAIN, q)[0], kinematics.jacobian(CHAIN, padded)[0][..., :3], atol=1e-16
    )


def test_more_coordinates_than_the_chain_has_are_refused():
    with pytest.raises(ValueError, match="has 7 coordinates, and q has 8"):
        kinematics.frames(CHAIN, np.zeros(8))


@pytest.mark.parametrize(("n", "frame"), [(3, None), (6, None), (7, "9R"), (3, "5")])
def test_the_jacobians_are_the_derivatives_of_position_and_rotation(n, frame):
    q, h, point = random_poses(n), 1e-30, np.array([0.01, -0.02, 0.03])
    J_v, J_w = kinematics.jacobian(CHAIN, q, frame, point)
    name = frame or "9L"
    R = thesis.poses(q)[name][:, :3, :3]
    for k, e in enumerate(np.eye(n)):
        rate = thesis.poses(q + 1j * h * e)[name].imag / h  # by the complex step: exact to rounding
        W = rate[:, :3, :3] @ R.transpose(0, 2, 1)
        np.testing.assert_allclose(J_v[:, :, k], rate[:, :3, :3] @ point + rate[:, :3, 3], rtol=0, atol=1e-14)
        np.testing.assert_allclose(J_w[:, :, k], np.stack([W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]], 1), rtol=0, atol=1e-14)


def test_angular_velocity_agrees_with_finite_differences_of_the_rotation():
    q, h = random_poses(6, 10), 1e-6
    _, J_w = kinematics.jacobian(CHAIN, q)
    for k, e in enumerate(np.eye(6)):
        ahead, behind = (kinematics.frames(CHAIN, q + s * h * e)[:, -2, :3, :3] for s in (1, -1))
        R = kinematics.frames(CHAIN, q)[:, -2, :3, :3]
        W = (ahead - behind) / (2 * h) @ R.transpose(0, 2, 1)
        # Truncation h^2/6 and rounding 1e-16/h, each below 1e-9.
        np.testing.assert_allclose(J_w[:, :, k], np.stack([W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]], 1), atol=1e-9)


def test_alpha_pi_makes_the_three_axes_of_the_parallelogram_add_up_to_one():
    q = random_poses(6)
    T = kinematics.frames(CHAIN, q)
    np.testing.assert_allclose(kinematics.jacobian(CHAIN, q)[1][:, :, 1], T[:, 2, :3, 2], atol=1e-14)


def test_the_remote_centre_stays_where_it_is_whatever_roll_and_pitch_do():
    centre = kinematics.remote_centre(CHAIN)
    np.testing.assert_allclose(centre, [0, 0.515 - 0.035, 0.161], atol=1e-15)
    T = kinematics.frames(CHAIN, random_poses(2))
    local = np.linalg.inv(T[:, CHAIN.names.index("5")]) @ np.array([*centre, 1.0])
    np.testing.assert_allclose(local, np.broadcast_to(local[0], local.shape), atol=1e-14)


def test_the_arm_is_singular_where_the_errata_of_the_thesis_say():
    for pitch in (-0.5, -0.2, 0.1, 0.4):
        expected = sorted([-0.1101, 0.0343 * np.tan(pitch) - 0.1101])
        # The printed numbers have four digits.
        np.testing.assert_allclose(tip_force.singular_slides(CHAIN, pitch), expected, atol=1e-4)


def test_at_a_singular_slide_the_jacobian_has_no_inverse_whatever_the_roll():
    for roll, pitch in ((0.0, 0.3), (0.5, -0.4), (-0.3, 0.0)):
        for slide in tip_force.singular_slides(CHAIN, pitch):
            J_v, _ = kinematics.jacobian(CHAIN, [roll, pitch, slide])
            assert np.linalg.cond(J_v) > 1e6
            assert tip_force.is_singular(CHAIN, np.array([roll, pitch, slide]))


def test_inside_the_limits_the_arm_is_never_singular_and_its_condition_number_reaches_about_60():
    grid = np.stack(np.meshgrid(*[np.linspace(*pair, 21) for pair in LIMITS]), -1).reshape(-1, 3)
    worst = np.linalg.cond(kinematics.jacobian(CHAIN, grid)[0]).max()
    assert 55 < worst < 70


def test_a_jacobian_without_rank_has_an_infinite_condition_number():
    assert np.linalg.cond(np.zeros((3, 3))) == np.inf
