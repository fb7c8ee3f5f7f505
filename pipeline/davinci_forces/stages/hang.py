"""Hang every weight on free motion, in thought, and on its own log: what it asks of the joints, beside the effort."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from davinci_forces.identification.regression import measured_motion
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.load import mirrored, moved_with, unit_load
from davinci_forces.maths.periods.period import guess, refine
from davinci_forces.maths.signals.noise import smoothed
from davinci_forces.maths.signals.smoothing import segments
from davinci_forces.records import Diagnostic, Load, Prediction, Signal, Track, diagnostic
from davinci_forces.robots.robot import Robot
from davinci_forces.study import HungMass, LogEntry, Weighings

FREE = ("identification", "validation")  # roles of logs in which nothing touches the arm
PER_CUTOFF = 6.0  # rows kept per period of the low-pass's cutoff


def run(
    signals: Sequence[Signal],
    tracks: Iterable[Track],
    predictions: Iterable[Prediction],
    entry: LogEntry,
    robot: Robot,
    weighings: Weighings,
    *,
    fit: str,
    lowpass: float,
) -> Iterator[Load | Diagnostic]:
    """One Load per joint that moves and weight: a weight log's own one, and all of them in free motion.

    The effort is measured minus modelled, not the filter's: neither its lag nor its random walk bias the mass.
    Joints that the log does not hold are taken to be at 0.  A current weighs nothing, so joints whose effort is in A
    are left out.
    """
    hung = [w for w in weighings.each if entry.role in FREE or w.log == entry.name]
    if hung and robot.chain is None:
        said = f"{entry.name}: {robot.name} has no chain, so what a mass asks of its joints is not known"
        yield diagnostic("hang", entry.name, "note", f"{said}; nothing is weighed")
        return
    moving = [track for track in tracks if not track.at_rest and len(track) == len(signals[0])]
    tracked = [track for track in moving if not robot.joint(track.joint).effort]
    if entry.role not in FREE and len(tracked) < len(moving):
        which = ", ".join(track.joint for track in moving if track not in tracked)
        said = f"{entry.name}: the effort of {which} is a current, which weighs nothing, and is left out"
        yield diagnostic("hang", entry.name, "note", f"{said}; state torque_constant where it is known")
    if not hung or not tracked or robot.chain is None:
        return
    motion = whole_motion(signals, robot, lowpass)
    period = period_of([s for s in signals if s.joint in {t.joint for t in tracked}], robot)
    efforts = {t.joint: (t.t, smoothed(t.tau - t.tau_hat, signals[0].segment, t.rate, lowpass)) for t in tracked}
    unseen = efforts
    if entry.role == "identification":
        named = [p for p in predictions if fit in (p.model, f"{p.model}.{p.estimator}")]
        unseen = {p.joint: (p.t, left(p, signals[0], lowpass)) for p in named}
    for weighing in hung:
        sides = asked(robot.chain, robot, weighing.weight, motion)
        for track in tracked:
            column = [joint.name for joint in robot.joints].index(track.joint)
            first = float(track.t[0]) - 0.5 / track.rate  # a sample is in the middle of its time
            length = period or float(track.t[-1]) + 0.5 / track.rate - first
            count = max(int(length * min(track.rate, PER_CUTOFF * lowpass) * (1 + 1e-9)), 1)
            loads = [smoothed(side[:, column], signals[0].segment, track.rate, lowpass) for side in sides]
            columns = {
                "q": along(track.t, motion[0][:, column], first, length, count),
                "load": along(track.t, loads[0], first, length, count),
                "load_mirrored": along(track.t, loads[1], first, length, count),
                "tau_ext": along(*efforts[track.joint], first, length, count),
                "tau_ext_unseen": along(*unseen.get(track.joint, (track.t[:0], track.t[:0])), first, length, count),
            }
            kept = np.isfinite(columns["q"])
            yield Load(
                log=track.log, joint=track.joint, weight=weighing.log, role=track.role, rate=count / length,
                period=period, t=((np.arange(count) + 0.5) / count * length)[kept],
                **{name: values[kept] for name, values in columns.items()},
            )  # fmt: skip


def whole_motion(signals: Sequence[Signal], robot: Robot, lowpass: float) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration (N, n) of all joints of the robot; 0 of those that the log does not hold."""
    q, dq, ddq = np.zeros((3, len(signals[0]), len(robot.joints)))
    names = [joint.name for joint in robot.joints]
    for signal in signals:
        if len(signal) == len(signals[0]):
            measured, column = measured_motion(signal, lowpass), names.index(signal.joint)
            q[:, column], dq[:, column], ddq[:, column] = measured.q[:, 0], measured.dq[:, 0], measured.ddq[:, 0]
    return q, dq, ddq


def period_of(signals: Sequence[Signal], robot: Robot) -> float:
    """The period [s] of joints that move together; 0 where they do not repeat."""
    part = max(segments(signals[0].segment), key=lambda part: part.stop - part.start)
    positions = [signal.q[part] for signal in signals]
    lag = guess(positions)
    if lag is None:
        return 0.0
    orders = max(robot.joint(signal.joint).harmonics for signal in signals)
    return refine(signals[0].t[part], positions, lag / signals[0].rate, orders)


def left(prediction: Prediction, signal: Signal, lowpass: float) -> Array:
    """What a prediction leaves of the effort, low-passed."""
    segment = signal.segment[np.searchsorted(signal.t, prediction.t - 0.5 / signal.rate)]
    return smoothed(prediction.tau - prediction.tau_hat, segment, signal.rate, lowpass)


def asked(chain: Chain, robot: Robot, weight: HungMass, motion: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """What a kilogram asks of the joints (N, n) where the study has it, and on the other side of its link."""
    link = carrier(chain, robot, weight.moves_with)
    own, other = (unit_load(chain, link, at, *motion) for at in (weight.position, mirrored(weight.position)))
    return own, other


def carrier(chain: Chain, robot: Robot, moves_with: str) -> str:
    """The link that carries a weight: the one of that name, or the one that moves with the joint of that name."""
    names = [joint.name for joint in robot.joints]
    return moved_with(chain, names.index(moves_with)) if moves_with in names else moves_with


def along(t: Array, x: Array, first: float, length: float, count: int) -> Array:
    """The mean of a signal (N,) in so many parts of the path (count,), NaN in those that it does not reach."""
    part = ((t - first) / length % 1.0 * count).astype(np.int64) % count
    samples = np.bincount(part, minlength=count)
    sums = np.bincount(part, x, count)
    return np.where(samples > 0, sums / np.maximum(samples, 1), np.nan)
