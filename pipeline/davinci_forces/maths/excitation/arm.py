"""Design the most informative trajectories of all joints together, to identify links, rotors and friction of the arm.

    tau = Y(q, dq, ddq) pi + diag(ddq) J_m + diag(dq) v + diag(sign(dq)) c                            (6.3), (A.16)

Dependent columns are omitted, so that the criterion refers to the base parameters of the arm.

The search follows the gradient of a criterion f(F).  Each row of F depends on the motion at one instant only.  So few
perturbed motions give the gradient by all coefficients:

    df = sum_k  trace((df/dF_k)' dF_k),    F_k = F(q(t_k), dq(t_k), ddq(t_k))

Limits c(x) <= 0 are penalised by the augmented Lagrangian f + mu/2 sum max(0, c + lambda / mu)^2, and lambda becomes
mu max(0, c + lambda / mu).  Nocedal and Wright, Numerical Optimization, 2006, chapter 17.  The sign in the friction is
tanh(dq / w) with a width w that decreases.  A last scaling keeps the limits at every instant.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.excitation.fourier import CRITERIA, GRADIENTS, Fourier, basis, instants
from davinci_forces.maths.excitation.joint import ExcitationProblem, extremes, impossible, limit_share, shrink_to_limits
from davinci_forces.maths.excitation.limits import NO_OBSTACLES, ArmLimits, Obstacles, shrink_to_arm_limits
from davinci_forces.maths.excitation.search import ReportStart, best_of_starts
from davinci_forces.maths.mechanics.bodies import PARAMETERS, RANDOM_SAMPLES, Bodies, base_parameters
from davinci_forces.maths.mechanics.chain import Chain, fold_fixed_links
from davinci_forces.maths.mechanics.rigid_body import compiled_regressor

JOINT_PARAMETERS = ("rotor inertia", "viscous friction", "Coulomb friction")  # of each joint, after those of links
EXPLORED = 8  # random trajectories of a start, searched on few samples
REFINED = 3  # the best of them, searched on all samples
SAMPLES_EXPLORED = 16  # samples for each harmonic: eight in a period of the products of two harmonics
LIMIT_INSTANTS = 40  # for each harmonic; a peak between two of them is higher by at most (pi / 40)^2 / 2
# Penalties mu, with the share of the width of the friction's sign.  With the first, a limit is exceeded by a tenth.
STAGES = ((30.0, 2.0), (120.0, 1.0), (480.0, 0.5), (2e3, 0.25), (8e3, 0.125), (3e4, 0.0625))
EXPLORATION, SELECTION = 2, 3  # stages before the best trajectories are chosen
LBFGS_ITERATIONS = 60  # of L-BFGS in each stage
STEP = 1e-6  # of the differences, relative to 1 rad or m: their error is 1e-10
HUGE = 1e10  # of a motion without full rank


@dataclass(frozen=True)
class ArmExcitationProblem:
    """The excitation of the first joints of an arm together; they share period, samples and criterion."""

    chain: Chain  # of the moving links
    joints: tuple[ExcitationProblem, ...]
    columns: NDArray[np.int64]  # indices of the base parameters' columns among all columns (p,)
    limits: ArmLimits


class Stage(NamedTuple):
    """A problem with its bases: what the search needs at each step."""

    problem: ArmExcitationProblem
    bases: list[tuple[Array, Array, Array]]  # at the samples of the criterion, for each joint
    joint_limits: list[tuple[Array, Array]]  # A (6 G, 1 + 2 N_f), b (6 G,) of each joint: A x - b is its excess
    scale: Array  # of the velocity of each joint (n,)

    @classmethod
    def with_samples(cls, problem: ArmExcitationProblem, samples: int) -> "Stage":
        """The stage whose criterion has this many samples."""
        period, harmonics = problem.joints[0].period, [joint.harmonics for joint in problem.joints]
        t, dense = instants(period, samples), instants(period, LIMIT_INSTANTS * max(harmonics))
        half = np.ptp(np.array([joint.limits for joint in problem.joints]), axis=-1) / 2  # (n, 3)
        top = 2 * np.pi / period * np.array(harmonics)
        scale = np.min([half[:, 0] * 2 * np.pi / period, half[:, 1], half[:, 2] / top], axis=0)
        joint_limits = [_joint_limits(joint, basis(period, joint.harmonics, dense)) for joint in problem.joints]
        return cls(problem, [basis(period, N, t) for N in harmonics], joint_limits, scale)

    def coefficients(self, z: Array) -> list[Array]:
        """The coefficients of each joint: z in units of its scale, about the middle of its positions."""
        parts = np.split(z, np.cumsum([1 + 2 * joint.harmonics for joint in self.problem.joints])[:-1])
        return [joint.centre + s * part for joint, s, part in zip(self.problem.joints, self.scale, parts, strict=True)]

    def motion(self, x: Sequence[Array]) -> list[Array]:
        """Position, velocity and acceleration (K, n) at the samples of the criterion."""
        return [np.stack([B[i] @ c for B, c in zip(self.bases, x, strict=True)], axis=-1) for i in range(3)]

    def width(self, share: float) -> Array:
        """The width (n,) of the friction's sign: a share of the change of velocity between two samples."""
        N = max(joint.harmonics for joint in self.problem.joints)
        return np.asarray(share * self.scale * 2 * np.pi * N / len(self.bases[0][0]))


