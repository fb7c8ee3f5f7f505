"""The force at the tip: the inverse of the Jacobian on efforts that a known force makes, its covariance, its tool."""

from pathlib import Path

import numpy as np
import pytest

from davinci_forces.errors import BadRobot
from davinci_forces.maths.mechanics import kinematics, tip_force
from davinci_forces.robots import ROBOTS, load
from davinci_forces.robots.dvrk_psm import REACH, TOOL, WRIST

ARMS = {name: load(name, Path()) for name in ROBOTS}
ARM = pytest.mark.parametrize("name", ARMS)
DAVINCI = ARMS["davinci"].chain
SHIFT = {"davinci": 0.0, "dvrk_psm": 0.1}  # [m] that the tip needs to be well away from the remote centre


def poses(name: str, n: int = 3, count: int = 50) -> np.ndarray:
    """Poses within the limits; coordinates of the wrist, too, where there are more than three."""
    rng = np.random.default_rng(n)
    limits = np.array([joint.limits.q for joint in ARMS[name].joints])
    limits[2, 0] = 0.0
    arm = rng.uniform(*limits.T, (count, 3)) + np.array([0.0, 0.0, SHIFT[name]])
    return np.hstack([arm, rng.uniform(0.2, 0.8, (count, n - 3))])


def covariances(count: int, k: int) -> np.ndarray:
    root = np.random.default_rng(k).normal(size=(count, k, k))
    return root @ root.swapaxes(1, 2) / k


@ARM
def test_the_force_is_the_one_that_made_the_efforts(name: str):
    q = poses(name)
    J, _ = kinematics.jacobian(ARMS[name].chain, q)
    f = np.random.default_rng(0).normal(0, 10, (len(q), 3))
    tau = np.einsum("nij,ni->nj", J, f)
    found, _ = tip_force.from_efforts(J, tau, np.eye(3))
    # Of 50 poses with a condition number of at most 60; 1e-16 of 10 N is multiplied by that.
    np.testing.assert_allclose(found, f, rtol=0, atol=1e-12)


@ARM
def test_six_joints_tell_the_force_and_the_moment(name: str):
    q = poses(name, 6)
    J = np.concatenate(kinematics.jacobian(ARMS[name].chain, q), axis=1)
    wrench = np.random.default_rng(1).normal(0, 1, (len(q), 6))
    found, C = tip_force.from_efforts(J, np.einsum("nij,ni->nj", J, wrench), np.eye(6))
    # The wrist's levers are of a centimetre, so a condition number reaches 1e3.
    np.testing.assert_allclose(found, wrench, rtol=0, atol=1e-10)
    assert np.isfinite(C).all()


def test_a_mass_that_hangs_on_the_tip_pulls_the_slide_out_and_is_held_up():
    """tau_ext is what the robot exerts: upwards on the mass, and so against the slide, which moves downwards."""
    weight = 0.097 * 9.81
    J, _ = kinematics.jacobian(DAVINCI, np.zeros(3))
    f, _ = tip_force.from_efforts(J, J.T @ [0.0, 0.0, weight], np.eye(3))
    assert (J.T @ [0.0, 0.0, weight])[2] == pytest.approx(-weight)
    np.testing.assert_allclose(f, [0.0, 0.0, weight], atol=1e-13)


@ARM
def test_the_covariance_is_that_of_forces_from_efforts_that_scatter(name: str):
    q = poses(name, count=3)
    J, _ = kinematics.jacobian(ARMS[name].chain, q)
    draws = 40_000
    for J_v, C_tau in zip(J, covariances(3, 3), strict=True):
        _, C = tip_force.from_efforts(J_v, np.zeros(3), C_tau)
        tau = np.random.default_rng(2).multivariate_normal(np.zeros(3), C_tau, draws)
        f, _ = tip_force.from_efforts(np.broadcast_to(J_v, (draws, 3, 3)), tau, C_tau)
        scale = np.sqrt(np.outer(C.diagonal(), C.diagonal()))
        # A covariance of n draws has a standard error of at most sqrt(2/n) of the variances.
        np.testing.assert_allclose(np.cov(f.T) / scale, C / scale, rtol=0, atol=4 * np.sqrt(2 / draws))


def test_at_a_singular_pose_the_force_is_not_known_and_elsewhere_it_is():
    slide = tip_force.singular_slides(DAVINCI, 0.3)[0]
    J, _ = kinematics.jacobian(DAVINCI, [[0.1, 0.3, slide], [0.1, 0.3, slide + 0.05]])
    f, C = tip_force.from_efforts(J, np.ones((2, 3)), np.eye(3))
    assert np.isnan(f[0]).all()
    assert np.isnan(C[0]).all()
    assert np.isfinite(f[1]).all()


