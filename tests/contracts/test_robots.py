"""Every robot that is shipped: what it says of its joints is complete, and agrees with its chain and bodies."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from davinci_forces.maths.mechanics import kinematics, rigid_body
from davinci_forces.maths.models.model import ArmMotion
from davinci_forces.maths.models.terms import TERMS
from davinci_forces.robots import ROBOTS, load
from davinci_forces.robots.from_toml import wrong_name
from davinci_forces.robots.models import independent
from davinci_forces.robots.robot import Joint, Kind, Robot
from tests.contracts.dimensions import is_effort
from tests.robot import lagrangian

SHIPPED = {name: load(name, Path()) for name in ROBOTS}
JOINTS = {f"{name}.{joint.name}": joint for name, robot in SHIPPED.items() for joint in robot.joints}
PUBLISHED = {
    f"{name}-{source}": (source, numbers) for name, joint in JOINTS.items() for source, numbers in joint.published
}
# Each arm with as many coordinates as it has joints, and with all that its chain has.
ARMS = {
    f"{name}-{n}": (robot, n)
    for name, robot in SHIPPED.items()
    if robot.chain is not None
    for n in sorted({len(robot.joints), robot.chain.n})
}
WEIGHED = {name: arm for name, arm in ARMS.items() if arm[0].bodies is not None}
JOINT = pytest.mark.parametrize("joint", JOINTS.values(), ids=JOINTS)
ARM = pytest.mark.parametrize(("robot", "n"), ARMS.values(), ids=ARMS)
WEIGHED_ARM = pytest.mark.parametrize(("robot", "n"), WEIGHED.values(), ids=WEIGHED)
POSES = 50


def motions(n: int) -> np.ndarray:
    """q, dq and ddq (3, POSES, n)."""
    return np.random.default_rng(n).uniform(-1.5, 1.5, (3, POSES, n))


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_goes_by_the_name_it_is_listed_under_and_its_joints_by_names_of_their_own(name: str):
    robot = SHIPPED[name]
    assert robot.name == name
    assert robot.title
    names = [joint.name for joint in robot.joints]
    assert names
    assert [wrong for joint in names if (wrong := wrong_name(joint))] == []
    assert len(set(names)) == len(names)


@JOINT
def test_limits_are_ordered_and_numbers_finite(joint: Joint):
    for low, high in (joint.limits.q, joint.limits.dq, joint.limits.ddq):
        assert -np.inf < low < high < np.inf
    for low, high in (joint.limits.dq, joint.limits.ddq):
        assert low < 0 < high  # what moves one way has to come back
    assert np.isfinite([joint.gear_ratio, joint.torque_constant, joint.q_tau]).all()
    assert joint.gear_ratio != 0
    assert joint.torque_constant != 0
    assert joint.q_tau >= 0
    assert joint.harmonics >= 1


@JOINT
def test_the_model_of_a_joint_is_made_of_listed_terms_that_are_efforts_of_its_kind(joint: Joint):
    assert all(TERMS.get(term.name) == term for term in joint.terms)
    assert len(set(joint.terms)) == len(joint.terms)
    assert [term.name for term in joint.terms if not is_effort(term, joint.kind)] == []


@JOINT
def test_the_model_of_a_joint_has_an_inertia_and_a_bias_that_make_up_its_effort(joint: Joint):
    """Which only a model with an inertia has: a term with a slope in the acceleration."""
    model, (q, dq, ddq) = independent(joint), motions(1)
    theta = np.random.default_rng(0).uniform(0.05, 5.0, len(model.parameters))
    motion = ArmMotion(q, dq, ddq, 0.01, np.zeros(len(q), int))
    columns = model.inertia_columns(q)
    assert columns.shape == (len(q), 1, 1, len(theta))
    M = (columns @ theta)[:, 0, 0]
    assert M.min() > 0
    # Efforts of up to 100 round at 1e-14.
    tau = (model.regressor(motion).Phi @ theta)[:, 0]
    bias = (model.regressor(motion._replace(ddq=np.zeros_like(ddq))).Phi @ theta)[:, 0]
    assert_allclose(M * ddq[:, 0] + bias, tau, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("source", "numbers"), PUBLISHED.values(), ids=PUBLISHED)
def test_a_published_trajectory_is_a_period_a_mean_and_pairs_of_coefficients(source: str, numbers: tuple[float, ...]):
    assert not wrong_name(source.replace(".", "-"))
    assert len(numbers) >= 4
    assert len(numbers) % 2 == 0
    assert np.isfinite(numbers).all()
    assert numbers[0] > 0


@ARM
def test_joints_turn_or_slide_as_the_chain_does(robot: Robot, n: int):
    chain = robot.chain
    for i, joint in enumerate(robot.joints):
        assert set(chain.slides[chain.coordinate == i]) == {joint.kind is Kind.PRISMATIC}, joint.name


@ARM
def test_the_jacobian_is_the_derivative_of_the_tip(robot: Robot, n: int):
    q, h = motions(n)[0], 1e-6
    J, _ = kinematics.jacobian(robot.chain, q)
    steps = h * np.eye(n)
    ahead, behind = (np.stack([kinematics.tip(robot.chain, q + s * e) for e in steps], -1) for s in (1, -1))
    # Of an arm of about a metre: truncation h^2/6, rounding 1e-16/h.
    assert_allclose(J, (ahead - behind) / (2 * h), rtol=0, atol=1e-9)


@WEIGHED_ARM
def test_the_mass_matrix_is_symmetric_and_positive_definite(robot: Robot, n: int):
    M = rigid_body.mass_matrix(robot.chain, robot.bodies, motions(n)[0])
    assert_array_equal(M, M.swapaxes(1, 2))
    values = np.linalg.eigvalsh(M)
    assert (values[:, 0] > 1e-12 * values[:, -1]).all()  # rounding leaves 1e-16 of the largest


@WEIGHED_ARM
def test_gravity_is_the_slope_of_the_potential_energy(robot: Robot, n: int):
    q, h = motions(n)[0], 1e-6
    ahead, behind = (
        np.stack([lagrangian.potential(robot.chain, robot.bodies, q + s * e) for e in h * np.eye(n)], -1)
        for s in (1, -1)
    )
    # Energies of up to 100 J round at 1e-14, over h.
    assert_allclose(rigid_body.gravity(robot.chain, robot.bodies, q), (ahead - behind) / (2 * h), rtol=0, atol=1e-7)


@WEIGHED_ARM
def test_the_regressor_times_the_inertial_parameters_is_the_effort(robot: Robot, n: int):
    motion = motions(n)
    Y = rigid_body.regressor(robot.chain, *motion)
    expected = rigid_body.inverse_dynamics(robot.chain, robot.bodies, *motion)
    # Sums of 100 products of up to 100, which round at 1e-14 each.
    assert_allclose(Y @ robot.bodies.parameters(n), expected, rtol=0, atol=1e-11)


@ARM
def test_the_remote_centre_stays_where_it_is(robot: Robot, n: int):
    """In the frame of the last link towards the tip that the second joint moves, whatever roll and pitch do."""
    chain = robot.chain
    centre = np.append(kinematics.remote_centre(chain), 1.0)
    frame = chain.names.index(chain.tip)
    while chain.moved_by[frame] != 1:
        frame = chain.before[frame]
    q = np.zeros((POSES, n))
    q[:, :2] = motions(2)[0]
    local = np.linalg.inv(kinematics.frames(chain, q)[:, frame]) @ centre
    assert_allclose(local, np.broadcast_to(local[0], local.shape), rtol=0, atol=1e-13)
