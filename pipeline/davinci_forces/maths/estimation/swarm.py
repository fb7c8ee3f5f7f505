"""Particle swarm optimisation in a box.  Section 6.5

    V = w V + C_1 r_1 (P_best - p) + C_2 r_2 (G_best - p),    p = p + V              (6.51), (6.52)

The optimum that a swarm reaches depends on its walls and weights: particles that are clipped to a wall stay on it.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation.least_squares import Triangle
from davinci_forces.maths.models.physical import Box

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
