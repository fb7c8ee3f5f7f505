"""Detect contacts in an external effort without delay, at a stated rate of false alarms, and summarise them.

A contact lasts while the effort exceeds the alarm level.  By Rice's formula for a normal process, free motion crosses
that level once in ten minutes; the level is at least the largest effort of free motion:

    level = rms sqrt(2 ln(v_0 / false alarms a second)),    v_0 upward crossings of zero a second         (Rice 1944)

An onset is that of a ramp of duration T that the smoother widens about its middle, and .2 T earlier; a step becomes
T_s long:

    onset = t(half the peak) - .7 T,    T^2 = T_seen^2 - (2 ln(2) T_s)^2,    T_seen = 2 (t(3/4 of the peak) - t(1/4))

A smoothed step has T = 0: it approaches both of its levels exponentially, with its steepest slope 1 / T_s in between.
A push that rises to 1/2 of its peak in less than half of the time that a ramp takes has T_seen = 4 (t(1/2) - t(1/4)).
The peak of these shares is the median of what exceeds 3/4 of the largest sample, which noise raises; a ramp begins at
the same time by either.  A push that rises like a squared sine begins .25 T before such a ramp, and one of least jerk,
as of a hand, .4 T.  Real pushes lie between ramp and hand: onsets are put in the middle, .2 T from either, and the
standard error contains these .2 T besides noise.  Noise in T counts as much as it could lengthen T, since near a step T
is the root of a small difference.

A window of contact is summarised by peak, mean and impulse of the external effort, with standard errors.  They are
computed from free motion in windows of the same length, so the model's error is included.  That of a peak is the root
mean square of the windows' largest samples; that of a mean is the root mean square of the windows' means.
A smoother rounds off the tip of a push.  Its peak is therefore the largest mean of the measured minus the modelled
effort near the largest smoothed sample.  Of several times that the mean may take, that of the smallest error counts, or
else the smoothed effort.  The error contains the largest of such means in free motion, the standard deviation of the
effort, and the shape of the push.  A mean takes off a triangle what a mean of twice the length takes off again, and
nothing off a plateau.  Half of that is added to the peak, and half to its error.  For the smoothed effort it is the
peak minus the mean over `TIP_REACH` on either side.  What shorter means say against a longer one, beyond their noise,
counts as its error, too.
Mean and impulse are those of the measured minus the modelled effort, too, because a smoother spreads a part of a push
out of its window.  Student's t widens their errors if free motion holds few windows.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, runs
from davinci_forces.maths.contact.unexplained import SIGMA
from davinci_forces.maths.signals.smoothing import segments
from davinci_forces.maths.uncertainty.bootstrap import rms
from davinci_forces.maths.uncertainty.error_band import NORMAL_95, students_95

NARROWER = (1 / 16, 1 / 8, 1 / 4, 1 / 2)  # of `TIP_REACH`: half of the time of means that may show a peak
FALSE_ALARMS = 1.0 / 600.0  # [1/s] rate of false alarms
MAX_GAP_CONTACT = 0.25  # [s] longest gap between two crossings of one sign that belong to one contact
SHIFT = 0.2  # of the duration of a rise: how much earlier than a ramp a push of a typical shape begins
SHAPE = 0.2  # standard deviation of an onset by the shape of the push, over the duration of its rise
STEP_WIDTH = 2.0 * float(np.log(2.0))  # T_seen of a step, in T_s
TIP_REACH = 1.0 + 0.5**0.5  # in T_s: exact for the tip of a triangle that exponential weights of either side round off


class FreeMotionStatistics(NamedTuple):
    """An external effort where nothing touches the robot."""

    rms: float
    free_max: float
    crossings: float  # [1/s] upward crossings of zero


class Event(NamedTuple):
    """A detected contact: its onset and release [s], with standard errors."""

    onset: float
    onset_std: float
    release: float
    release_std: float


def free_motion_statistics(tau_ext: Array, free: Booleans, rate: float) -> FreeMotionStatistics:
    """Statistics of an effort (N,) at `rate` [Hz] at its `free` samples (N,)."""
    x, upwards = tau_ext[free], (tau_ext[:-1] < 0.0) & (tau_ext[1:] >= 0.0) & free[:-1] & free[1:]
    return FreeMotionStatistics(rms(x), float(np.abs(x).max()), float(upwards.sum()) / (len(x) / rate))


def alarm_level(size: float, largest: float, crossings: float) -> float:
    """The effort level that free motion with these `FreeMotionStatistics` crosses at most once in ten minutes."""
    return max(largest, size * float(np.sqrt(2.0 * np.log(max(crossings / FALSE_ALARMS, 1.0)))))


def typical_alarm_level(tau_ext: Array, free: Booleans, rate: float) -> float:
    """The alarm level of an effort (N,) at `rate` [Hz] by the median of `free` samples (N,), whatever a few are."""
    size = SIGMA * float(np.median(np.abs(tau_ext[free])))
    return alarm_level(size, 0.0, free_motion_statistics(tau_ext, free, rate).crossings)


def events(t: Array, tau_ext: Array, std: Array, level: float | Array, rise: float) -> list[Event]:
    """The contacts in a smoothed external effort (N,) with its standard deviation (N,), at times (N,) [s].

    They exceed the `level`, () or (N,).  `rise` [s] is the duration T_s that the smoother gives a step.  Two peaks of
    one sign are one contact if the effort between them stays above half of the smaller one.
    """
    stretches: list[tuple[int, int]] = []
    for start, stop in sign_runs(t, np.where(np.abs(tau_ext) > level, np.sign(tau_ext), 0.0)):
        if stretches and is_one_contact(tau_ext * np.sign(tau_ext[start]), *stretches[-1], start, stop):
            start = stretches.pop()[0]
        stretches.append((start, stop))
    contacts = []
    for start, stop in stretches:
        size = tau_ext * np.sign(tau_ext[start])
        onset, release = (edge(t, size, std, start, stop, inwards, rise) for inwards in (1, -1))
        contacts.append(Event(*onset, *release))
    for i in range(len(contacts) - 1):
        event, following = contacts[i], contacts[i + 1]
        if event.release > following.onset:
            middle = 0.5 * (event.release + following.onset)
            contacts[i], contacts[i + 1] = event._replace(release=middle), following._replace(onset=middle)
    return contacts


def is_one_contact(size: Array, start: int, stop: int, next_start: int, next_stop: int) -> bool:
    """Whether an effort (N,) with the sign of its next peak does not fall below half of the smaller of two peaks."""
    smaller = min(size[start:stop].max(), size[next_start:next_stop].max())
    return bool(size[stop:next_start].min(initial=smaller) > 0.5 * smaller > 0.0)


def sign_runs(t: Array, side: Array) -> list[tuple[int, int]]:
    """Start and stop of the runs of one sign (N,); runs of the same sign with a short gap are merged."""
    merged = list[tuple[int, int]]()
    for a, b in ((run.start, run.stop) for run in segments(side) if side[run.start] != 0.0):
        if merged and t[a] - t[merged[-1][1] - 1] <= MAX_GAP_CONTACT and side[a] == side[merged[-1][0]]:
            a = merged.pop()[0]
        merged.append((a, b))
    return merged


def edge(t: Array, size: Array, std: Array, start: int, stop: int, inwards: int, rise: float) -> tuple[float, float]:
    """Onset (inwards 1) or release (-1) of a contact above the level from `start` to `stop`, and its standard error."""
    k, inside = (start if inwards > 0 else stop - 1), size[start:stop]
    peak = float(np.median(inside[inside >= 0.75 * inside.max()]))
    lower, middle, upper = (inner_crossing(t, size, k, inwards, share * peak) for share in (0.25, 0.5, 0.75))
    whole, outer = (2.0, abs(upper - lower)), (4.0, abs(middle - lower))  # times of a half, and of a quarter
    times, part = whole if 2.0 * outer[1] > 0.5 * whole[1] else outer  # a push that changes is no ramp up to its peak
    apparent = max(times * part, float(t[1] - t[0]))
    duration, crossing_std = float(np.sqrt(max(apparent**2 - (STEP_WIDTH * rise) ** 2, 0.0))), std[k] * apparent / peak
    longer = float(np.sqrt(duration**2 + 2.0 * apparent * (times * 2.0**0.5 * crossing_std)))
    error = np.linalg.norm([crossing_std, SHAPE * duration, 0.5 * (longer - duration)])
    return middle - (0.5 + SHIFT) * inwards * duration, float(error)


def inner_crossing(t: Array, size: Array, k: int, inwards: int, level: float) -> float:
    """Time at which a size, near sample k, rises inwards to a level, interpolated between samples."""
    while size[k] < level:
        k += inwards
    while 0 <= k - inwards < len(t) and size[k - inwards] >= level:
        k -= inwards
    outer = k - inwards
    if not 0 <= outer < len(t) or size[k] <= size[outer]:
        return float(t[k])
    return float(t[k] + (t[outer] - t[k]) * (size[k] - level) / (size[k] - size[outer]))


class Summary(NamedTuple):
    """One window of contact."""

    peak: float  # the largest sample, with its sign, and what the smoother rounds off
    peak_std: float
    mean: float
    mean_std: float
    impulse: float  # mean times duration
    impulse_std: float
    noise_std: float  # of the peak, without what the smoother rounds off
    largest: float  # sample
    t_peak: float  # [s] its time


def summarise(
    t: Array, effort: tuple[Array, Array, Array], window: tuple[float, float], free: Booleans, rise: float,
    means: Sequence[tuple[int, float]], constant_std: Array | None = None,
) -> Summary | None:  # fmt: skip
    """Peak, mean and impulse of an external effort in a window [s]; None if that is empty.

    `effort` is the smoothed one (N,), its deviation (N,), and measured minus modelled effort (N,).
    `free` (N,) are the samples at which nothing touches the robot.  `rise` [s] is the duration T_s of a step,
    and `means` are the `narrower_means`.
    `constant_std` (N,) is the part of the deviation that no mean reduces and that free motion does not show.
    """
    (tau_ext, std, direct), (start, end) = effort, window
    inside = tau_ext[(t >= start) & (t <= end)]
    if not len(inside):
        return None
    mean, mean_std = mean_effort(t, direct, window, free, constant_std)
    duration = end - start
    k = int(np.searchsorted(t, start)) + int(np.argmax(np.abs(inside)))
    noise, largest = largest_size(tau_ext, free, len(inside)), float(tau_ext[k])
    tip = rounded_off(t, tau_ext, direct, k, rise, noise, means)
    peak = largest + tip.lost, float(np.linalg.norm([std[k], tip.noise, tip.shape]))
    noise_std = float(np.hypot(std[k], noise))
    return Summary(*peak, mean, mean_std, mean * duration, mean_std * duration, noise_std, largest, float(t[k]))


def mean_effort(
    t: Array, direct: Array, window: tuple[float, float], free: Booleans, constant_std: Array | None = None
) -> tuple[float, float]:
    """Mean of measured minus modelled effort (N,) in a window [s] of at least one sample, and its standard error.

    `free` and `constant_std` are those of `summarise`.
    """
    start, end = window
    within = (t >= start) & (t <= end)
    times, samples = t[within], int(within.sum())
    edges = np.concatenate([[start], 0.5 * (times[1:] + times[:-1]), [end]])
    # Each sample counts for the time around it, within window and log; a log of one sample, too.
    shares = np.diff(edges.clip(t[0], t[-1])) + np.finfo(float).tiny
    constant = 0.0 if constant_std is None else float(constant_std[within].mean())
    widening = students_95(max(int(free.sum()) // samples, 1)) / NORMAL_95
    error = np.hypot(widening * mean_size(direct, free, samples), constant)
    return float(np.average(direct[within], weights=shares)), float(error)


class Rounding(NamedTuple):
    """What a smoother takes off a peak, its error by the shape of the push, and by what noise adds to the peak."""

    lost: float
    shape: float  # both with the sign of the effort, unless it grows beyond its window
    noise: float


def narrower_means(t: Array, direct: Array, free: Booleans, rise: float) -> list[tuple[int, float]]:
    """The samples of means of an effort (N,), and the size of their largest in free windows as long as a tip."""
    reach = tip_samples(t, rise)
    lengths = sorted({2 * round(share * reach) + 1 for share in NARROWER}) if reach else []
    return [(length, largest_size(direct, free, 2 * reach + 1, length)) for length in lengths]


def rounded_off(
    t: Array, tau_ext: Array, direct: Array, k: int, rise: float, noise: float, means: Sequence[tuple[int, float]],
    moves: bool = True,
) -> Rounding:  # fmt: skip
    """What a smoother that spreads a step over `rise` [s] takes off the peak at sample k of an effort (N,).

    `direct` (N,) is measured minus modelled effort, and `means` are its `narrower_means`; `noise` is the size of the
    largest smoothed samples of free motion.  Smoothing may have moved the peak, unless it is that of other joints.
    """
    reach, peak = tip_samples(t, rise), float(tau_ext[k])
    triangle = peak - float(tau_ext[max(k - reach, 0) : k + reach + 1].mean())
    side, by, choices = float(np.sign(peak)), reach if moves else 0, list[Rounding]()
    for length, size in means:
        top, wider = (
            moving_mean(side * direct[max(k - by - half, 0) : k + by + half + 1], 2 * half + 1).max(initial=-np.inf)
            for half in (length // 2, 2 * (length // 2) or 1)
        )
        if np.isfinite(wider):
            shape = 0.5 * float(top - wider)
            choices.append(Rounding(side * (float(top) + shape) - peak, side * shape, size))
    choices.append(Rounding(0.5 * triangle, 0.5 * triangle, noise))
    for j, choice in enumerate(choices):
        against = [abs(choice.lost - other.lost) - NORMAL_95 * other.noise for other in choices[:j]]
        choices[j] = choice._replace(shape=float(np.copysign(np.hypot(choice.shape, max([0.0, *against])), peak)))
    return min(choices, key=lambda choice: np.nan_to_num(np.hypot(choice.shape, choice.noise), nan=np.inf))


def tip_samples(t: Array, rise: float) -> int:
    """The number of samples in `TIP_REACH`, at even times (N,) [s]; 0 if the rise is unknown."""
    return round(TIP_REACH * rise / float(t[1] - t[0])) if len(t) > 1 and np.isfinite(rise) else 0


def without_rounding(std: Array, rounding: Array) -> Array:
    """The standard deviation (N,) of a smoothed effort without its part (N,) from what the smoother rounds off."""
    return np.asarray(np.sqrt(np.maximum(std**2 - rounding**2, 0.0)))


def moving_mean(x: Array, length: int) -> Array:
    """Means (N - length + 1,) over `length` consecutive samples of (N,)."""
    total = np.cumsum(np.concatenate([[0.0], x]))
    return x if length == 1 else np.asarray((total[length:] - total[:-length]) / length)


def mean_size(tau_ext: Array, free: Booleans, length: int) -> float:
    """Root mean square of means over `length` free samples, or over the longest run; NaN without free samples."""
    return rms(np.concatenate([[], *(moving_mean(run, length) for run, length in _runs(tau_ext, free, length))]))


def largest_size(tau_ext: Array, free: Booleans, length: int, of: int = 1) -> float:
    """Root mean square of the largest of `length` consecutive samples in free space, or of means `of` as many."""
    parts = [moving_mean(run, of) for run, used in _runs(tau_ext, free, length + of - 1) if used >= of]
    windows = (np.array_split(part, max(len(part) // length, 1)) for part in parts)
    return rms(np.array([np.abs(window).max() for of_run in windows for window in of_run]))


def _runs(tau_ext: Array, free: Booleans, length: int) -> list[tuple[Array, int]]:
    """The runs of at least `length` free samples, or else the longest ones, with the length that was used."""
    parts = [tau_ext[run] for run in runs(free)]
    length = min(length, max(map(len, parts), default=0))
    return [(part, length) for part in parts if len(part) >= length > 0]
