"""Trajectories of all joints at once: those that tell most about the arm as one, links, rotors and friction together.

    tau = Y(q, dq, ddq) pi + diag(ddq) J_m + diag(dq) v + diag(sign(dq)) c                            (6.3), (A.16)

The columns that no motion tells apart are left out, so the criterion is that of the arm's base parameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.optimize import LinearConstraint, minimize

from pipeline.maths.arrays import Array
from pipeline.maths.excitation.fourier import Fourier, basis, instants, turning_points
from pipeline.maths.excitation.joint import CRITERIA, GRID, ExcitationProblem, design, inequalities, within
from pipeline.maths.mechanics.chain import Chain
from pipeline.maths.mechanics.rigid_body import base_parameters, regressor

RICH = 200  # random samples that show which columns depend on others
STEP = 1e-7  # of a coefficient, for derivatives of F
EXCHANGES = 2  # times that the instants where a limit was exceeded are added


@dataclass(frozen=True)
class ArmExcitationProblem:
    """The first joints of an arm, to be excited together; all of them share period, samples and criterion."""

    chain: Chain
    joints: tuple[ExcitationProblem, ...]
    columns: NDArray[np.int64]  # of all columns, those of the base parameters (p,)


def arm_problem(chain: Chain, joints: Sequence[ExcitationProblem]) -> ArmExcitationProblem:
    """The problem, with the base parameters of the arm."""
    q, dq, ddq = np.random.default_rng(0).uniform(-1, 1, (3, RICH, len(joints)))
    return ArmExcitationProblem(chain, tuple(joints), base_parameters(_all_columns(chain, q, dq, ddq)).columns)


def arm_observation(problem: ArmExcitationProblem, series: Sequence[Fourier]) -> Array:
    """F (K n, p) of the base parameters over one period, the joints of a sample below each other.  (6.19)"""
    return _observation(problem, np.concatenate([one.x for one in series]))


def design_together(problem: ArmExcitationProblem, starts: int, seed: int) -> list[Fourier]:
    """The best of several local optima; each start is the joints' own best trajectories of another seed.

    Raises
    ------
    ValueError
        If a joint's limits cannot be kept, or if no trajectory tells its terms apart.
    """
    optima = [_local(problem, [design(joint, 4, seed + i) for joint in problem.joints]) for i in range(starts)]
    return min(optima, key=lambda series: CRITERIA[problem.joints[0].criterion](arm_observation(problem, series))[0])


def _local(problem: ArmExcitationProblem, series: list[Fourier]) -> list[Fourier]:
    first = problem.joints[0]
    times = [[instants(first.period, GRID * joint.harmonics)] * 3 for joint in problem.joints]
    for _ in range(EXCHANGES):
        A, low, high = zip(*(inequalities(j, t) for j, t in zip(problem.joints, times, strict=True)), strict=True)
        kept = LinearConstraint(block_diag(*A), np.concatenate(low), np.concatenate(high))
        options: Any = {"maxiter": 40, "ftol": 1e-6}
        x = np.concatenate([one.x for one in series])
        result = minimize(partial(_cost, problem), x, jac=True, method="SLSQP", constraints=[kept], options=options)
        if not np.isfinite(result.x).all() or not np.isfinite(result.fun):
            break
        series = [Fourier.of(part, first.period) for part in _parts(problem, result.x)]
        times = [
            [np.concatenate([t, more]) for t, more in zip(known, turning_points(one), strict=True)]
            for known, one in zip(times, series, strict=True)
        ]
    return [within(joint, one) for joint, one in zip(problem.joints, series, strict=True)]


def _cost(problem: ArmExcitationProblem, x: Array) -> tuple[float, Array]:
    """The criterion and its gradient; the jumps of friction at dq = 0 have no derivative and are left out."""
    F = _observation(problem, x)
    value, by_F = CRITERIA[problem.joints[0].criterion](F)
    smooth = problem.columns < 10 * len(problem.chain.parent) + 2 * len(problem.joints)
    gradient = np.empty_like(x)
    for i in range(len(x)):
        ahead = x.copy()
        ahead[i] += STEP
        gradient[i] = (by_F * (_observation(problem, ahead) - F))[:, smooth].sum() / STEP
    return value, gradient


def _observation(problem: ArmExcitationProblem, x: Array) -> Array:
    first = problem.joints[0]
    t = instants(first.period, first.samples)
    bases = [basis(first.period, joint.harmonics, t) for joint in problem.joints]
    parts = _parts(problem, x)
    q, dq, ddq = (np.column_stack([B[i] @ part for B, part in zip(bases, parts, strict=True)]) for i in range(3))
    return _all_columns(problem.chain, q, dq, ddq).reshape(-1, 10 * len(problem.chain.parent) + 3 * q.shape[1])[
        :, problem.columns
    ]


def _all_columns(chain: Chain, q: Array, dq: Array, ddq: Array) -> Array:
    """The links' inertial parameters, then rotors, viscous and Coulomb friction of the n joints (K, n, 10 L + 3 n)."""
    each = np.eye(q.shape[1])
    drives = [values[:, :, None] * each for values in (ddq, dq, np.sign(dq))]
    return np.concatenate([regressor(chain, q, dq, ddq), *drives], axis=2)


def _parts(problem: ArmExcitationProblem, x: Array) -> list[Array]:
    ends = np.cumsum([1 + 2 * joint.harmonics for joint in problem.joints])
    return np.split(x, ends[:-1])
