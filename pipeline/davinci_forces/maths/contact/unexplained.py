"""Judge whether efforts are of free motion: how much of them a simple model of one joint leaves unexplained."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array

SAMPLES_SMOOTHED = 9  # samples of the mean that is taken of every signal, for noise of single samples tells nothing
MAX_POINTS = 20_000  # of a course; a longer recording is thinned
REVERSAL = 0.02  # share of the highest speed within which friction reverses
ITERATIONS = 20  # of reweighting; the weights change by less than a per cent after 10
HUBER = 1.345  # residuals beyond this many standard deviations count less: 95 % efficient for Gaussian noise
SIGMA = 1.4826  # standard deviation of Gaussian noise over its median absolute value
# Residual over its robust standard deviation: 1 for Gaussian noise, 1.4 for Laplace's, up to 1.7 where only friction at
# reversals is unexplained, up to 2.9 where coupled joints are; pushes during a fifth of a log give 2.7 and more.
MIN_OUTLIER_RATIO = 2.15
MIN_UNEXPLAINED = 0.5  # share of the effort's deviation left by a model of free motion, from which a log is of contact


class Course(NamedTuple):
    """Position, velocity, acceleration and effort of one joint, smoothed and thinned, (N,) each."""

    q: Array
    dq: Array
    ddq: Array
    tau: Array


def smoothed_course(q: Array, dq: Array, tau: Array, step: float) -> Course:
    """Smooth and thin the signals (N,) of a joint, sampled every `step` seconds."""
    mean = np.ones(SAMPLES_SMOOTHED) / SAMPLES_SMOOTHED
    smooth = [np.convolve(x, mean, "valid") if len(x) > 2 * SAMPLES_SMOOTHED else x for x in (q, dq, tau)]
    ddq = np.gradient(smooth[1], step) if len(smooth[1]) > 1 else np.zeros_like(smooth[1])
    every = -(-len(smooth[0]) // MAX_POINTS)
    return Course(smooth[0][::every], smooth[1][::every], ddq[::every], smooth[2][::every])


def _regressor(course: Course, speed: float) -> Array:
    """Offset, gravity of a turn, and as a parabola for a motor of unknown gear, friction and inertia: (N, 8)."""
    q, dq, ddq, _ = course
    coulomb = np.tanh(dq / max(REVERSAL * speed, 1e-12))
    return np.column_stack([np.ones_like(q), np.sin(q), np.cos(q), q, q * q, dq, coulomb, ddq])


def has_outliers(course: Course) -> bool:
    """Whether a robust fit leaves most of the effort unexplained, and that in few samples, as pushes do."""
    Phi, weight = _regressor(course, float(np.abs(course.dq).max())), np.ones(len(course.q))
    residual, sigma = course.tau, 1.0
    for _ in range(ITERATIONS):
        theta = np.linalg.lstsq(Phi * weight[:, None], course.tau * weight, rcond=None)[0]
        residual = course.tau - Phi @ theta
        sigma = SIGMA * float(np.median(np.abs(residual)))
        if sigma == 0:
            return False
        weight = np.sqrt(1 / np.maximum(np.abs(residual) / (HUBER * sigma), 1.0))
    size = float(residual.std())
    return size >= MIN_OUTLIER_RATIO * sigma and size >= MIN_UNEXPLAINED * float(course.tau.std())


def unexplained_share(course: Course, references: Sequence[Course]) -> float:
    """Deviation of the effort from a model fitted to other courses of the joint, as a share of the effort's own.

    Only samples count whose position and speed the other courses reached. The share is 0 where these are less than
    half of the course. It is also 0 where the model leaves half as much of the other courses themselves.
    """
    low, high = min(float(r.q.min()) for r in references), max(float(r.q.max()) for r in references)
    speed = max(float(np.abs(reference.dq).max()) for reference in references)
    inside = (course.q >= low) & (course.q <= high) & (np.abs(course.dq) <= speed)
    if 2 * inside.sum() < len(inside):
        return 0.0
    Phi = np.concatenate([_regressor(reference, speed) for reference in references])
    tau = np.concatenate([reference.tau for reference in references])
    size = np.maximum(np.abs(Phi).max(axis=0), 1e-300)
    theta = np.linalg.lstsq(Phi / size, tau, rcond=None)[0] / size
    left = float((tau - Phi @ theta).std() / max(tau.std(), 1e-300))
    residual = (course.tau - _regressor(course, speed) @ theta)[inside]
    share = float(residual.std() / max(course.tau[inside].std(), 1e-300))
    return share if share > 2 * left else 0.0
