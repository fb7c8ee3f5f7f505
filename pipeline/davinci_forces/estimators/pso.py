"""Particle swarm optimisation: the physical parameters of a joint, searched in a box.  Section 6.5

Without a table of physical parameters, the search is over those of the model, `REACH` standard errors around least
squares; inertia and friction are not negative.
"""

import numpy as np

from davinci_forces.estimators.problem import Estimate, Regression, Search, standard_errors
from davinci_forces.maths.estimation.least_squares import Triangle, solve_bounded
from davinci_forces.maths.estimation.swarm import CONSTRICTED, PARTICLES, THESIS, Manner, search
from davinci_forces.maths.models.physical import Box, Lumping

NAME = "particle swarm"
SEED = 0
REACH = 10.0  # standard errors


def estimate(problem: Regression) -> Estimate:
    """Find theta of the physical parameters in the box that minimise |tau - Phi theta|.  (6.56)

    The standard errors are those of least squares, which are too large for a parameter at the edge of its box.
    """
    weight, R = problem.weight, problem.triangle
    box = problem.known.box or box_around(R, problem)
    theta = search(R, box, SEED).theta
    return Estimate(
        theta,
        lambda: standard_errors(problem, weight, R, theta),
        lambda: tuple(run_search(R, box, problem, manner) for manner in (CONSTRICTED, THESIS)),
    )


def box_around(R: Triangle, problem: Regression) -> Box:
    """Return a box around least squares that contains the best parameters with the known signs."""
    K, p = int((problem.periods > 0).sum()), len(R.y)
    std = np.sqrt(R.min_squares / (K - p) * (np.linalg.inv(R.U) ** 2).sum(axis=1)) / R.scale
    theta, positive = R.theta, problem.known.signs(p)
    std = np.maximum(std, np.finfo(float).eps * np.abs(theta))  # data without noise have no error
    missing = np.max(-theta[positive] / std[positive], initial=0.0)
    reach = (REACH + missing) * std
    bound = np.where(positive, 0.0, -np.inf)
    themselves = Lumping(np.column_stack([np.arange(p), np.full((p, 2), p)]), np.eye(p))  # theta = x
    return Box(np.maximum(theta - reach, bound), np.maximum(theta + reach, bound), themselves)


def run_search(R: Triangle, box: Box, problem: Regression, manner: Manner) -> Search:
    """Run a search, and compare it with least squares under the known signs."""
    result = search(R, box, SEED, manner)
    total = float(problem.periods.sum())
    least = R.min_squares + float(R.excess(solve_bounded(R, problem.known.signs(len(R.y)))))
    return Search(
        walls=manner.name,
        seed=SEED,
        particles=PARTICLES,
        searched=len(box.lower),
        swarms=result.swarms,
        excess=result.squares / max(least, np.finfo(float).tiny) - 1.0,
        history=np.asarray(result.history / total),
        theta=result.theta,
    )