def arm_problem(
    chain: Chain,
    joints: Sequence[ExcitationProblem],
    bodies: Bodies | None = None,
    efforts: Sequence[float] = (),
    obstacles: Obstacles = NO_OBSTACLES,
) -> ArmExcitationProblem:
    """The excitation problem of these joints, with the arm's base parameters; `efforts` (n,) limit known bodies."""
    n = len(joints)
    parameters = np.zeros(10 * len(chain.parent)) if bodies is None else bodies.parameters(n)
    moving, merged = fold_fixed_links(chain.with_coordinates(n), parameters.reshape(-1, 10))
    q, dq, ddq = np.random.default_rng(0).uniform(-1, 1, (3, RANDOM_SAMPLES, n))
    F = _columns(compiled_regressor(moving, q, dq, ddq), dq, ddq, np.arange(10 * len(moving.parent) + 3 * n))
    limits = ArmLimits(moving, None if bodies is None else merged.ravel(), tuple(efforts), obstacles)
    return ArmExcitationProblem(moving, tuple(joints), base_parameters(F.reshape(-1, F.shape[-1])).columns, limits)


def arm_observation(problem: ArmExcitationProblem, series: Sequence[Fourier]) -> Array:
    """F (K n, p) of the base parameters over one period, the joints of a sample below each other.  (6.19)"""
    q, dq, ddq = Stage.with_samples(problem, problem.joints[0].samples).motion([s.x for s in series])
    F = _columns(compiled_regressor(problem.chain, q, dq, ddq), dq, ddq, problem.columns)
    return F.reshape(-1, len(problem.columns))


def parameter_of(problem: ArmExcitationProblem, column: int) -> tuple[int | None, str]:
    """The name of a column of F, and the index of its joint; None for a parameter of a link."""
    link, which = divmod(column, 10)
    if link < len(problem.chain.links):
        return None, f"{PARAMETERS[which]} of {problem.chain.links[link]}"
    kind, joint = divmod(column - 10 * len(problem.chain.links), len(problem.joints))
    return joint, JOINT_PARAMETERS[kind]


def design_together(
    problem: ArmExcitationProblem, starts: int, seed: int, report_start: ReportStart | None = None
) -> tuple[list[Fourier], Array]:
    """Design the trajectories of the best of several starts, and return the criterion of each start (starts,), too.

    Raises ValueError if a joint's limits cannot be kept, or if the regressor of every trajectory is rank deficient.
    """
    if reason := next(filter(None, (impossible(joint.limits) for joint in problem.joints)), ""):
        raise ValueError(reason)
    series, optima = best_of_starts(lambda random: _design(problem, random), starts, seed, report_start)
    if not np.isfinite(optima).any():
        raise ValueError("no trajectory of these harmonics within the limits identifies all base parameters of the arm")
    return series, optima


