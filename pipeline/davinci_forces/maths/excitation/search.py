"""Minimise a function of a few numbers with kinks and jumps, without derivatives.

Differential evolution takes the directions and sizes of its steps from the spread of a population.
R. Storn and K. Price, Differential evolution, Journal of Global Optimization 11, 1997 (best/1/bin).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array

POPULATION = 5  # candidates a dimension
GENERATIONS = 24  # a dimension
COLLAPSED = 1e-6  # range of the objective, below which a population is spread anew
SPREAD = (1e-6, 0.1)  # sizes of the steps by which it is, small ones as likely as large ones
STEP_FACTORS = (0.5, 1.0)  # of a difference between two candidates
CROSSING = 0.9  # share of the numbers that a step changes

Objective = Callable[[Array], Array]  # of many candidates (S, d) at once (S,)
ReportStart = Callable[[int, int, float], None]  # the number of a start, from 1, of how many, and its optimum


class Optimum(NamedTuple):
    """The best candidate (d,) of several starts, and the lowest value of each of them (starts,)."""

    z: Array
    values: Array


def ignore_start(start: int, starts: int, value: float) -> None:
    """Say nothing of a start."""


def minimise(objective: Objective, d: int, starts: int, seed: int, report_start: ReportStart = ignore_start) -> Optimum:
    """Minimise from several starts; the first ones are the same for any number of starts."""
    optima = []
    for start in range(starts):
        optima.append(descend(objective, d, np.random.default_rng([seed, start])))
        report_start(start + 1, starts, optima[-1][1])
    values = np.array([value for _, value in optima])
    return Optimum(optima[int(values.argmin())][0], values)


def descend(objective: Objective, d: int, random: np.random.Generator) -> tuple[Array, float]:
    """Evolve one population; return its best candidate (d,) and the value.

    A collapsed population is spread about its best candidate, so that it also finds minima beyond a jump nearby.
    """
    z = random.normal(size=(POPULATION * d, d))
    value = objective(z)
    for _ in range(GENERATIONS * d):
        if value.max() <= value.min() + COLLAPSED:
            z = _spread(z[value.argmin()], len(z), random)
            value = objective(z)
        candidates = _steps(z, z[value.argmin()], random)
        new = objective(candidates)
        better = new < value
        z[better], value[better] = candidates[better], new[better]
    return z[value.argmin()], float(value.min())


def _steps(z: Array, best: Array, random: np.random.Generator) -> Array:
    """A candidate (n, d) for each of the population."""
    a, b = random.integers(len(z), size=(2, len(z)))
    moved = best + random.uniform(*STEP_FACTORS) * (z[a] - z[b])
    return np.where(random.uniform(size=z.shape) < CROSSING, moved, z)


def _spread(best: Array, n: int, random: np.random.Generator) -> Array:
    """A population (n, d) about its best, which stays in it."""
    smallest, largest = np.log10(SPREAD).tolist()
    size = 10 ** random.uniform(smallest, largest, size=(n, 1))
    size[0] = 0.0
    return np.asarray(best + size * random.normal(size=(n, len(best))))
