"""Design the most informative trajectories of all joints together, to identify links, rotors and friction of the arm.

    tau = Y(q, dq, ddq) pi + diag(ddq) J_m + diag(dq) v + diag(sign(dq)) c                            (6.3), (A.16)

Dependent columns are omitted, so that the criterion refers to the base parameters of the arm.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.excitation.fourier import CRITERIA, Fourier, basis, instants
from davinci_forces.maths.excitation.joint import (
    ExcitationProblem,
    delay,
    from_standstill,
    impossible,
    scale_to_limits,
    shrink_into_limits,
)
from davinci_forces.maths.excitation.search import ReportStart, ignore_start, minimise
from davinci_forces.maths.mechanics.bodies import RANDOM_SAMPLES, base_parameters
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.rigid_body import compiled_regressor

TRAJECTORIES_AT_ONCE = 8  # the regressors of this many trajectories fit into a processor's cache


@dataclass(frozen=True)
class ArmExcitationProblem:
    """The excitation of the first joints of an arm together; they share period, samples and criterion."""

    chain: Chain
    joints: tuple[ExcitationProblem, ...]
    columns: NDArray[np.int64]  # indices of the base parameters' columns among all columns (p,)


class ArmDesign(NamedTuple):
    """The designed trajectory of each joint, and the lowest criterion of each start (starts,)."""

    series: list[Fourier]
    optima: Array


def arm_problem(chain: Chain, joints: Sequence[ExcitationProblem]) -> ArmExcitationProblem:
    """The excitation problem of these joints, with the base parameters of the arm."""
    q, dq, ddq = np.random.default_rng(0).uniform(-1, 1, (3, RANDOM_SAMPLES, len(joints)))
    all_columns = np.arange(10 * len(chain.parent) + 3 * len(joints))
    return ArmExcitationProblem(chain, tuple(joints), base_parameters(_columns(chain, q, dq, ddq, all_columns)).columns)


def arm_observation(problem: ArmExcitationProblem, series: Sequence[Fourier]) -> Array:
    """F (K n, p) of the base parameters over one period, the joints of a sample below each other.  (6.19)"""
    return np.asarray(_observations(problem, [joint_series.x[None] for joint_series in series])[0])


def design_together(
    problem: ArmExcitationProblem, starts: int, seed: int, report_start: ReportStart = ignore_start
) -> ArmDesign:
    """Design the trajectories of the best of several starts of the search.

    Raises
    ------
    ValueError
        If a joint's limits cannot be kept, or if the regressor of every trajectory is rank deficient.
    """
    if reason := next(filter(None, (impossible(joint.limits) for joint in problem.joints)), ""):
        raise ValueError(reason)
    criterion = CRITERIA[problem.joints[0].criterion]

    def objective(z: Array) -> Array:
        chunks = (z[i : i + TRAJECTORIES_AT_ONCE] for i in range(0, len(z), TRAJECTORIES_AT_ONCE))
        return np.concatenate([criterion(_observations(problem, _trajectories(problem, chunk))) for chunk in chunks])

    best = minimise(objective, sum(1 + 2 * joint.harmonics for joint in problem.joints), starts, seed, report_start)
    if not np.isfinite(best.values).any():
        raise ValueError("no trajectory of these harmonics identifies all base parameters of the arm")
    parts = zip(problem.joints, _trajectories(problem, best.z[None]), strict=True)
    return ArmDesign(
        [shrink_into_limits(joint, Fourier.from_coefficients(x[0], joint.period)) for joint, x in parts], best.values
    )


def _trajectories(problem: ArmExcitationProblem, z: Array) -> list[Array]:
    """Coefficients (S, 1 + 2 N_f) of each joint within its limits; the first joint starts at rest, up to the delay."""
    first = problem.joints[0]
    ends = np.cumsum([1 + 2 * joint.harmonics for joint in problem.joints])
    lead, *others = np.split(z, ends[:-1], axis=1)
    lead, phase = from_standstill(lead, first.samples)
    parts = zip(problem.joints, (lead, *others), strict=True)
    return [scale_to_limits(delay(part, phase), joint.limits, first.period) for joint, part in parts]


def _observations(problem: ArmExcitationProblem, x: Sequence[Array]) -> Array:
    """F (S, K n, p) of many trajectories, from the coefficients (S, 1 + 2 N_f) of each joint."""
    first = problem.joints[0]
    t = instants(first.period, first.samples)
    bases = [basis(first.period, joint.harmonics, t) for joint in problem.joints]
    q, dq, ddq = (np.stack([part @ B[i].T for B, part in zip(bases, x, strict=True)], axis=-1) for i in range(3))
    return _columns(problem.chain, q, dq, ddq, problem.columns)


def _columns(chain: Chain, q: Array, dq: Array, ddq: Array, columns: NDArray[np.int64]) -> Array:
    """The selected columns (..., K n, p) of F; q, dq and ddq are (..., K, n).

    The 10 L + 3 n columns are the inertial parameters of links, then rotors, viscous and Coulomb friction of joints.
    """
    links = 10 * len(chain.parent)
    of_links = columns[columns < links]
    F = np.zeros((*q.shape, len(columns)))
    F[..., : len(of_links)] = compiled_regressor(chain, q, dq, ddq)[..., of_links]
    for i in range(len(of_links), len(columns)):
        kind, joint = divmod(columns[i] - links, q.shape[-1])
        F[..., joint, i] = (ddq, dq, np.sign(dq))[kind][..., joint]
    return F.reshape(*q.shape[:-2], -1, len(columns))
