"""Controllers: their parts, and the studies of chapter 5."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from davinci_forces.maths.simulation import continuous
from davinci_forces.maths.simulation.actuators import Motors, Regulator
from davinci_forces.maths.simulation.closed_loop import arm
from davinci_forces.maths.simulation.continuous import Regulated, regulate
from davinci_forces.maths.simulation.control import current_after, pi
from davinci_forces.robots.davinci import ROBOT

K_P = np.array([500, 500, 500, 10, 10, 1.0])  # Table 5.1
K_D = np.array([50, 50, 40, 2, 0.2, 0.02])
K_I = np.array([50, 50, 40, 2, 1, 0.1])  # Table 5.4
POSE = np.array([-np.pi / 8, np.pi / 8, 0.2, -np.pi / 4, -np.pi / 4, -np.pi / 4])  # Tables 5.2 and 5.3
REST = np.zeros(6)
VISCOUS = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])  # the initial guesses of Tables 6.4-6.6


@cache
def study(integral: bool, masses: float, start: str, duration: float) -> Regulated:
    plant = arm(ROBOT.chain, ROBOT.bodies, REST)
    known = arm(ROBOT.chain, ROBOT.bodies.with_density_factor(masses), REST)
    law = Regulator(K_P, K_D, K_I if integral else REST, 1.0)
    here, there = (POSE, REST) if start == "pose" else (REST, POSE)
    return regulate(plant, known, law, VISCOUS, here, there, duration)


def error(run: Regulated, t: float) -> np.ndarray:
    return np.array([np.interp(t, run.t, POSE[i] - run.q[:, i]) for i in range(6)])


@pytest.mark.parametrize("start", ["pose", "rest"])
def test_pd_with_gravity_compensation_converges(start):
    run = study(False, 1.0, start, 10.0)
    assert run.q[-1] == pytest.approx(REST if start == "pose" else POSE, abs=1e-9)
    assert run.dq[-1] == pytest.approx(REST, abs=1e-9)


@pytest.mark.parametrize("start", ["pose", "rest"])
def test_the_lyapunov_function_never_rises(start):
    run = study(False, 1.0, start, 10.0)
    assert run.V[0] == pytest.approx(POSE @ (K_P * POSE) / 2, rel=1e-12)
    assert np.diff(run.V).max() <= 0.0
    assert run.V[-1] < 1e-12 * run.V[0]


def test_the_lyapunov_function_falls_by_what_damping_takes():
    run = study(False, 1.0, "pose", 10.0)
    taken = (run.dq**2 * (K_D + VISCOUS)).sum(axis=1)  # (5.13)
    lost = np.concatenate([[0.0], np.cumsum(np.diff(run.t) * (taken[1:] + taken[:-1]) / 2)])
    # the trapezoids of some thousand adaptive steps: a part in a thousand of the whole
    assert run.V[0] - run.V == pytest.approx(lost, abs=2e-3 * run.V[0])


def test_a_compensator_that_knows_nine_tenths_of_the_masses_leaves_pd_with_the_offset_of_the_tenth():
    from davinci_forces.maths.mechanics.rigid_body import gravity

    run = study(False, 0.9, "rest", 60.0)
    expected = 0.1 * gravity(ROBOT.chain, ROBOT.bodies, run.q[-1]) / K_P
    assert POSE - run.q[-1] == pytest.approx(expected, abs=1e-9)


def test_the_pid_of_table_5_4_removes_that_offset_but_is_worse_than_pd_for_over_twenty_seconds():
    pid, pd = study(True, 0.9, "rest", 60.0), study(False, 0.9, "rest", 60.0)
    for joint in range(3):
        assert abs(error(pid, 10.0)[joint]) > 2 * abs(error(pd, 10.0)[joint])
        assert abs(error(pid, 20.0)[joint]) > 0.9 * abs(error(pd, 20.0)[joint])
        assert abs(error(pid, 60.0)[joint]) < 0.2 * abs(error(pd, 60.0)[joint])
    assert np.linalg.norm(error(pid, 20.0)[:3]) > np.linalg.norm(error(pd, 20.0)[:3])


def test_the_jacobian_of_a_regulated_arm_is_that_of_differences_where_the_arm_hardly_changes(monkeypatch):
    """Without gravity and at rest at the target, inertia and bias change in second order alone."""
    given = []

    def solve(slope, *interval_and_start, jac, **options):
        given.extend((slope, jac))
        return solve_ivp(slope, *interval_and_start, jac=jac, **options)

    monkeypatch.setattr(continuous, "solve_ivp", solve)
    floating = arm(replace(ROBOT.chain, up=(0.0, 0.0, 0.0)), ROBOT.bodies, np.full(6, 0.1))
    regulate(floating, floating, Regulator(K_P, K_D, K_I, 1.0), VISCOUS, POSE, POSE, 1e-6)
    (slope, jacobian), state, step = given, np.concatenate([POSE, REST, REST]), 1e-6
    differences = [(slope(0.0, state + step * e) - slope(0.0, state - step * e)) / (2 * step) for e in np.eye(18)]
    J = jacobian(0.0, state)
    assert_allclose(J, np.array(differences).T, rtol=1e-6, atol=1e-7 * np.abs(J).max())


def test_a_pi_loop_at_its_limit_stops_integrating_and_comes_back_at_once():
    integral = 0.0
    for _ in range(1000):
        output, integral = pi(1.0, 0.5, 10.0, integral, 0.01, 2.0)
    assert output == 2.0
    assert integral <= 2.0
    output, _ = pi(-1.0, 0.5, 10.0, integral, 0.01, 2.0)
    assert output < 2.0


def test_a_pi_loop_within_its_limit_is_proportional_plus_integral():
    output, integral = pi(0.3, 2.0, 5.0, 0.1, 0.01, np.inf)
    assert integral == pytest.approx(0.1 + 5.0 * 0.01 * 0.3)
    assert output == pytest.approx(2.0 * 0.3 + integral)


def test_the_current_of_a_motor_solves_its_electrical_equation():
    one = np.ones(1)
    motors = Motors(200 * one, 0.0438 * one, 2.0 * one, 3e-4 * one, one, one, one)
    equation = lambda _, i: (10.0 - 0.0438 * 50.0 - 2.0 * i) / 3e-4  # (A.5)
    exact = solve_ivp(equation, (0, 2e-4), [0.7], rtol=1e-10, atol=1e-12, method="Radau").y[0, -1]
    assert current_after(motors, 0, 0.7, 10.0, 50.0, 2e-4) == pytest.approx(exact, rel=1e-8)