def _design(problem: ArmExcitationProblem, random: np.random.Generator) -> tuple[list[Fourier], float]:
    """The best trajectory of one start, and its criterion: explore many, refine a few, finish the best."""
    K, N = problem.joints[0].samples, max(joint.harmonics for joint in problem.joints)
    coarse, fine = Stage.with_samples(problem, min(K, SAMPLES_EXPLORED * N)), Stage.with_samples(problem, K)
    explored = [_descend(coarse, _random(coarse, random), 0, EXPLORATION)[0] for _ in range(EXPLORED)]
    explored.sort(key=lambda z: _result(fine, z)[1])
    refined = [_descend(fine, z, 0, SELECTION) for z in explored[:REFINED]]
    z, multipliers = min(refined, key=lambda pair: _result(fine, pair[0])[1])
    return _result(fine, _descend(fine, z, SELECTION, len(STAGES), multipliers)[0])


def _random(stage: Stage, random: np.random.Generator) -> Array:
    """Random harmonics that touch a limit of each joint, about the middle of its positions."""
    parts = []
    for joint, scale in zip(stage.problem.joints, stage.scale, strict=True):
        c = random.normal(size=(1, 2 * joint.harmonics))
        parts += [np.zeros(1), c[0] / limit_share(*extremes(c, joint.period), joint.limits)[0] / scale]
    return np.concatenate(parts)


def _result(stage: Stage, z: Array) -> tuple[list[Fourier], float]:
    """A trajectory shrunk into all limits, and its criterion."""
    joints = stage.problem.joints
    series = [
        shrink_to_limits(joint, Fourier.from_coefficients(x, joint.period))
        for joint, x in zip(joints, stage.coefficients(z), strict=True)
    ]
    within = shrink_to_arm_limits(stage.problem.limits, series)
    if within is None:
        return series, np.inf
    return within, float(CRITERIA[joints[0].criterion](arm_observation(stage.problem, within)))


def _descend(
    stage: Stage, z: Array, first: int, last: int, multipliers: list[Array] | None = None
) -> tuple[Array, list[Array] | None]:
    """Descend from z through stages of the augmented Lagrangian; return the last z and its multipliers."""
    from scipy.optimize import minimize  # here, so that not every command loads it

    for penalty, share in STAGES[first:last]:

        def lagrangian(z: Array) -> tuple[float, Array]:
            return _lagrangian(stage, z, penalty, multipliers, stage.width(share))[:2]  # noqa: B023

        z = minimize(lagrangian, z, jac=True, method="L-BFGS-B", options={"maxiter": LBFGS_ITERATIONS, "maxcor": 30}).x
        multipliers = _lagrangian(stage, z, penalty, multipliers, stage.width(share))[2]
    return z, multipliers


