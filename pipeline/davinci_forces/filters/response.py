"""The response of a filter to a push, and the noise that a filter assumes of a joint.

The noise of position, velocity and drive maximises the likelihood of the innovations, on recordings in which nothing
touches the robot (section 7.3).  The random walk q_tau of the external effort is the smallest one with which the filter
follows a push.  Without external effort the likeliest walk would be 0, and the filter would then not follow any.

The push is a half-sine of 1 s.  A filter follows it if its estimate reaches 90 % of the peak, and peaks no later than
the setting `delay` after the peak of the push.  `q_tau` of a `NoiseModel` is the random walk per sample; `walk` and the
`q_tau` of a joint are per square root of a second.
"""

from collections.abc import Sequence
from functools import lru_cache, partial

import numpy as np

from davinci_forces.filters import DEFAULT, ekf, filter_parts, tracker
from davinci_forces.filters.problem import Filter, FilterInput, LongInput, NoiseModel, Recording, column, joint_at_rest
from davinci_forces.maths.arrays import Array, row_blocks
from davinci_forces.maths.constants import PUSH_DELAY
from davinci_forces.maths.contact.detection import STEP_WIDTH, TIP_REACH
from davinci_forces.maths.models.terms import VISCOUS
from davinci_forces.records import FilterNoise
from davinci_forces.robots.robot import Joint

DURATION = 1.0  # [s] duration of the push
MIN_SHARE = 0.9  # estimated peak / peak of the push
BEFORE, AFTER = 2.0, 1.0  # [s] before and after the push, in the trial on a joint at rest
WALK_RANGE = (1e-8, 1e6)  # search range of q_tau, in units of inertia * velocity noise / T_s
MIN_TRIAL_RATE = 5000.0  # [Hz] in a trial, samples of a faster log are taken together
BISECTIONS = 60  # halvings of the logarithmic search range
CACHED_WALKS = 256  # size of a cache: all stages and logs of a joint need the same few results
ROUNDS = 4  # number of rounds that fit the likelihood and the push in turn
MAX_LOG_CHANGE = np.log(1e3)  # largest change of a standard deviation's logarithm from the start of the search
MAX_SAMPLES_TUNING = 20_000  # at most this number of each recording's samples is used


def half_sine(t: Array, start: float) -> Array:
    """Return a push of peak 1 that begins at `start` [s], at the times t (N,) [s]."""
    since = (t - start) / DURATION
    return np.where((since >= 0.0) & (since <= 1.0), np.sin(np.pi * since), 0.0)


def response(change: Array, t: Array, start: float, peak: float) -> tuple[float, float]:
    """The estimated peak over that of a push, and how late [s] it is, by the `change` (N,) of the estimate by it."""
    near = (t >= start) & (t <= start + 2.0 * DURATION)
    shares = change[near] / peak
    k = int(np.argmax(shares))
    return float(shares[k]), float(t[near][k] - start - 0.5 * DURATION)


def push_response_at_rest(
    track: Filter, inertia: float, viscous: float, T_s: float, noise: NoiseModel
) -> tuple[float, float]:
    """Compute the `response` of a filter to a push on a joint at rest, where the filter is linear."""
    t = np.asarray(T_s * np.arange(round((BEFORE + DURATION + AFTER) / T_s) + 1), np.float64)
    return response(track(joint_at_rest(inertia, viscous, half_sine(t, BEFORE), T_s), noise).tau_ext, t, BEFORE, 1.0)


def rise(track: Filter, recording: Recording, noise: NoiseModel) -> float:
    """Compute how long [s] a filter takes to show a step of the effort on a joint at rest.

    It is T_s of the step with T_seen = 2 (t(3/4) - t(1/4)), so that a contact that begins with a step begins there.  If
    the step approaches both of its levels exponentially, T_s is 1 / its steepest slope.
    """
    T_s, joint = recording.T_s, recording.part(slice(0, 1)).joint
    inertia = float(np.mean(column(recording, lambda part: part.joint.inertia)))
    t = np.asarray(T_s * np.arange(round(2.0 * BEFORE / T_s) + 1), np.float64)
    step = np.where(t >= BEFORE, 1.0, 0.0)
    stepped = joint_at_rest(inertia, joint.coefficients[VISCOUS], step, T_s)
    shown = np.maximum.accumulate(track(stepped, noise).tau_ext)
    lower, upper = np.interp([0.25 * shown[-1], 0.75 * shown[-1]], shown, t)
    return float(2.0 * (upper - lower) / STEP_WIDTH)


