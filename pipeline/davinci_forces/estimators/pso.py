"""Particle swarm optimisation: the physical parameters of a joint, searched in a box.  Section 6.5

    V = w V + C_1 r_1 (P_best - p) + C_2 r_2 (G_best - p),    p = p + V              (6.51), (6.52)

The optimum that a swarm reaches depends on its walls and weights: particles that are clipped to a wall stay on it.
Without a table of physical parameters, the search is over those of the model, `REACH` standard errors around least
squares; inertia and friction are not negative.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.estimators.problem import Estimate, Regression, Search, standard_errors
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation.least_squares import Triangle, solve_bounded
from davinci_forces.maths.models.physical import Box, Lumping

NAME = "particle swarm"
SEED = 0
REACH = 10.0  # standard errors
PARTICLES, MAX_ITERATIONS, PATIENCE = 24, 3000, 150  # PATIENCE: iterations without a change; section 6.5.1
CHANGE = 1e-9  # a smaller share of the squared error is no change
ITERATIONS_DRAWN = 50  # number of iterations whose random numbers are drawn together
SWARMS = 4  # largest number of swarms that run until two agree
AGREE = 1e-7  # largest difference of two agreeing swarms, as a share of the squared error


class Manner(NamedTuple):
    """Weights and walls of a swarm."""

    name: str  # what its walls do
    inertia: tuple[float, float]  # w at first, and after `falls` iterations
    falls: int
    cognitive: float  # C_1
    social: float  # C_2
    reflects: bool  # whether walls reflect particles, or stop them


# Clerc and Kennedy, 2002.
CONSTRICTED = Manner("reflecting", (0.7298, 0.7298), 1, 1.49618, 1.49618, True)
# The defaults of the toolbox that the thesis used (Birge, 2003), and particles clipped to the box.
THESIS = Manner("clipping", (0.9, 0.4), 1500, 2.0, 2.0, False)


class SwarmOptimum(NamedTuple):
    """The optimum of a swarm."""

    x: Array  # (n,)
    theta: Array  # (p,)
    squares: float  # |W^(1/2) (tau - Phi theta)|^2
    history: Array  # (I,) smallest squares after each iteration
    swarms: int  # number of swarms that ran


def search(R: Triangle, box: Box, seed: int, manner: Manner = CONSTRICTED) -> SwarmOptimum:
    """Run swarms until the squares of two agree, and return the best; the same seed gives the same result."""
    best = swarm(R, box, np.random.default_rng([seed, 0]), manner)
    for number in range(1, SWARMS):
        result = swarm(R, box, np.random.default_rng([seed, number]), manner)
        agree = abs(result.squares - best.squares) <= AGREE * best.squares
        best = min(best, result, key=lambda run: run.squares)._replace(swarms=number + 1)
        if agree:
            break
    return best


def swarm(R: Triangle, box: Box, random: np.random.Generator, manner: Manner) -> SwarmOptimum:
    """Run one swarm from random places of the box until its best has not changed for `PATIENCE` iterations."""
    from davinci_forces.maths.estimation import kernels

    n, C = len(box.lower), np.ascontiguousarray((R.U * R.scale) @ box.lumping.coefficients)
    x = np.ones((PARTICLES, n + 1))
    x[:, :n] = random.uniform(box.lower, box.upper, (PARTICLES, n))
    v, best, costs = np.zeros((PARTICLES, n)), x.copy(), R.excess(box.lumping.theta(x[:, :n]))
    history = np.full(MAX_ITERATIONS, np.inf)
    first, last = manner.inertia
    for start in range(0, MAX_ITERATIONS, ITERATIONS_DRAWN):
        w = first + (last - first) * np.minimum(np.arange(start, start + ITERATIONS_DRAWN) / manner.falls, 1.0)
        r = random.random((ITERATIONS_DRAWN, PARTICLES, n, 2))
        bounds = (box.lower, box.upper, box.lumping.factors, C, R.y)
        window = history[start : start + ITERATIONS_DRAWN]
        kernels.fly(x, v, best, costs, *bounds, r, w, manner.cognitive, manner.social, manner.reflects, window)
        done = start + ITERATIONS_DRAWN
        if done > PATIENCE and history[done - 1 - PATIENCE] - window[-1] <= CHANGE * (R.min_squares + window[-1]):
            break
    leader = best[int(costs.argmin()), :n]
    history = history[:done] + R.min_squares
    return SwarmOptimum(leader, box.lumping.theta(leader), float(history[-1]), history, 1)


def estimate(problem: Regression) -> Estimate:
    """Find theta of the physical parameters in the box that minimise |tau - Phi theta|.  (6.56)

    The standard errors are those of least squares, which are too large for a parameter at the edge of its box.
    """
    R = problem.triangle
    box = problem.known.box or box_around(R, problem)
    theta = search(R, box, SEED).theta
    return Estimate(
        theta,
        lambda: standard_errors(problem, theta),
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
