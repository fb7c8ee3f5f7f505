"""Calibrate the band: what the filter makes of free motion by a fit that has not seen it."""

from collections.abc import Collection, Iterable, Iterator, Sequence

import numpy as np

from davinci_forces.filters import DEFAULT, diverges, through
from davinci_forces.filters.assumed import assumed
from davinci_forces.filters.lag import lag
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.identification.driving import Driving, driving, motions_of, named
from davinci_forces.identification.paths import ANOTHER_PATH, SAME_PATH, follows
from davinci_forces.identification.used import describing
from davinci_forces.maths.signals.windows import free_space
from davinci_forces.maths.uncertainty.error_band import cells
from davinci_forces.records import Choice, FilterNoise, Fit, FittedPaths, FreeMotion, Prediction, Signal
from davinci_forces.records.predict import CHOSEN
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

FEWEST = 100  # samples of free motion, below which nothing is said of its error


def run(
    signals: Sequence[Signal],
    predictions: Collection[Prediction],
    fits: Iterable[Fit],
    choices: Iterable[Choice],
    noises: Iterable[FilterNoise],
    paths: Iterable[FittedPaths],
    entry: LogEntry,
    robot: Robot,
    *,
    fit: str,
    lowpass: float,
    q_tau: float,
) -> Iterator[FreeMotion]:
    """One FreeMotion per joint that moves; of an identification log, by refits that left out what they predict."""
    if not entry.tells_free_space:
        return
    every, chosen = list(fits), list(choices)
    unseen = [p for p in predictions if (p.model == CHOSEN) == (fit == CHOSEN)]  # one fit's, of ten, of a long log
    settled, fitted = {noise.joint: noise for noise in noises}, {path.joint: path for path in paths}
    motions = motions_of(signals, lowpass)
    for signal in signals:
        if signal.at_rest or signal.joint not in settled or not describing(robot, every, signal.joint):
            continue
        kept, _ = named(signal, signals, every, chosen, robot, fit)
        own = driving(signal, motions, kept, robot)
        path, scheme = ANOTHER_PATH, entry.role
        if entry.role == "identification":
            refitted = left_out(own, unseen, fit)
            if refitted is None:
                continue
            own, path, scheme = refitted
        elif signal.joint in fitted and follows(signal, fitted[signal.joint]):
            path = SAME_PATH
        if own.joint.inertia.min() > 0:
            noise = assumed(settled[signal.joint], robot.joint(signal.joint), 1.0 / signal.rate, q_tau)
            yield from free_motion(own, path, scheme, settled[signal.joint].speed, entry, noise)


def left_out(own: Driving, predictions: Sequence[Prediction], fit: str) -> tuple[Driving, str, str] | None:
    """A joint of an identification log by refits that had not seen each of its samples, where there are such."""
    wanted = (CHOSEN,) if fit == CHOSEN else (own.fit.model, own.fit.estimator)
    made = [p for p in predictions if p.joint == own.signal.joint and (p.model, p.estimator)[: len(wanted)] == wanted]
    if not made:
        return None
    near = np.searchsorted(made[0].t, own.signal.t - 0.5 / own.signal.rate)
    at = np.minimum(near, len(made[0].t) - 1)
    there = np.abs(made[0].t[at] - own.signal.t) < 0.5 / own.signal.rate
    return own.by(np.where(there, made[0].tau_hat[at], own.tau_hat)), made[0].path, made[0].scheme


def free_motion(
    own: Driving, path: str, scheme: str, speed: float, entry: LogEntry, noise: NoiseModel
) -> Iterator[FreeMotion]:
    """The mean squares of what the filter makes of one joint of a log, outside of contacts."""
    signal = own.signal
    free = free_space(signal.t, entry.contact, signal.rate)
    if int(free.sum()) < FEWEST:
        return
    made = through(DEFAULT, own.parts, noise)
    if diverges(made):
        return
    _, block, speed_bin, count, mean_square, filter_square, _ = cells(
        made.tau_ext[free], (made.tau_ext_std**2 + lag(own.parts, noise)[1] ** 2)[free], signal.dq[free], speed
    )
    yield FreeMotion(
        log=signal.log, joint=signal.joint, path=path, scheme=scheme, tested=int(free.sum()),
        free_mean=float(made.tau_ext[free].mean()), block=block, speed_bin=speed_bin, count=count,
        mean_square=mean_square, filter_square=filter_square,
    )  # fmt: skip
