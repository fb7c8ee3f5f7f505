"""Instrumental variables: parameters that noise of the measured motion does not pull towards zero.

Noise of positions and velocities is in the regressor, too, where least squares take it for motion.  The motion a moment
before and after is as good an indication of the motion, but its noise is another.  Where periods are averaged and only
the excitation's harmonics kept, little noise is left, and both agree.
"""

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators.problem import ALIKE, CONDITION, Estimate, Regression, spread_by
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation.least_squares import not_told_apart

NAME = "instrumental variables"
LAG = 3  # samples before and after: beyond the reach of what a low-pass leaves of noise


def estimate(problem: Regression) -> Estimate:
    """theta = (Z' Phi)^-1 Z' tau with the instruments Z_k = (Phi_(k-3) + Phi_(k+3)) / 2, each log being a period.

    Raises
    ------
    NotIdentifiable
        If the instruments do not tell the parameters apart, and where least squares raise it.
    """
    weight, R = problem.weight, problem.triangle
    root = np.sqrt(weight)[:, None]
    F = problem.Phi * root / R.scale
    Q, _ = np.linalg.qr(instruments(problem) * root / R.scale)
    seen = Q.T @ F
    if (condition := np.linalg.cond(seen)) > CONDITION:
        alike = ", ".join(problem.names[i] for i in not_told_apart(seen, ALIKE))
        said = f"the motion {LAG} samples before and after does not tell {alike} apart"
        raise NotIdentifiable(f"{said}: condition number {condition:.1e}")
    theta = np.linalg.solve(seen, Q.T @ (problem.tau * root[:, 0])) / R.scale
    return Estimate(theta, lambda: spread_by(problem, weight, theta, Q, np.linalg.inv(seen) / R.scale[:, None]))


def instruments(problem: Regression) -> Array:
    """Z (K, p): the regressor a moment before and after."""
    parts = np.split(problem.Phi, problem.starts[1:])
    return np.concatenate([(np.roll(part, LAG, axis=0) + np.roll(part, -LAG, axis=0)) / 2.0 for part in parts])
