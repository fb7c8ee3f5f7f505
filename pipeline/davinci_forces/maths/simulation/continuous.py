"""The control studies of chapter 5: continuous controllers and viscous friction, with an implicit adaptive solver.

The solver is implicit because the wrist has small inertias and high gains: explicit steps would take microseconds.
"""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.mechanics.kernels import mass_and_bias
from davinci_forces.maths.simulation.actuators import Regulator
from davinci_forces.maths.simulation.closed_loop import Plant

RELATIVE, ABSOLUTE = 1e-7, 1e-10


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
    (n,) is the friction.  The samples are the solver's steps, so that V = dq' M dq / 2 + e' K_p e / 2 is not
    interpolated; under PD with gravity compensation it never rises.  (5.8), (5.9), (5.17)
    """
    n = len(q)
    M, b, G, rest = np.empty((n, n)), np.empty(n), np.empty(n), np.zeros(n)

    def effort(q: Array, dq: Array, integral: Array) -> Array:
        """The controller's effort (n,); M and b are filled with the arm's inertia and bias.  (5.17)"""
        mass_and_bias(model.tree, GRAVITY, q, rest, M, G)  # G is the gravity that the compensation assumes
        mass_and_bias(plant.tree, GRAVITY, q, dq, M, b)
        return law.proportional * (target - q) - law.derivative * dq + law.gravity * G + law.integral * integral

    def slope(_: float, state: Array) -> Array:
        """The time derivative of a state (3 n,): position, velocity, integral of the error.  (4.28)"""
        q, dq, integral = np.ascontiguousarray(state).reshape(3, n)
        tau = effort(q, dq, integral)
        return np.concatenate([dq, np.linalg.solve(M + inertia, tau - b - viscous * dq), target - q])

    def jacobian(_: float, state: Array) -> Array:
        """d slope / d state (3 n, 3 n) without the small change of M and b; differences would be rounding at rest."""
        q, dq = np.ascontiguousarray(state).reshape(3, n)[:2]
        mass_and_bias(plant.tree, GRAVITY, q, dq, M, b)
        gains = (-law.proportional, -law.derivative - viscous, law.integral)
        accelerations = np.linalg.solve(M + inertia, np.hstack([np.diag(gain) for gain in gains]))
        zero, one = np.zeros((n, n)), np.eye(n)
        return np.block([[zero, one, zero], [accelerations], [-one, zero, zero]])

    start, inertia = np.concatenate([q, np.zeros(2 * n)]), np.diag(plant.rotors)
    solution = solve_ivp(slope, (0.0, duration), start, method="Radau", jac=jacobian, rtol=RELATIVE, atol=ABSOLUTE)
    if not solution.success:
        raise ArithmeticError(f"the solver stopped at {solution.t[-1]:g} s: {solution.message}")
    states = solution.y.T.reshape(-1, 3, n).copy()
    V, efforts = np.empty(len(states)), np.empty((len(states), n))
    for k, state in enumerate(states):
        efforts[k] = effort(*state)
        dq, error = state[1], target - state[0]
        V[k] = dq @ (M + inertia) @ dq / 2 + error @ (law.proportional * error) / 2
    return Regulated(solution.t, states[:, 0], states[:, 1], efforts, V)