def test_a_centimetre_from_the_remote_centre_is_near_singular_and_the_box_of_the_thesis_is_not():
    centre = tip_force.singular_slides(DAVINCI, 0.0)[0]
    J, _ = kinematics.jacobian(DAVINCI, [[0.0, 0.0, centre + lever] for lever in (-0.004, -0.2)])
    assert list(np.linalg.cond(J) > tip_force.NEAR_SINGULAR) == [True, False]
    grid = np.stack(np.meshgrid(*[np.linspace(*joint.limits.q, 11) for joint in ARMS["davinci"].joints]), -1)
    assert np.linalg.cond(kinematics.jacobian(DAVINCI, grid.reshape(-1, 3))[0]).max() < tip_force.NEAR_SINGULAR


def test_the_half_axes_of_the_ellipsoid_make_up_the_covariance():
    C = covariances(20, 3)
    sigma, axes = tip_force.sigma_ellipsoid(C)
    assert (np.diff(sigma, axis=1) <= 0).all()
    np.testing.assert_allclose(axes @ axes.swapaxes(1, 2), np.broadcast_to(np.eye(3), C.shape), atol=1e-12)
    np.testing.assert_allclose(axes.swapaxes(1, 2) @ (sigma[..., None] ** 2 * axes), C, atol=1e-12)


def test_the_ellipsoid_of_95_percent_holds_them():
    draws, C = 20_000, covariances(1, 3)[0]
    f = np.random.default_rng(3).multivariate_normal(np.zeros(3), C, draws)
    inside = np.linalg.norm(f, axis=1) <= tip_force.reach_95(f, np.broadcast_to(C, (draws, 3, 3)))
    assert inside.mean() == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / draws))
    assert np.isfinite(tip_force.reach_95(np.zeros(3), C))


def test_a_lever_is_the_force_that_one_unit_of_effort_stands_for():
    J, _ = kinematics.jacobian(DAVINCI, [0.2, -0.1, 0.05])
    for effort, lever in zip(np.eye(3), tip_force.lever(J), strict=True):
        assert np.linalg.norm(tip_force.from_efforts(J, effort, np.eye(3))[0]) == pytest.approx(lever)


def test_the_covariance_of_efforts_has_their_variances_and_correlations():
    C = tip_force.covariance([[1.0, 2.0]], [[1.0, 0.5], [0.5, 1.0]])
    np.testing.assert_allclose(C, [[[1.0, 1.0], [1.0, 4.0]]])


def test_the_tip_of_the_research_kit_lies_on_the_axis_of_its_tool():
    """At q = 0 straight below the remote centre, by the slide less the reach, and the tool and the wrist."""
    chain = ARMS["dvrk_psm"].chain
    below = kinematics.remote_centre(chain) - kinematics.tip(chain, [0.0, 0.0, 0.15])
    np.testing.assert_allclose(below, [0.0, 0.0, 0.15 - REACH + TOOL + WRIST], atol=1e-12)


@pytest.mark.parametrize("length", [0.3, 0.5])
def test_another_tool_moves_the_tip_along_its_axis_and_nothing_else(length: float):
    robot = ARMS["dvrk_psm"]
    other, q = robot.with_tool(length), poses("dvrk_psm")
    moved = kinematics.tip(other.chain, q) - kinematics.tip(robot.chain, q)
    along = kinematics.jacobian(robot.chain, q)[0][..., 2]  # where the slide moves the tip
    np.testing.assert_allclose(moved, (length - TOOL) * along, atol=1e-12)
    before = [i for i, name in enumerate(robot.chain.names) if name in ("carriage", "counterweight", "front_link")]
    frames = (kinematics.frames(arm.chain, q)[:, before] for arm in (robot, other))
    np.testing.assert_array_equal(*frames)
    assert next(row.d for row in other.chain.table if row.name == "tool_roll") == pytest.approx(length)
    assert other.with_tool(TOOL).tool == robot.tool


def test_a_robot_whose_tool_is_not_known_takes_no_other():
    with pytest.raises(BadRobot, match="robot davinci has no known tool in its chain"):
        ARMS["davinci"].with_tool(0.4)


@pytest.mark.parametrize("q_pitch", [-0.4, 0.3, 0.9])  # at 0 it touches zero without a change of sign
def test_the_jacobian_is_singular_at_the_slides_that_are_said_to_be_and_nowhere_between(q_pitch: float):
    slides = tip_force.singular_slides(DAVINCI, q_pitch)
    assert np.all(np.diff(slides) >= 0)

    def det(slide: float) -> float:
        return float(np.linalg.det(kinematics.jacobian(DAVINCI, np.array([0.2, q_pitch, slide]))[0]))

    size = max(abs(det(-1.0)), abs(det(1.0)))
    assert max(abs(det(slide)) for slide in slides) < 1e-9 * size
    signs = np.sign([det(slide) for slide in np.linspace(-1.0, 1.0, 401)])
    assert np.count_nonzero(np.diff(signs)) == np.count_nonzero(np.abs(slides) < 1.0)
