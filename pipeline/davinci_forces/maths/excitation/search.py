"""Minimise a function of a few variables, without derivatives; the function may have kinks and jumps.

Differential evolution takes its steps from the differences between candidates of a population.
R. Storn and K. Price, Differential evolution, Journal of Global Optimization 11, 1997 (best/1/bin).
"""

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from davinci_forces.maths.arrays import Array

POPULATION = 5  # candidates for each dimension
GENERATIONS = 24  # for each dimension
# Size of an array that is allocated and freed before the search.  From then on, glibc keeps freed memory of that size;
# otherwise it returns the memory of all trajectories at every step, which takes half of the time.
RETAINED = 2**21
COLLAPSED = 1e-6  # a population is spread again if the range of its objective is below this
SPREAD = (-6.0, -1.0)  # powers of ten of the smallest and the largest step of that spread
STEP_FACTORS = (0.5, 1.0)  # range of the factor of a difference between two candidates
CROSSING = 0.9  # share of the variables that a step changes

Objective = Callable[[Array], Array]  # of S candidates (S, d)
ReportStart = Callable[[int, int, float], None]  # takes the number of a start, from 1, of all starts, and the optimum
Result = TypeVar("Result")


def best_of_starts(
    run: Callable[[np.random.Generator], tuple[Result, float]], starts: int, seed: int,
    report_start: ReportStart | None = None,
) -> tuple[Result, Array]:  # fmt: skip
    """Search from starts, the first the same for any number: the best result, and the optimum of each (starts,)."""
    np.empty(RETAINED)
    results = []
    for start in range(starts):
        results.append(run(np.random.default_rng([seed, start])))
        if report_start:
            report_start(start + 1, starts, results[-1][1])
    optima = np.array([optimum for _, optimum in results])
    return results[int(optima.argmin())][0], optima


def descend(objective: Objective, d: int, random: np.random.Generator) -> tuple[Array, float]:
    """Evolve one population; return its best candidate (d,) and the objective there."""
    z = random.normal(size=(POPULATION * d, d))
    value = objective(z)
    for _ in range(GENERATIONS * d):
        if value.max() <= value.min() + COLLAPSED:  # finds minima beyond a nearby jump, too
            size = 10 ** random.uniform(*SPREAD, size=(len(z), 1))
            size[0] = 0.0  # the best candidate stays
            z = np.asarray(z[value.argmin()] + size * random.normal(size=z.shape))
            value = objective(z)
        a, b = random.integers(len(z), size=(2, len(z)))
        moved = z[value.argmin()] + random.uniform(*STEP_FACTORS) * (z[a] - z[b])
        candidates = np.where(random.uniform(size=z.shape) < CROSSING, moved, z)
        new = objective(candidates)
        better = new < value
        z[better], value[better] = candidates[better], new[better]
    return z[value.argmin()], float(value.min())
