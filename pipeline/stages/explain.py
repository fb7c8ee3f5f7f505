"""Explain why the filter's innovations are not white, by taking one cause after the other away."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from pipeline.estimators.driving import Driving, driving, named
from pipeline.estimators.refitting import refitted
from pipeline.estimators.used import FALLBACK, describing, model_of
from pipeline.filters.assumed import assumed
from pipeline.filters.causes import Search, Subject, search
from pipeline.filters.innovations import Innovations, innovations
from pipeline.filters.verdict import finding, verdict
from pipeline.maths.arrays import Array, Booleans
from pipeline.maths.models.driven import Driven
from pipeline.maths.signals.reversals import moving
from pipeline.maths.signals.whiteness import cross_correlation, mean_square_band
from pipeline.maths.signals.windows import longest_run, outside, settled
from pipeline.records import Choice, Explanation, FilterNoise, Fit, Innovation, Signal
from pipeline.robots.robot import Robot
from pipeline.study import LogEntry

LAGS = 100  # of the correlation with the motion
MODELS = 2  # others that are tried
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
    every, chosen, settled_noises = list(fits), list(choices), {noise.joint: noise for noise in noises}
    for signal in signals:
        if signal.at_rest or signal.joint not in settled_noises or not describing(robot, every, signal.joint):
            continue
        kept, _ = named(signal, signals, every, chosen, robot, fit)
        own = driving(signal, signals, kept, robot, lowpass)
        if own.joint.inertia.min() <= 0:
            continue
        noise, run_ = assumed(settled_noises[signal.joint], 1.0 / signal.rate, q_tau), longest_run(signal.t, signal.rate)
        free = outside(signal.t, entry.contact)
        used, motion = longest(own), tuple(x[run_] for x in own.motion[1:])
        yield from described(signal, used, innovations(used, noise), motion)
        models = {"": own, **others(own, signals, every, robot, lowpass, free)}
        subject = Subject(
            {name: longest(by) for name, by in models.items()}, noise, free[run_], moving(motion[0], used.T_s)
        )
        yield explanation(signal, search(subject))


def longest(own: Driving) -> Driven:
    """The longest run of a joint's recording."""
    return max(own.parts, key=lambda part: len(part.q))


def others(
    own: Driving, signals: Sequence[Signal], fits: Sequence[Fit], robot: Robot, lowpass: float, free: Booleans
) -> dict[str, Driving]:
    """The joint under other models: with parameters of this log itself, and of another structure."""
    tried = {THIS_LOG: refitted(own, signals, robot, lowpass, free)}
    for fit in describing(robot, fits, own.signal.joint):
        if fit.model != own.fit.model and len(tried) <= MODELS and told(fit, own.signal, signals, robot):
            tried.setdefault(fit.model, fit)
    made = {name: driving(own.signal, signals, fit, robot, lowpass) for name, fit in tried.items()}
    return {name: by for name, by in made.items() if by.joint.inertia.min() > 0}


def told(fit: Fit, signal: Signal, signals: Sequence[Signal], robot: Robot) -> bool:
    """Whether a log holds what a fit of another structure needs."""
    if fit.model == "independent" and f"{fit.model}.{fit.estimator}" != FALLBACK:
        return False
    return set(model_of(robot, fit).joints) <= {s.joint for s in signals if len(s) == len(signal)}


def described(signal: Signal, used: Driven, made: Innovations, motion: tuple[Array, ...]) -> Iterator[Innovation]:
    """The size of both innovations, and their correlation with the motion before."""
    kept = settled(used.T_s * np.arange(len(used.q)))
    dq, ddq = (x[kept] for x in motion)
    N = int(kept.sum())
    lags = min(LAGS, N // 4)
    low, high = mean_square_band(N)
    for name, x, std in (("innovation_q", made.q, made.q_std), ("innovation_dq", made.dq, made.dq_std)):
        normalised = (x / std)[kept]
        with_dq, with_ddq, with_sign = (
            cross_correlation(normalised, u, lags)[lags:] for u in (dq, ddq, np.sign(dq))
        )
        yield Innovation(
            log=signal.log, joint=signal.joint, signal=name, tested=N, band=1.96 / N**0.5,
            nis_own=float(np.mean(normalised**2)), nis_low=low, nis_high=high, lag=np.arange(lags + 1),
            with_dq=with_dq, with_ddq=with_ddq, with_sign=with_sign,
        )  # fmt: skip


def explanation(signal: Signal, found: Search) -> Explanation:
    """What a search found, trial by trial."""
    trials = found.trials
    return Explanation(
        log=signal.log,
        joint=signal.joint,
        finding=finding(found),
        verdict=verdict(found),
        without=np.array([" + ".join(t.without) or "nothing" for t in trials], object),
        explains=np.array([t in found.explaining for t in trials], np.int64),
        left=np.array([t.tested for t in trials]),
        ljung_box_p_q=np.array([t.ljung_box[0] for t in trials]),
        ljung_box_p_dq=np.array([t.ljung_box[1] for t in trials]),
        periodogram_p_q=np.array([t.periodogram[0] for t in trials]),
        periodogram_p_dq=np.array([t.periodogram[1] for t in trials]),
        walk=np.array([t.walk for t in trials]),
    )
