"""The control studies of chapter 5: continuous controllers and viscous friction, with an implicit adaptive solver.

The solver is implicit because the wrist has small inertias and high gains: explicit steps would take microseconds.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import compile_and_store
from davinci_forces.maths.simulation import closed_loop as arms
from davinci_forces.maths.simulation.actuators import Regulator
from davinci_forces.maths.simulation.closed_loop import Plant
from davinci_forces.maths.simulation.control import lyapunov

RELATIVE, ABSOLUTE = 1e-9, 1e-11


class Regulated(NamedTuple):
    """A run towards a fixed reference; arrays are (K, n), except `t` (K,) [s] and `V` (K,) [J]."""

    t: Array
    q: Array
    dq: Array
    tau: Array
    V: Array


def regulate(
    plant: Plant, model: Plant, law: Regulator, viscous: Array, q: Array, target: Array, duration: float
) -> Regulated:
    """Drive the arm from rest at q (n,) to `target` (n,) under PD or PID with gravity compensation.

    `plant` is the arm, and `model` is the arm that the gravity compensation assumes, both made by `arm`.  `viscous`
    (n,) is the friction.  The samples are the solver's steps, so that V is not interpolated.  (5.8), (5.9), (5.17)
    """
    n = len(q)
    M, tau, b = np.empty((n, n)), np.empty(n), np.empty(n)

    def slope(_: float, state: Array) -> Array:
        rate = np.empty(3 * n)
        _slope(plant.data, model.data, law, target, viscous, np.ascontiguousarray(state), M, tau, b, rate)
        return rate

    start = np.concatenate([q, np.zeros(2 * n)])
    solution = solve_ivp(slope, (0.0, duration), start, method="Radau", rtol=RELATIVE, atol=ABSOLUTE)
    if not solution.success:
        raise ArithmeticError(f"the solver stopped at {solution.t[-1]:g} s: {solution.message}")
    q_t, dq_t = solution.y[:n].T, solution.y[n : 2 * n].T
    V, efforts = np.empty(len(q_t)), np.empty(q_t.shape)
    for k, state in enumerate(solution.y.T):
        _forces(plant.data, model.data, law, target, np.ascontiguousarray(state), M, tau, b)
        V[k] = lyapunov(M, dq_t[k], law.proportional, target - q_t[k])
        efforts[k] = tau
    return Regulated(solution.t, q_t, dq_t, efforts, V)


@compile_and_store
def _forces(body: Any, model: Any, law: Any, target: Any, state: Any, M: Any, tau: Any, b: Any) -> None:
    """Fill inertia M, controller effort tau and bias b at a state (3 n,): position, velocity, integral of the error."""
    n = len(target)
    q, dq = state[:n], state[n : 2 * n]
    arms.dynamics(model, q, model.rest, M, b)  # b is now the gravity that the compensation assumes
    error = target - q
    tau[:] = law.proportional * error - law.derivative * dq + law.gravity * b + law.integral * state[2 * n :]  # (5.17)
    arms.dynamics(body, q, dq, M, b)


@compile_and_store
def _slope(
    body: Any, model: Any, law: Any, target: Any, viscous: Any, state: Any, M: Any, tau: Any, b: Any, rate: Any
) -> None:
    """Fill the time derivative of a state.  (4.28)"""
    n = len(target)
    _forces(body, model, law, target, state, M, tau, b)
    dq = state[n : 2 * n]
    rate[:n] = dq
    rate[n : 2 * n] = np.linalg.solve(M, tau - b - viscous * dq)
    rate[2 * n :] = target - state[:n]