def ramp_lag(inertia: float, viscous: float, T_s: float, noise: NoiseModel) -> float:
    """How late [s] the default filter shows a ramp of the effort at rest: the area between a step and what it shows."""
    step = np.where(np.arange(round(2.0 * BEFORE / T_s) + 1) * T_s >= BEFORE, 1.0, 0.0)
    at_rest = joint_at_rest(inertia, viscous, step, T_s)
    return T_s * float(np.sum(step - tracker(DEFAULT)(at_rest, noise).tau_ext))


@lru_cache(CACHED_WALKS)
def smallest_q_tau(
    track: Filter, inertia: float, viscous: float, T_s: float, noise: NoiseModel, delay: float = PUSH_DELAY
) -> float:
    """Find the smallest random walk `q_tau` [effort per sample] with which a filter follows a push within `delay` [s].

    A filter without a random walk does not use `q_tau`, so the search ends at one end of its range.  n samples taken
    together have the mean of n measurement errors, and the sum of n process errors.
    """
    n = max(int(1.0 / T_s / MIN_TRIAL_RATE), 1)
    root, T_s = float(np.sqrt(n)), n * T_s
    noise = NoiseModel(noise.r_q / root, noise.r_dq / root, noise.q_q * root, noise.q_dq * root, 0.0)
    noise_effort = inertia * float(np.hypot(noise.q_dq, noise.r_dq)) / T_s
    low, high = (ratio * noise_effort for ratio in WALK_RANGE)
    for _ in range(BISECTIONS):
        middle = float(np.sqrt(low * high))
        share, late = push_response_at_rest(track, inertia, viscous, T_s, noise._replace(q_tau=middle))
        low, high = (low, middle) if share >= MIN_SHARE and late <= delay else (middle, high)
    return high / root


def steady_std(inertia: float, viscous: float, T_s: float, noise: NoiseModel) -> float:
    """Compute the standard deviation of the external effort on a joint at rest, once the filter has converged."""
    at_rest = joint_at_rest(inertia, viscous, np.zeros(round(BEFORE / T_s) + 1), T_s)
    return float(tracker(DEFAULT)(at_rest, noise).tau_ext_std[-1])


