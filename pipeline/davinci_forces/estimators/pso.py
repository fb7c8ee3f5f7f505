"""Particle swarm optimisation: the physical parameters of a joint, searched in a box.  Section 6.5

A robot without a table of physical parameters is searched in those of its model, `REACH` standard errors around least
squares; inertia and friction are not negative.
"""

import numpy as np

from davinci_forces.estimators.problem import Estimate, Regression, Search, spread
from davinci_forces.maths.estimation.least_squares import Triangle, bounded
from davinci_forces.maths.estimation.swarm import CONSTRICTED, PARTICLES, THESIS, Manner, search
from davinci_forces.maths.models.physical import Box, each_for_itself

NAME = "particle swarm"
SEED = 0
REACH = 10.0  # standard errors


def estimate(problem: Regression) -> Estimate:
    """theta of the physical parameters in the box that minimise |tau - Phi theta|.  (6.56)

    The standard errors are those of least squares: of a parameter that its box holds back, they are too large.
    """
    weight, R = problem.weight, problem.triangle
    box = problem.known.box or around(R, problem)
    theta = search(R, box, SEED).theta
    return Estimate(
        theta,
        lambda: spread(problem, weight, R, theta),
        lambda: tuple(searched(R, box, problem, manner) for manner in (CONSTRICTED, THESIS)),
    )


def around(R: Triangle, problem: Regression) -> Box:
    """A box around least squares, wide enough for the best parameters of the signs that are known."""
    K, p = int((problem.periods > 0).sum()), len(R.y)
    std = np.sqrt(R.squares / (K - p) * (np.linalg.inv(R.U) ** 2).sum(axis=1)) / R.scale
    theta, positive = R.theta, problem.known.signs(p)
    std = np.maximum(std, np.finfo(float).eps * np.abs(theta))  # data without noise leave none
    missing = np.max(-theta[positive] / std[positive], initial=0.0)
    reach = (REACH + missing) * std
    lower, upper = theta - reach, theta + reach
    held = np.where(positive, 0.0, -np.inf)
    return Box(np.maximum(lower, held), np.maximum(upper, held), each_for_itself(p))


def searched(R: Triangle, box: Box, problem: Regression, manner: Manner) -> Search:
    """A search with its history, beside the least squares that the known signs allow."""
    found = search(R, box, SEED, manner)
    total = float(problem.periods.sum())
    least = R.squares + float(R.excess(bounded(R, problem.known.signs(len(R.y)))))
    return Search(
        walls=manner.name,
        seed=SEED,
        particles=PARTICLES,
        searched=len(box.lower),
        swarms=found.swarms,
        excess=found.squares / max(least, np.finfo(float).tiny) - 1.0,
        history=np.asarray(found.history / total),
        theta=found.theta,
    )
