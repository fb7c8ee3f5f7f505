"""How fast a filter is: what it makes of a push, and the slowest walk of the external effort that shows one.

The push is a half-sine of 1 s.  A filter shows it where it returns 90 % of its peak, at most 0.1 s late.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from davinci_forces.filters import DEFAULT, ekf, rts, tracker
from davinci_forces.filters.problem import Driven, Filter, NoiseModel, standing
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.bias import VISCOUS
from davinci_forces.records import FilterNoise
from davinci_forces.robots.robot import Joint

DURATION = 1.0  # [s] of the push
SHARE, DELAY = 0.9, 0.1  # of its peak that is returned, and how late at most [s]
BEFORE, AFTER = 2.0, 1.0  # [s] around it, when it is tried on a joint at rest
WIDEST, STEPS = (1e-8, 1e6), 60  # of a walk, over what the filter believes of the joint's own noise; bisections
KEPT = 256  # walks that are remembered: every stage and log asks for those of the same joints


class Response(NamedTuple):
    """What a filter makes of a push."""

    share: float  # of its peak
    delay: float  # [s] of the peak


def half_sine(t: Array, start: float) -> Array:
    """A push of 1 over times (N,), from `start` [s] on."""
    since = (t - start) / DURATION
    return np.where((since >= 0.0) & (since <= 1.0), np.sin(np.pi * since), 0.0)


def response(difference: Array, t: Array, start: float, peak: float) -> Response:
    """Of the difference (N,) that a push of `peak` makes to a tracked effort."""
    near = (t >= start) & (t <= start + 2.0 * DURATION)
    shown = difference[near] / peak
    k = int(np.argmax(shown))
    return Response(float(shown[k]), float(t[near][k] - start - 0.5 * DURATION))


def at_rest(track: Filter, inertia: float, viscous: float, T_s: float, noise: NoiseModel) -> Response:
    """What a filter makes of a push at a joint that stands still, where it is linear."""
    t = np.asarray(T_s * np.arange(round((BEFORE + DURATION + AFTER) / T_s) + 1), np.float64)
    pushed = standing(np.full(len(t), inertia), viscous, half_sine(t, BEFORE), T_s, first_std=1.0)
    return response(track(pushed, noise).tau_ext, t, BEFORE, 1.0)


def rise(track: Filter, recording: Driven, noise: NoiseModel) -> float:
    """The time [s] over which a filter spreads a step: 1 over its steepest rise, at a joint that stands still."""
    T_s, joint = recording.T_s, recording.joint
    t = np.asarray(T_s * np.arange(round(2.0 * BEFORE / T_s) + 1), np.float64)
    inertia, step = np.full(len(t), float(np.mean(joint.inertia))), np.where(t >= BEFORE, 1.0, 0.0)
    stepped = standing(inertia, joint.coefficients[VISCOUS], step, T_s, first_std=1.0)
    return float(T_s / max(np.diff(track(stepped, noise).tau_ext).max(), 1e-9))


@lru_cache(KEPT)
def slowest(track: Filter, inertia: float, viscous: float, T_s: float, noise: NoiseModel) -> float:
    """The smallest `q_tau` of a sample with which a filter shows a push.

    A filter that has no walk shows it whatever that is.
    """
    own = inertia * float(np.hypot(noise.q_dq, noise.r_dq)) / T_s
    low, high = (share * own for share in WIDEST)
    for _ in range(STEPS):
        middle = float(np.sqrt(low * high))
        share, delay = at_rest(track, inertia, viscous, T_s, noise._replace(q_tau=middle))
        low, high = (low, middle) if share >= SHARE and delay <= DELAY else (middle, high)
    return high


def assumed(settled: FilterNoise, joint: Joint, T_s: float, q_tau: float, name: str = DEFAULT) -> NoiseModel:
    """The noise of a sample of T_s [s] for the filter of that name.

    The effort's noise drives the model, as an acceleration that is constant over a sample.  `q_tau` is the walk of the
    external effort [effort/s^0.5] that the settings name; where that is 0 the joint's own counts, and where that is
    0, too, the slowest with which this filter shows a push.
    """
    q_tau = q_tau or joint.q_tau
    noise = NoiseModel(settled.r_q, settled.r_dq, 0.0, settled.r_tau * T_s / settled.inertia, q_tau * T_s**0.5)
    return noise if q_tau else noise._replace(
        q_tau=slowest(tracker(name), settled.inertia, settled.viscous, T_s, noise)
    )  # fmt: skip


def lag(recordings: Sequence[Driven], noise: NoiseModel) -> tuple[Array, Array]:
    """The smoothed external effort (N,) of all recordings, and that less what the filter makes of it.

    The filter sees it as the effort of a joint at rest, where it is linear: position and velocity stay 0.
    """
    smooth = [rts.track(recording, noise).tau_ext for recording in recordings]
    pushes = (
        standing(part.joint.inertia, part.joint.coefficients[VISCOUS], tau_ext, part.T_s, part.first_std)
        for part, tau_ext in zip(recordings, smooth, strict=True)
    )
    followed = np.concatenate([ekf.track(push, noise).tau_ext for push in pushes])
    return np.concatenate(smooth), np.concatenate(smooth) - followed
