"""A candidate's parameters held to what some mechanism has: its own criterion, ridge and all, and what that costs."""

from typing import NamedTuple

import numpy as np

from davinci_forces.identification.candidates import Library
from davinci_forces.identification.chosen import BlockEstimate
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation.conic import nearest
from davinci_forces.maths.estimation.least_squares import Triangle
from davinci_forces.maths.models.model import Model
from davinci_forces.maths.selection.ridge import Equations, Ridge, scaled_equations

NOTHING = 1e-8  # of the effort's square, below which it costs nothing that the solver would tell


class Held(NamedTuple):
    """Parameters that a mechanism can have, and what each effort's model errs by with them and without."""

    estimate: BlockEstimate
    rmse: Array  # (m,)
    rmse_free: Array  # (m,)
    excess: float  # of the criterion over its least, as a share of the effort's square


def held(model: Model, library: Library, equations: Equations, ridge: Ridge, free: BlockEstimate) -> Held:
    """The parameters nearest to a candidate's that a mechanism can have, from the equations (of one cell) of all logs.

    The standard errors stay the candidate's, as those of the estimator `consistent` stay least squares'.

    Raises
    ------
    NotIdentifiable
        If the conic program is not solved.
    """
    made = nearest(factor(equations, ridge), model.mechanism)
    errors, squares = equations.errors(made.theta)[0], float(equations.squares.sum())
    estimate = free._replace(
        theta=made.theta, mse=float((errors / library.samples).sum()), r2=float(1.0 - errors.sum() / squares)
    )
    rmse, rmse_free = (np.sqrt(x / library.samples) for x in (errors, equations.errors(free.theta)[0]))
    return Held(estimate, rmse, rmse_free, made.excess)


def factor(equations: Equations, ridge: Ridge) -> Triangle:
    """A triangle that asks for the same parameters as a ridge: |U D theta - y|^2 but for a constant.

    U' U = D^-1 (G + lambda P) D^-1, and U' y = D^-1 r
    """
    scaled, size = scaled_equations(equations, ridge)
    U = np.asarray(np.linalg.cholesky(scaled).T, np.float64)
    y = np.linalg.solve(U.T, ridge.weights @ equations.right[0] / size)
    return Triangle(U, y, max(float(ridge.weights @ equations.squares[0] - y @ y), 0.0), size)
