"""Real arms: efforts and obstacles hold at every instant, the gradient is right, and errors are as expected."""

from dataclasses import replace

import numpy as np
import pytest

from davinci_forces import robots
from davinci_forces.maths.excitation import arm as search
from davinci_forces.maths.excitation.arm import arm_observation, arm_problem, design_together
from davinci_forces.maths.excitation.fourier import (
    Fourier,
    condition,
    determinant,
    expected_std,
    motion,
    ranges,
    shortest_run_in,
)
from davinci_forces.maths.excitation.joint import ExcitationProblem, scale_to_limits, shrink_to_limits
from davinci_forces.maths.excitation.limits import Obstacles, shrink_to_arm_limits
from davinci_forces.maths.mechanics.kinematics import frames
from davinci_forces.maths.mechanics.rigid_body import inverse_dynamics
from tests.simulation.six_joints import write

WORKSPACE = Obstacles(0.05, ((0.4, -0.3, 0.0, 0.9, 0.3, 0.5),))


def limits_of(joint):
    return joint.limits.q, joint.limits.dq, joint.limits.ddq


def problem_of(robot, period=10.0, harmonics=5, criterion="determinant", obstacles=WORKSPACE, samples=100):
    joints = [
        ExcitationProblem(joint.terms, limits_of(joint), period, harmonics or joint.harmonics, criterion, samples)
        for joint in robot.joints
    ]
    efforts = [joint.limits.effort for joint in robot.joints]
    return arm_problem(robot.chain, joints, robot.bodies, efforts, obstacles)


@pytest.fixture(scope="module")
def six(tmp_path_factory):
    return robots.load("six.urdf", write(tmp_path_factory.mktemp("six")).parent)


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    return robots.load("six.urdf", write(tmp_path_factory.mktemp("two"), 2).parent)


@pytest.fixture
def short_search(monkeypatch):
    """A start that explores three trajectories and refines one of them: enough for what holds of every design."""
    monkeypatch.setattr(search, "EXPLORED", 3)
    monkeypatch.setattr(search, "REFINED", 1)


def assert_limits_hold(robot, problem, series, obstacles):
    t = np.linspace(0.0, series[0].period, 20_001)  # a peak between two samples is higher by 3e-7 at most
    q, dq, ddq = (np.stack(x, axis=-1) for x in zip(*(motion(s, t) for s in series), strict=True))
    for i, joint in enumerate(robot.joints):
        for x, (low, high) in zip((q, dq, ddq), limits_of(joint), strict=True):
            assert low <= x[:, i].min()
            assert x[:, i].max() <= high
    if robot.bodies is not None:
        efforts = [joint.limits.effort for joint in robot.joints]
        assert (np.abs(inverse_dynamics(robot.chain, robot.bodies, q, dq, ddq)) <= efforts).all()
    points = frames(robot.chain, q)[:, :, :3, 3][:, 2:]  # neither the base nor the origin of the first link moves
    assert points[..., 2].min() >= obstacles.floor
    for box in obstacles.boxes:
        inside = (points > box[:3]) & (points < box[3:])
        assert not inside.all(axis=-1).any()


@pytest.mark.parametrize("criterion", ["determinant", "condition"])
def test_the_gradient_of_the_search_is_that_of_differences(six, criterion):
    problem = problem_of(six, criterion=criterion, samples=40)
    weak = replace(problem.limits, efforts=tuple(effort / 4 for effort in problem.limits.efforts))
    stage = search.Stage.with_samples(replace(problem, limits=weak), 40)
    z = 1.3 * search._random(stage, np.random.default_rng(0))
    along = np.random.default_rng(1).normal(size=z.shape)

    def lagrangian(z):
        return search._lagrangian(stage, z, 30.0, None, stage.width(2.0))

    (ahead, *_), (behind, *_) = lagrangian(z + 1e-6 * along), lagrangian(z - 1e-6 * along)
    assert sum(float(part.sum() > 0) for part in lagrangian(z)[2]) == 7  # the arm's limits and each joint's are active
    efforts, depths = np.split(lagrangian(z)[2][0], [12], axis=-1)
    assert (efforts > 0).any()
    assert (depths > 0).any()
    assert lagrangian(z)[1] @ along == pytest.approx((ahead - behind) / 2e-6, rel=1e-5)


@pytest.mark.slow
@pytest.mark.usefixtures("short_search")
def test_six_joints_are_excited_within_every_limit_and_far_better_than_at_random(six):
    """The criterion of 300 random trajectories of size 1 within the same limits: at least 12 above the design's."""
    problem, random = problem_of(six, samples=40), np.random.default_rng(0)
    series, optima = design_together(problem, 1, 0)
    assert_limits_hold(six, problem, series, WORKSPACE)
    best = np.inf
    for _ in range(300):
        z = random.normal(size=(6, 11))
        x = [scale_to_limits(part[None], joint.limits, 10.0)[0] for part, joint in zip(z, problem.joints, strict=True)]
        feasible = [
            shrink_to_limits(j, Fourier.from_coefficients(c, 10.0)) for j, c in zip(problem.joints, x, strict=True)
        ]
        best = min(best, float(determinant(arm_observation(problem, feasible))))  # without efforts and workspace
    assert optima.min() <= best - 12


@pytest.mark.slow
def test_five_starts_of_the_da_vinci_agree():
    problem = problem_of(robots.load("davinci", "."), harmonics=2, obstacles=Obstacles(), samples=40)
    assert np.ptp(design_together(problem, 5, 0)[1]) <= 0.02


