"""Explain why the filter's innovations are not white, by taking one cause after the other away."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from davinci_forces.filters.assumed import assumed
from davinci_forces.filters.innovations.innovations import Innovations, innovations
from davinci_forces.filters.innovations.search import CauseSearch, search
from davinci_forces.filters.innovations.timing import delays, mended
from davinci_forces.filters.innovations.trials import CLOCK, Subject
from davinci_forces.filters.innovations.verdict import finding, verdict
from davinci_forces.identification.driving import Driving, Motions, driving, motions_of, named
from davinci_forces.identification.refitting import refitted
from davinci_forces.identification.used import describing, model_of
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.models.driven import Driven
from davinci_forces.maths.signals.standstill import moving
from davinci_forces.maths.signals.whiteness import NORMAL_95, NORMAL_99, cross_correlation, mean_square_band
from davinci_forces.maths.signals.windows import longest_run, outside, settled
from davinci_forces.records import Choice, Explanation, FilterNoise, Fit, Innovation, Signal
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

LAGS = 100  # of the correlation with the motion
UNSTATED = "; when it is touched is not stated, so contact could not be left out"
THIS_LOG = "parameters of this log itself"


def run(
    signals: Sequence[Signal],
    fits: Iterable[Fit],
    choices: Iterable[Choice],
    noises: Iterable[FilterNoise],
    entry: LogEntry,
    robot: Robot,
    *,
    fit: str,
    lowpass: float,
    q_tau: float,
) -> Iterator[Innovation | Explanation]:
    """Of each joint that is tracked and moves: its innovations over the longest run, and why they are not white.

    A cause is named only where the innovations pass every test without it.  Section 7.4
    """
    if entry.role == "friction":
        return
    every, chosen, assumes = list(fits), list(choices), {noise.joint: noise for noise in noises}
    owns, motions = [], motions_of(signals, lowpass)
    for signal in signals:
        if not signal.at_rest and signal.joint in assumes and describing(robot, every, signal.joint):
            own = driving(signal, motions, named(signal, signals, every, chosen, robot, fit)[0], robot)
            if own.joint.inertia.min() > 0:
                joint = robot.joint(signal.joint)
                owns.append((own, assumed(assumes[signal.joint], joint, 1.0 / signal.rate, q_tau)))
    every_innovation = [innovations(longest(own), noise) for own, noise in owns]
    late = delays([along(own)[0] for own, _ in owns], [made.q for made in every_innovation])
    for (own, noise), made, delay in zip(owns, every_innovation, late, strict=True):
        signal, part = own.signal, longest_run(own.signal.t, own.signal.rate)
        motion, free = along(own), outside(signal.t, entry.contact)
        yield from described(own, made, motion)
        models = {name: longest(by) for name, by in others(own, motions, every, robot, free)}
        if delay.any():
            models[CLOCK] = mended(longest(own), *motion, delay)
        subject = Subject(models, noise, free[part], moving(motion[0], 1.0 / signal.rate))
        yield explanation(signal, search(subject), entry, float(np.std(delay)))


def along(own: Driving) -> tuple[Array, Array]:
    """Velocity and acceleration over the longest run, without noise."""
    part = longest_run(own.signal.t, own.signal.rate)
    return own.motion[1][part], own.motion[2][part]


def longest(own: Driving) -> Driven:
    """The longest run of a joint's recording."""
    return max(own.parts, key=lambda part: len(part.q))


def others(
    own: Driving, motions: Motions, fits: Sequence[Fit], robot: Robot, free: Booleans
) -> Iterator[tuple[str, Driving]]:
    """The joint under the model in use; with parameters of this log itself; and under another structure of its own."""
    yield "", own
    yield THIS_LOG, own.by(refitted(own, motions, robot, free))
    joint = own.signal.joint
    structures = [fit for fit in fits if fit.group == joint and fit.model != own.fit.model]
    told = [fit for fit in structures if motions.keys() >= set(model_of(robot, fit).joints)]  # of what the log holds
    for fit in told[:1]:
        other = driving(own.signal, motions, fit, robot)
        if other.joint.inertia.min() > 0:
            yield fit.model, other


def described(own: Driving, made: Innovations, motion: tuple[Array, Array]) -> Iterator[Innovation]:
    """The size of both innovations, and their correlation with the motion before."""
    signal = own.signal
    kept = settled(np.arange(len(made.q)) / signal.rate)
    dq, ddq = (x[kept] for x in motion)
    N = int(kept.sum())
    lags = min(LAGS, N // 4)
    low, high = mean_square_band(N)
    for name, x, std in (("innovation_q", made.q, made.q_std), ("innovation_dq", made.dq, made.dq_std)):
        normalised = (x / std)[kept]
        with_dq, with_ddq, with_sign = (cross_correlation(normalised, u, lags) for u in (dq, ddq, np.sign(dq)))
        yield Innovation(
            log=signal.log, joint=signal.joint, signal=name, tested=N, band=NORMAL_95 / N**0.5,
            band_99=NORMAL_99 / N**0.5, nis_own=float(np.mean(normalised**2)), nis_low=low, nis_high=high,
            lag=np.arange(lags + 1), with_dq=with_dq, with_ddq=with_ddq, with_sign=with_sign,
        )  # fmt: skip


def explanation(signal: Signal, found: CauseSearch, entry: LogEntry, clock_std: float) -> Explanation:
    """What a search found, trial by trial."""
    trials, touched = found.trials, entry.role in ("contact", "tissue") and not entry.contact
    unstated = UNSTATED if touched and not (trials[0].white or found.explaining) else ""
    return Explanation(
        log=signal.log,
        joint=signal.joint,
        finding=finding(found),
        verdict=verdict(found) + unstated,
        clock_std=clock_std,
        without=np.array([" + ".join(t.without) or "nothing" for t in trials], object),
        explains=np.array([t in found.explaining for t in trials], np.int64),
        left=np.array([t.tested for t in trials]),
        ljung_box_p_q=np.array([t.ljung_box[0] for t in trials]),
        ljung_box_p_dq=np.array([t.ljung_box[1] for t in trials]),
        periodogram_p_q=np.array([t.periodogram[0] for t in trials]),
        periodogram_p_dq=np.array([t.periodogram[1] for t in trials]),
        walk=np.array([t.walk for t in trials]),
    )