def tune_noise(
    recordings: Sequence[FilterInput], start: NoiseModel, inertia: float, viscous: float, delay: float = PUSH_DELAY
) -> NoiseModel:
    """Tune the noise of a joint to all recordings together, from `start`, an estimate without the filter.

    `inertia` is the largest along the recordings: with the largest inertia the filter is slowest.
    The filter shows a push within `delay` [s].
    """
    from scipy.optimize import minimize

    T_s = recordings[0].T_s
    parts = [recording.part(slice(MAX_SAMPLES_TUNING)) for recording in recordings]
    noise, center = start, np.log([start.r_q, start.r_dq, start.q_dq])
    change = np.zeros(len(center))
    for _ in range(ROUNDS):
        noise = noise._replace(q_tau=smallest_q_tau(tracker(DEFAULT), inertia, viscous, T_s, noise, delay))
        walk = noise.q_tau

        def cost(change: Array, walk: float = walk) -> float:
            if np.abs(change).max() > MAX_LOG_CHANGE:
                return np.inf
            return -sum(ekf.log_likelihood(part, noise_of(center + change, walk)) for part in parts)

        # The first simplex is wide, because the likelihood may be flat near its start.
        simplex = change + np.vstack([np.zeros(3), 0.5 * np.eye(3)])
        change = minimize(
            cost, change, method="Nelder-Mead", options={"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-2}
        ).x
        noise = noise_of(center + change, walk)
    return noise._replace(q_tau=smallest_q_tau(tracker(DEFAULT), inertia, viscous, T_s, noise, delay))


def noise_of(logarithms: Array, q_tau: float) -> NoiseModel:
    """Return the noise from the logarithms of its standard deviations r_q, r_dq and q_dq."""
    r_q, r_dq, q_dq = np.exp(logarithms).tolist()
    return NoiseModel(r_q, r_dq, 0.0, q_dq, q_tau)


def likeliest_walk(recordings: Sequence[FilterInput], noise: NoiseModel) -> float:
    """Find the `q_tau` of greatest likelihood, for recordings with external effort, as in section 7.3."""
    from scipy.optimize import minimize_scalar

    def cost(logarithm: float) -> float:
        walk = noise._replace(q_tau=float(np.exp(logarithm)))
        return -sum(ekf.log_likelihood(part, walk) for part in recordings)

    start = np.log(noise.q_tau or float(np.std(recordings[0].tau)) * recordings[0].T_s)
    best = minimize_scalar(cost, bounds=(start - MAX_LOG_CHANGE, start + MAX_LOG_CHANGE), method="bounded")
    return float(np.exp(best.x))


def noise_model(tuned: FilterNoise, joint: Joint, T_s: float, walk: float, name: str = DEFAULT) -> NoiseModel:
    """Compute the noise per sample of T_s [s] for the filter of that name, from the joint's tuned noise.

    The effort's noise drives the model, as an acceleration that is constant over a sample.  `walk` is the random walk
    of the external effort [effort/s^0.5] from the settings.  If `walk` is 0, the walk of the joint is used.  If that is
    0, too, the smallest walk with which this filter follows a push within the joint's `delay` is used.
    """
    walk = walk or joint.q_tau
    q_dq = tuned.r_tau * T_s / tuned.inertia
    noise = NoiseModel(r_q=tuned.r_q, r_dq=tuned.r_dq, q_q=0.0, q_dq=q_dq, q_tau=walk * T_s**0.5)
    return noise if walk else noise._replace(
        q_tau=smallest_q_tau(tracker(name), tuned.inertia, tuned.viscous, T_s, noise, tuned.delay)
    )  # fmt: skip


def lag_error(recordings: Sequence[Recording], smoothed: Array, noise: NoiseModel) -> Array:
    """Return the error (N,) that the filter's lag makes in recordings, computed from the smoothed external effort (N,).

    The error is the smoothed effort minus the filter's response to it.  That response is computed for a joint at rest,
    where the filter is linear: position and velocity stay 0.
    """
    first = np.cumsum([recording.samples for recording in recordings])[:-1]

    def at_rest(recording: Recording, tau_ext: Array, rows: slice) -> FilterInput:
        joint = recording.part(rows).joint
        viscous = joint.coefficients[VISCOUS]
        return joint_at_rest(joint.inertia, viscous, tau_ext[rows], recording.T_s, recording.initial_std)

    inputs = [
        LongInput(recording.samples, recording.T_s, recording.initial_std, partial(at_rest, recording, tau_ext))
        for recording, tau_ext in zip(recordings, np.split(smoothed, first), strict=True)
    ]
    shown = filter_parts(DEFAULT, inputs, noise, ("tau_ext",)).tau_ext
    return np.subtract(smoothed, shown, out=shown)


def rounding_error(tau_ext: Array, variance: Array, T_s: float, rise: float) -> Array:
    """Estimate how far a smoothed effort (N,) with its variance (N,) is off where the effort changes fast.

    A smoother that spreads a step over the time `rise` [s] is off by half of what it would change in that time.  At a
    peak it is off by its distance from its mean within `TIP_REACH`.  Of that, one standard deviation is due to noise.
    """
    error = np.zeros(len(tau_ext))
    if len(tau_ext) < 2 or not np.isfinite(rise):  # as where an effort is lost in the rounding of its sums
        return error
    reach = round(min(TIP_REACH * rise / T_s, len(tau_ext)))
    for rows in row_blocks(len(tau_ext)):
        first = max(rows.start - reach - 1, 0)
        near = tau_ext[first : rows.stop + reach + 1]
        total = np.cumsum(np.pad(near, (reach + 1, reach), "edge"))
        mean = (total[2 * reach + 1 :] - total[: -2 * reach - 1]) / (2 * reach + 1)
        size = np.hypot(0.5 * rise / T_s * np.gradient(near), near - mean)
        inside = slice(rows.start - first, rows.stop - first)
        error[rows] = np.maximum(size[inside] - np.sqrt(variance[rows]), 0.0)
    return error
