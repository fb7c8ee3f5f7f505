"""One step of the arm: what sticks sticks exactly, what slides stops in the right place, what is stopped stays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from davinci_forces.maths.simulation import closed_loop
from davinci_forces.maths.simulation.closed_loop import arm
from davinci_forces.maths.simulation.step import Friction, State, middle, step
from davinci_forces.robots.davinci import ROBOT

G = 9.81


def friction(n: int = 1, viscous=0.0, coulomb=0.0, stiffness=0.0, down=None) -> Friction:
    full = lambda value: np.broadcast_to(np.asarray(value, float), n).copy()
    up, down = full(coulomb), full(coulomb if down is None else down)
    return Friction(full(viscous), up, down, up, down, full(1.0), full(stiffness), full(0.0))


def run(state, tau, h, steps, what=None, M=None, lower=-np.inf, upper=np.inf, bias=None):
    """Steps with constant inertia; `bias(q)` is taken at the middle of a step, as the simulator does."""
    n = len(state.q)
    M = np.eye(n) if M is None else M
    what = what or friction(n)
    limits = np.full(n, lower, float), np.full(n, upper, float)
    for _ in range(steps):
        b = np.zeros(n) if bias is None else bias(state.q + h / 2 * state.dq)
        step(M, b, np.asarray(tau, float), what, *limits, state, h)
    return state


def dynamics(plant, q, dq) -> tuple[np.ndarray, np.ndarray]:
    """Inertia (n, n) and bias (n,) of a plant at one configuration."""
    M, b = np.empty((len(q), len(q))), np.empty(len(q))
    closed_loop.dynamics(plant, np.ascontiguousarray(q), np.ascontiguousarray(dq), M, b)
    return M, b


def at(q, dq=None) -> State:
    q = np.array(q, float)
    dq = np.zeros_like(q) if dq is None else np.array(dq, float)
    return State(q, dq, np.zeros_like(q), dq.copy())


def test_a_constant_effort_gives_a_parabola_exactly():
    state = run(at([0.0]), [3.0], 1e-2, 100, M=np.array([[2.0]]))
    assert state.q[0] == pytest.approx(0.75, rel=1e-12)
    assert state.dq[0] == pytest.approx(1.5, rel=1e-12)


def test_viscous_friction_is_of_second_order():
    errors = [abs(run(at([0.0], [1.0]), [0.0], h, round(1 / h), friction(viscous=2.0)).dq[0] - np.exp(-2.0))
              for h in (0.02, 0.01)]  # fmt: skip
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)


def test_stiff_viscous_friction_is_stable():
    state = run(at([0.0], [1.0]), [1.0], 1e-2, 2000, friction(viscous=1e3))
    assert state.dq[0] == pytest.approx(1e-3, rel=1e-6)


def test_a_pendulum_neither_gains_nor_loses_energy():
    state, h = at([1.0]), 2e-3
    energy = lambda: state.dq[0] ** 2 / 2 - G * np.cos(state.q[0])
    first, found = energy(), []
    for _ in range(40):
        run(state, [0.0], h, 100, bias=lambda q: G * np.sin(q))
        found.append(energy() - first)
    # a second-order method without drift: the error swings by (w h)^2 G, w^2 = G, and does not grow
    assert np.abs(found).max() < G * G * h * h
    assert abs(np.mean(found[20:]) - np.mean(found[:20])) < 0.3 * G * G * h * h


def test_an_arm_that_swings_freely_moves_as_a_fine_integrator_moves_it():
    plant = arm(ROBOT.chain, ROBOT.bodies, np.array([0.04, 0.04, 1.8]))
    q0, dq0 = np.array([0.4, -0.3, 0.02]), np.array([0.8, -0.6, 0.1])

    def slope(_, x):
        M, b = dynamics(plant, x[:3], x[3:])
        return np.concatenate([x[3:], np.linalg.solve(M, -b)])

    exact = solve_ivp(slope, (0, 0.5), np.concatenate([q0, dq0]), rtol=1e-10, atol=1e-12).y[:, -1]
    errors = []
    for h in (2e-3, 1e-3):
        state, q, dq = at(q0, dq0), np.empty(3), np.empty(3)
        for _ in range(round(0.5 / h)):
            middle(state, h, q, dq)
            M, b = dynamics(plant, q, dq)
            step(M, b, np.zeros(3), friction(3), np.full(3, -9.0), np.full(3, 9.0), state, h)
        errors.append(np.abs(np.concatenate(state[:2]) - exact).max())
    assert errors[1] < 1e-6
    assert 3.0 < errors[0] / errors[1] < 5.0  # of second order


def test_a_sliding_joint_stops_where_its_energy_is_spent_and_then_rests_exactly():
    state = run(at([0.0], [1.0]), [0.0], 1e-3, 1600, friction(coulomb=2.0), M=np.array([[3.0]]))
    assert state.q[0] == pytest.approx(3.0 / (2 * 2.0), abs=1e-3)  # M v^2 / 2 = c q, to a step
    assert state.dq[0] == 0.0


@pytest.mark.parametrize("effort", [-1.999, 0.0, 1.999])
def test_an_effort_below_friction_moves_nothing(effort):
    state = run(at([0.3]), [effort], 1e-3, 100, friction(coulomb=2.0))
    assert state.q[0] == 0.3
    assert state.dq[0] == 0.0


def test_an_effort_above_friction_accelerates_by_what_is_left():
    assert run(at([0.0]), [2.5], 1e-3, 1000, friction(coulomb=2.0)).dq[0] == pytest.approx(0.5, rel=1e-12)


@given(st.integers(0, 10_000))
def test_friction_of_coupled_joints_opposes_each_of_them_and_is_never_more_than_its_level(seed):
    random = np.random.default_rng(seed)
    n, h = 4, 1e-2
    B = random.normal(size=(n, n))
    M, tau, up, down = B @ B.T + np.eye(n), 3 * random.normal(size=n), *random.uniform(0, 3, (2, n))
    before = random.normal(size=n) * random.integers(0, 2, n)
    state = run(at(np.zeros(n), before), tau, h, 1, friction(n, coulomb=up, down=down), M=M)
    f = tau - M @ (state.dq - before) / h
    tolerance = 1e-9 * np.abs(M).sum() / h
    assert (f <= up + tolerance).all()
    assert (f >= -down - tolerance).all()
    assert np.allclose(f[state.dq > 0], up[state.dq > 0], atol=tolerance)
    assert np.allclose(f[state.dq < 0], -down[state.dq < 0], atol=tolerance)


def test_a_joint_at_its_stop_loses_its_velocity_and_leaves_when_pulled_back():
    state = run(at([0.0], [1.0]), [5.0], 1e-3, 500, upper=0.1)
    assert state.q[0] == 0.1
    assert state.dq[0] == 0.0
    run(state, [-5.0], 1e-3, 100, upper=0.1)
    assert state.q[0] == pytest.approx(0.1 - 5.0 * 0.1**2 / 2, rel=1e-9)


def test_a_stopped_joint_passes_its_share_of_the_impact_on_to_the_others():
    M = np.array([[2.0, 0.5], [0.5, 1.0]])
    state = run(at([0.0999, 0.0], [1.0, 0.0]), [0.0, 0.0], 1e-3, 1, M=M, upper=0.1)
    # the second joint's own momentum, M_21 dq_1 + M_22 dq_2, is kept
    assert state.dq == pytest.approx([0.0, 0.5], rel=1e-9)


def test_a_push_that_does_not_break_the_bristles_is_followed_by_the_return():
    what, state = friction(coulomb=2.0, stiffness=1e3, viscous=20.0), at([0.0])
    run(state, [0.2], 1e-4, 20_000, what)
    # LuGre's bristles also creep: the way is that of the spring, a little longer
    assert 0.2 / 1e3 < state.q[0] < 1.3 * 0.2 / 1e3
    run(state, [0.0], 1e-4, 20_000, what)
    assert abs(state.q[0]) < 0.3 * 0.2 / 1e3


def test_bristles_are_of_first_order():
    what = friction(coulomb=2.0, stiffness=500.0)
    q = [run(at([0.0]), [1.0], h, round(0.05 / h), what).q[0] for h in (4e-4, 2e-4, 1e-4)]
    assert (q[0] - q[1]) / (q[1] - q[2]) == pytest.approx(2.0, rel=0.1)