def _lagrangian(
    stage: Stage, z: Array, mu: float, multipliers: list[Array] | None, width: Array
) -> tuple[float, Array, list[Array]]:
    """The augmented Lagrangian, its gradient by z, and the next multipliers."""
    problem, limits, x = stage.problem, stage.problem.limits, stage.coefficients(z)
    q, dq, ddq = stage.motion(x)
    Y = compiled_regressor(problem.chain, q, dq, ddq)
    F = _columns(Y, dq, ddq, problem.columns, width)
    value, dF = GRADIENTS[problem.joints[0].criterion](F.reshape(-1, F.shape[-1]))
    if not np.isfinite(dF).all():
        return HUGE, np.zeros_like(z), multipliers or []
    before = multipliers or [np.zeros(1)] * (1 + len(x))
    after = [mu * np.maximum(0.0, limits.excess(q, Y) + before[0] / mu)]
    weights = np.zeros((*q.shape, Y.shape[-1] + 3 * len(x)))  # of all columns, as dF is of the base columns
    weights[..., problem.columns] = dF.reshape(F.shape)
    of_links, of_joints = np.split(weights, [Y.shape[-1]], axis=-1)
    of_joints = np.einsum("kjcj->ckj", of_joints.reshape(*q.shape, 3, len(x)))
    of_efforts, of_depths = np.split(after[0], [2 * len(x) * limits.limits_effort], axis=-1)
    if limits.parameters is not None and limits.limits_effort:
        above, below = np.split(of_efforts / np.tile(limits.efforts, 2), 2, axis=-1)
        of_links += (above - below)[..., None] * limits.parameters  # efforts are linear in the regressor

    def of_sample(q: Array, dq: Array, ddq: Array) -> Array:
        return np.asarray(np.einsum("...kjc,kjc->...k", compiled_regressor(problem.chain, q, dq, ddq), of_links))

    slopes, gradient = _slopes(of_sample, [q, dq, ddq]), []
    slopes[0] += _slopes(lambda q: np.asarray((limits.depth(q) * of_depths).sum(axis=-1)), [q])[0]
    slopes[1] += of_joints[1] + of_joints[2] * (1 - np.tanh(dq / width) ** 2) / width
    slopes[2] += of_joints[0]
    for i, (B, (A, b)) in enumerate(zip(stage.bases, stage.joint_limits, strict=True)):
        after.append(mu * np.maximum(0.0, A @ x[i] - b + before[1 + i] / mu))
        gradient.append(sum(slopes[d][:, i] @ B[d] for d in range(3)) + after[-1] @ A)
    value += sum(float((part**2).sum()) for part in after) / (2 * mu)
    return value, np.concatenate([s * part for s, part in zip(stage.scale, gradient, strict=True)]), after


def _slopes(function: Callable[..., Array], motion: Sequence[Array]) -> list[Array]:
    """Derivatives (K, n) of a function (K,) of each sample of a motion by each part (K, n) of it."""
    n, slopes = motion[0].shape[1], []
    steps = STEP * np.concatenate([np.eye(n), -np.eye(n)])[:, None]
    for i in range(len(motion)):
        moved = [part + (steps if k == i else 0 * steps) for k, part in enumerate(motion)]  # (2 n, K, n)
        ahead, behind = np.split(function(*moved), 2)
        slopes.append((ahead - behind).T / (2 * STEP))
    return slopes


def _joint_limits(joint: ExcitationProblem, bases: Sequence[Array]) -> tuple[Array, Array]:
    """A (6 G, 1 + 2 N_f) and b (6 G,): A x - b is the excess over the limits, in shares of half their range."""
    rows, bounds = [], []
    for (low, high), B in zip(joint.limits, bases, strict=True):
        half, middle = ((high - low) / 2, (high + low) / 2) if np.isfinite([low, high]).all() else (np.inf, 0.0)
        rows += [B / half, -B / half]
        bounds += [np.full(len(B), 1 + middle / half), np.full(len(B), 1 - middle / half)]
    return np.concatenate(rows), np.concatenate(bounds)


def _columns(Y: Array, dq: Array, ddq: Array, columns: NDArray[np.int64], width: Array | None = None) -> Array:
    """Columns (..., n, p) of F: of Y, then of rotors, viscous and Coulomb friction, smooth with a `width` (n,)."""
    of_links = columns[columns < Y.shape[-1]]
    F = np.zeros((*dq.shape, len(columns)))
    F[..., : len(of_links)] = Y[..., of_links]
    sign = np.sign(dq) if width is None else np.tanh(dq / width)
    for i in range(len(of_links), len(columns)):
        kind, joint = divmod(columns[i] - Y.shape[-1], dq.shape[-1])
        F[..., joint, i] = (ddq, dq, sign)[kind][..., joint]
    return F