@pytest.mark.slow
@pytest.mark.usefixtures("short_search")
def test_the_dvrk_psm_is_excited_within_its_limits():
    robot = robots.load("dvrk_psm", ".")
    problem = problem_of(robot, harmonics=None, obstacles=Obstacles(), samples=60)
    series, _ = design_together(problem, 1, 0)
    assert_limits_hold(robot, problem, series, Obstacles())


def test_a_motion_is_shrunk_until_efforts_and_obstacles_hold_at_every_instant(six):
    high = Obstacles(0.0, ((0.3, 0.3, 0.0, 0.5, 0.5, 0.8),))
    problem = problem_of(six, obstacles=high)
    up = [0.0, -1.2, 0.4, -0.8, 0.5, 0.0]
    series = [Fourier.from_coefficients(np.r_[a0, np.full(10, 1.0)], 10.0) for a0 in up]
    within = shrink_to_arm_limits(problem.limits, series)
    assert within is not None
    assert 0 < within[0].x[1] < 1
    assert_limits_hold(replace(six, joints=tuple(six.joints)), problem, within, high)
    below = [Fourier.from_coefficients(np.r_[a0, np.full(10, 1.0)], 10.0) for a0 in (0, 1.5, 0, 0, 0, 0)]
    assert shrink_to_arm_limits(problem.limits, below) is None


def test_a_motion_is_shrunk_until_efforts_just_hold(six):
    rest = np.array([0.0, -1.2, 0.4, -0.8, 0.5, 0.0])
    still = np.zeros(6)
    efforts = np.abs(inverse_dynamics(six.chain, six.bodies, rest, still, still)) + 10.0
    joints = [
        replace(joint, limits=replace(joint.limits, effort=effort))
        for joint, effort in zip(six.joints, efforts.tolist(), strict=True)
    ]
    weak = replace(six, joints=tuple(joints))
    problem = problem_of(weak, obstacles=Obstacles())
    series = [Fourier.from_coefficients(np.r_[a0, np.full(10, 0.2)], 10.0) for a0 in rest]
    within = shrink_to_arm_limits(problem.limits, series)
    assert within is not None
    assert_limits_hold(weak, problem, within, Obstacles())
    t = np.linspace(0.0, 10.0, 10_001)
    moved = (np.stack(x, axis=-1) for x in zip(*(motion(s, t) for s in within), strict=True))
    assert (np.abs(inverse_dynamics(six.chain, six.bodies, *moved)) / efforts).max() == pytest.approx(1.0, abs=0.01)


def test_points_are_deep_below_the_floor_and_inside_boxes():
    points = np.array([[0.5, 0.0, 0.2], [0.5, 0.0, 0.6], [0.5, 0.0, 0.01]])
    assert WORKSPACE.depth(points) == pytest.approx(np.array([[-0.15, 0.1], [-0.55, -0.1], [0.04, 0.01]]))


def test_a_run_in_keeps_the_limits_of_the_arm(two):
    series = [Fourier(0.1, (0.4,), (0.1,), 10.0), Fourier(0.2, (0.3,), (0.2,), 10.0)]
    durations, heard = np.array([3.0, 5.0, 8.0]), []

    def hold(q, dq, ddq):
        heard.append(q.shape[1])
        return len(heard) == 2

    assert shortest_run_in(series, [(-9.0, 9.0)] * 2, durations, hold) == 5.0
    assert heard == [2, 2]


def test_standard_errors_are_those_of_many_weighted_fits(two):
    problem = problem_of(two, harmonics=2, samples=40, obstacles=Obstacles())
    series = [Fourier(0.1, (0.4, 0.2), (0.1, -0.6), 10.0), Fourier(0.2, (0.3, -0.5), (0.2, 0.1), 10.0)]
    F, random = arm_observation(problem, series), np.random.default_rng(0)
    noise = np.tile([0.5, 2.0], 40)
    fits = np.linalg.lstsq(F / noise[:, None], random.normal(size=(80, 4000)), rcond=None)[0]
    assert np.isfinite(condition(F))
    # the standard deviation of 4000 fits has a standard error of 1 / sqrt(8000)
    assert expected_std(F, noise) == pytest.approx(fits.std(axis=1), rel=5 / np.sqrt(8000))
    assert np.isinf(expected_std(np.ones((9, 2)), np.ones(9))).all()


@pytest.mark.slow
@pytest.mark.usefixtures("short_search")
def test_every_limit_holds_for_a_small_arm(two):
    problem = problem_of(two, harmonics=2, samples=40)
    assert_limits_hold(two, problem, design_together(problem, 1, 0)[0], WORKSPACE)


@pytest.mark.usefixtures("short_search")
def test_ranges_of_a_design_touch_a_limit(two):
    problem = problem_of(two, harmonics=2, samples=40)
    speeds = [max(map(abs, ranges(s)[1])) / 2.16 for s in design_together(problem, 1, 1)[0]]
    assert max(speeds) == pytest.approx(1.0, abs=0.01)


def test_a_motion_within_its_limits_is_not_shrunk(six):
    up = Obstacles(floor=0.0)
    series = [Fourier.from_coefficients(np.r_[a0, np.full(10, 0.3)], 10.0) for a0 in (0.0, -1.2, 0.4, -0.8, 0.5, 0.0)]
    limits = problem_of(six, obstacles=up).limits
    assert limits.obstacles.present
    assert shrink_to_arm_limits(limits, series) == series
