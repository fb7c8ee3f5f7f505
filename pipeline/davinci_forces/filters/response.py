"""The response of a filter to a push, and the slowest random walk of the external effort that still follows one.

The push is a half-sine of 1 s.  A filter follows it where it returns 90 % of its peak, at most 0.1 s late.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from davinci_forces.filters import DEFAULT, ekf, rts, tracker
from davinci_forces.filters.problem import Filter, FilterInput, NoiseModel, stationary_joint
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.bias import VISCOUS
from davinci_forces.records import FilterNoise
from davinci_forces.robots.robot import Joint

DURATION = 1.0  # [s] of the push
MIN_SHARE, MAX_DELAY = 0.9, 0.1  # of its peak that the filter returns; [s]
BEFORE, AFTER = 2.0, 1.0  # [s] around it, in the trial on a joint at rest
WALK_RANGE, BISECTIONS = (1e-8, 1e6), 60  # of a walk over the effort of the joint's own noise
CACHED_WALKS = 256  # every stage and log asks for those of the same joints


class Response(NamedTuple):
    """The response of a filter to a push."""

    share: float  # of its peak
    delay: float  # [s] of the peak


def half_sine(t: Array, start: float) -> Array:
    """Return a push of peak 1 at times (N,), from `start` [s] on."""
    since = (t - start) / DURATION
    return np.where((since >= 0.0) & (since <= 1.0), np.sin(np.pi * since), 0.0)


def response(difference: Array, t: Array, start: float, peak: float) -> Response:
    """Measure the response in the difference (N,) that a push of `peak` makes to a tracked effort."""
    near = (t >= start) & (t <= start + 2.0 * DURATION)
    shown = difference[near] / peak
    k = int(np.argmax(shown))
    return Response(float(shown[k]), float(t[near][k] - start - 0.5 * DURATION))


def at_rest(track: Filter, inertia: float, viscous: float, T_s: float, noise: NoiseModel) -> Response:
    """Compute the response of a filter to a push at a joint at rest, where the filter is linear."""
    t = np.asarray(T_s * np.arange(round((BEFORE + DURATION + AFTER) / T_s) + 1), np.float64)
    pushed = stationary_joint(np.full(len(t), inertia), viscous, half_sine(t, BEFORE), T_s, first_std=1.0)
    return response(track(pushed, noise).tau_ext, t, BEFORE, 1.0)


def rise(track: Filter, recording: FilterInput, noise: NoiseModel) -> float:
    """Compute the rise time [s] of a filter's step response at a joint at rest: 1 over its steepest slope."""
    T_s, joint = recording.T_s, recording.joint
    t = np.asarray(T_s * np.arange(round(2.0 * BEFORE / T_s) + 1), np.float64)
    inertia, step = np.full(len(t), float(np.mean(joint.inertia))), np.where(t >= BEFORE, 1.0, 0.0)
    stepped = stationary_joint(inertia, joint.coefficients[VISCOUS], step, T_s, first_std=1.0)
    return float(T_s / max(np.diff(track(stepped, noise).tau_ext).max(), 1e-9))


@lru_cache(CACHED_WALKS)
def slowest(track: Filter, inertia: float, viscous: float, T_s: float, noise: NoiseModel) -> float:
    """Find the smallest `q_tau` of a sample with which a filter follows a push.

    A filter without a random walk follows it with any.
    """
    noise_effort = inertia * float(np.hypot(noise.q_dq, noise.r_dq)) / T_s
    low, high = (ratio * noise_effort for ratio in WALK_RANGE)
    for _ in range(BISECTIONS):
        middle = float(np.sqrt(low * high))
        share, delay = at_rest(track, inertia, viscous, T_s, noise._replace(q_tau=middle))
        low, high = (low, middle) if share >= MIN_SHARE and delay <= MAX_DELAY else (middle, high)
    return high


def noise_model(noises: FilterNoise, joint: Joint, T_s: float, q_tau: float, name: str = DEFAULT) -> NoiseModel:
    """Compute the noise of a sample of T_s [s] for the filter of that name.

    The effort's noise drives the model, as an acceleration that is constant over a sample.  `q_tau` is the random walk
    of the external effort [effort/s^0.5] from the settings.  Where it is 0 that of the joint's table counts, and where
    that is 0, too, the slowest with which this filter follows a push.
    """
    q_tau = q_tau or joint.q_tau
    noise = NoiseModel(noises.r_q, noises.r_dq, 0.0, noises.r_tau * T_s / noises.inertia, q_tau * T_s**0.5)
    return noise if q_tau else noise._replace(
        q_tau=slowest(tracker(name), noises.inertia, noises.viscous, T_s, noise)
    )  # fmt: skip


def lag(recordings: Sequence[FilterInput], noise: NoiseModel) -> tuple[Array, Array]:
    """Return the smoothed external effort (N,) of all recordings, and how far the filter lags behind it (N,).

    The filter is run on that effort at a joint at rest, where it is linear: position and velocity stay 0.
    """
    smooth = [rts.track(recording, noise).tau_ext for recording in recordings]
    pushes = (
        stationary_joint(part.joint.inertia, part.joint.coefficients[VISCOUS], tau_ext, part.T_s, part.first_std)
        for part, tau_ext in zip(recordings, smooth, strict=True)
    )
    followed = np.concatenate([ekf.track(push, noise).tau_ext for push in pushes])
    return np.concatenate(smooth), np.concatenate(smooth) - followed
