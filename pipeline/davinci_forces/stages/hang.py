"""Hang every weight on free motion, in thought, and on its own log: what it asks of the joints, beside the effort."""

from collections.abc import Iterator, Sequence

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.load import mirrored, moved_with, unit_load
from davinci_forces.maths.periods.period import guess, refine
from davinci_forces.maths.signals.noise import smoothed
from davinci_forces.maths.signals.smoothing import segments
from davinci_forces.records import Diagnostic, JointModel, Load, Motion, diagnostic
from davinci_forces.robots.robot import Robot
from davinci_forces.study import HungMass, LogEntry, Weighings

FREE = ("identification", "validation")  # roles of logs in which nothing touches the arm
PER_CUTOFF = 6.0  # rows kept per period of the low-pass's cutoff


def run(
    models: Sequence[JointModel],
    motions: Sequence[Motion],
    entry: LogEntry,
    robot: Robot,
    weighings: Weighings,
    *,
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
    moving = [model for model in models if not model.at_rest and len(model) == len(motions[0])]
    weighed = [model for model in moving if not robot.joint(model.joint).effort]
    if entry.role not in FREE and len(weighed) < len(moving):
        which = ", ".join(model.joint for model in moving if model not in weighed)
        said = f"{entry.name}: the effort of {which} is a current, which weighs nothing, and is left out"
        yield diagnostic("hang", entry.name, "note", f"{said}; state torque_constant where it is known")
    if not hung or not weighed or robot.chain is None:
        return
    motion = whole_motion(motions, robot)
    period = period_of([m for m in motions if m.joint in {model.joint for model in weighed}], robot)
    efforts = {model.joint: external(model, model.tau_hat, lowpass) for model in weighed}
    unseen = efforts
    if entry.role == "identification":
        unseen = {model.joint: external(model, model.tau_hat_unseen, lowpass) for model in weighed}
    for weighing in hung:
        sides = asked(robot.chain, robot, weighing.weight, motion)
        for model in weighed:
            column = [joint.name for joint in robot.joints].index(model.joint)
            first = float(model.t[0]) - 0.5 / model.rate  # a sample is in the middle of its time
            length = period or float(model.t[-1]) + 0.5 / model.rate - first
            count = max(int(length * min(model.rate, PER_CUTOFF * lowpass) * (1 + 1e-9)), 1)
            loads = [smoothed(side[:, column], motions[0].segment, model.rate, lowpass) for side in sides]
            columns = {
                "q": along(model.t, motion[0][:, column], first, length, count),
                "load": along(model.t, loads[0], first, length, count),
                "load_mirrored": along(model.t, loads[1], first, length, count),
                "tau_ext": along(*efforts[model.joint], first, length, count),
                "tau_ext_unseen": along(*unseen[model.joint], first, length, count),
            }
            kept = np.isfinite(columns["q"])
            yield Load(
                log=model.log, joint=model.joint, weight=weighing.log, role=model.role, rate=count / length,
                period=period, t=((np.arange(count) + 0.5) / count * length)[kept],
                **{name: values[kept] for name, values in columns.items()},
            )  # fmt: skip


def whole_motion(motions: Sequence[Motion], robot: Robot) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration (N, n) of all joints of the robot; 0 of those that the log does not hold."""
    q, dq, ddq = np.zeros((3, len(motions[0]), len(robot.joints)))
    names = [joint.name for joint in robot.joints]
    for motion in motions:
        if len(motion) == len(motions[0]):
            column = names.index(motion.joint)
            q[:, column], dq[:, column], ddq[:, column] = motion.q, motion.dq, motion.ddq
    return q, dq, ddq


def period_of(motions: Sequence[Motion], robot: Robot) -> float:
    """The period [s] of joints that move together; 0 where they do not repeat."""
    part = max(segments(motions[0].segment), key=lambda part: part.stop - part.start)
    positions = [motion.q_measured[part] for motion in motions]
    lag = guess(positions)
    if lag is None:
        return 0.0
    orders = max(robot.joint(motion.joint).harmonics for motion in motions)
    return refine(motions[0].t[part], positions, lag / motions[0].rate, orders)


def external(model: JointModel, tau_hat: Array, lowpass: float) -> tuple[Array, Array]:
    """The times (K,), and the low-passed effort (K,) that a prediction leaves, where there is one."""
    kept = np.isfinite(tau_hat)
    left = (model.tau - tau_hat)[kept]
    return model.t[kept], smoothed(left, model.segment[kept], model.rate, lowpass) if kept.any() else left


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
