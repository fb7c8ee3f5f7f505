"""Instrumental variables: parameters that noise of the measured motion does not bias towards zero.

Noise of positions and velocities enters the regressor, and least squares treat it as motion.  The motion a few samples
before and after is as informative, but its noise is independent.  Periods averaged over the excitation's harmonics have
little noise, so both estimators agree on them.
"""

import numpy as np

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators.problem import MAX_CONDITION, MIN_PART_NAMED, Estimate, Regression, standard_errors_by
from davinci_forces.maths.estimation.least_squares import dependent_parameters

NAME = "instrumental variables"
LAG = 3  # samples before and after: a low-pass does not correlate noise over this lag


def estimate(problem: Regression) -> Estimate:
    """theta = (Z' Phi)^-1 Z' tau with instruments Z_k = Phi_(k-3) + Phi_(k+3); each log is a period.

    Raises NotIdentifiable if the instruments do not separate the parameters, or if least squares raise this error.
    """
    R, root = problem.triangle, np.sqrt(problem.weight)[:, None]
    F = problem.Phi * root / R.scale
    parts = np.split(problem.Phi, problem.starts[1:])
    Z = np.concatenate([np.roll(part, LAG, axis=0) + np.roll(part, -LAG, axis=0) for part in parts])
    Q, _ = np.linalg.qr(Z * root)  # which the scale of a column of Z does not change
    ZF = Q.T @ F
    if (condition := np.linalg.cond(ZF)) > MAX_CONDITION:
        alike = ", ".join(problem.names[i] for i in dependent_parameters(ZF, MIN_PART_NAMED))
        motion = f"the motion {LAG} samples before and after"
        raise NotIdentifiable(f"{motion} does not separate {alike}: condition number {condition:.1e}")
    theta = np.linalg.solve(ZF, Q.T @ (problem.tau * root[:, 0])) / R.scale
    return Estimate(theta, lambda: standard_errors_by(problem, theta, Q, np.linalg.inv(ZF) / R.scale[:, None]))
