"""The studies of chapter 5: controllers without a clock, friction that is viscous only, an implicit adaptive solver.

The wrist's inertias are so small for its gains that an explicit solver would need steps of microseconds.
"""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from pipeline.maths.arrays import Array
from pipeline.maths.simulation.closed_loop import Plant
from pipeline.maths.simulation.control import Regulator, lyapunov, pd_gravity

RELATIVE, ABSOLUTE = 1e-9, 1e-11


class Regulated(NamedTuple):
    """A run towards a fixed reference; the arrays are (K, n), but `t` (K,) [s] and `V` (K,) [J]."""

    t: Array
    q: Array
    dq: Array
    tau: Array
    V: Array


def regulate(
    plant: Plant, known: Plant, law: Regulator, viscous: Array, q: Array, target: Array, duration: float
) -> Regulated:
    """Drive the arm from rest at q (n,) to `target` (n,) under PD or PID with gravity compensation.

    `known` is the arm as the compensator knows it, `viscous` (n,) the friction.  The samples are the solver's own
    steps, so that V is compared where it was computed and not where it was interpolated.  (5.8), (5.9), (5.17)
    """
    n = len(q)

    def effort(state: Array) -> Array:
        error = target - state[:n]
        G = at(known, state[:n], np.zeros(n))[1]
        return pd_gravity(law, error, state[n : 2 * n], G) + law.integral * state[2 * n :]

    def slope(_: float, state: Array) -> Array:
        M, b = at(plant, state[:n], state[n : 2 * n])
        ddq = np.linalg.solve(M, effort(state) - b - viscous * state[n : 2 * n])
        return np.concatenate([state[n : 2 * n], ddq, target - state[:n]])

    start = np.concatenate([q, np.zeros(2 * n)])
    solution = solve_ivp(slope, (0.0, duration), start, method="Radau", rtol=RELATIVE, atol=ABSOLUTE)
    if not solution.success:
        raise ArithmeticError(f"the solver stopped at {solution.t[-1]:g} s: {solution.message}")
    q_t, dq_t = solution.y[:n].T, solution.y[n : 2 * n].T
    V = [lyapunov(at(plant, x, dx)[0], dx, law.proportional, target - x) for x, dx in zip(q_t, dq_t, strict=True)]
    efforts = np.array([effort(state) for state in solution.y.T])
    return Regulated(solution.t, q_t, dq_t, efforts, np.array(V))


def at(plant: Plant, q: Array, dq: Array) -> tuple[Array, Array]:
    """Inertia (n, n) and bias (n,) of a plant at one configuration."""
    M, b = np.empty((len(q), len(q))), np.empty(len(q))
    plant.dynamics(plant.data, np.ascontiguousarray(q), np.ascontiguousarray(dq), M, b)
    return M, b
