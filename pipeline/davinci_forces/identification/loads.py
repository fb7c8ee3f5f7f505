"""The effort of a mass along the path of a log, without that of a tare, and how it differs between periods."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.contact import weighing
from davinci_forces.maths.contact.weighing import PARTS, Rows, error_between
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.kinematics import remote_centre, tip
from davinci_forces.maths.periods.period import refine
from davinci_forces.maths.periods.repetition import harmonics_of, repetition
from davinci_forces.maths.periods.shift import circular, straight
from davinci_forces.maths.signals.smoothing import lowpass_segments, segments
from davinci_forces.records.prediction import JointModel
from davinci_forces.records.record import by_name
from davinci_forces.records.recordings import Motion
from davinci_forces.records.weight import Load
from davinci_forces.robots.robot import Robot

MIN_WHOLE = 0.9  # share of a path that a period covers, from which it counts
MAX_TARE_DISTANCE = 0.1  # between the paths of a log and its tare, over the standard deviation of the position
PHASES = 1000  # phases of a period at which two paths are compared
MAX_PERIOD_DIFFERENCE = 0.01  # between a log and its tare, relative to the period
MIN_ROWS = 2 * PARTS  # rows of a path in each joint


def whole_motion(motions: Sequence[Motion], robot: Robot) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration (N, n) of all joints; 0 for joints that the log does not hold."""
    q, dq, ddq = np.zeros((3, len(motions[0]), len(robot.joints)))
    names = [joint.name for joint in robot.joints]
    for motion in motions:
        if len(motion) == len(motions[0]):
            column = names.index(motion.joint)
            q[:, column], dq[:, column], ddq[:, column] = motion.q, motion.dq, motion.ddq
    return q, dq, ddq


def period_of(motions: Sequence[Motion], robot: Robot) -> float:
    """Common period [s] of the joints; 0 if the motion does not repeat."""
    part = max(segments(motions[0].segment), key=lambda part: part.stop - part.start)
    positions = [motion.q_measured[part] for motion in motions]
    match = repetition(positions)
    if match is None:
        return 0.0
    orders = harmonics_of(positions, match, max(robot.joint(motion.joint).harmonics for motion in motions))
    return refine(motions[0].t[part], positions, match.lag / motions[0].rate, orders)


def external_effort(model: JointModel, tau_hat: Array, lowpass: float) -> tuple[Array, Array]:
    """Times (K,) at which a moving joint's effort is measured and predicted, and the low-passed difference (K,)."""
    predicted = np.isfinite(tau_hat)
    tau_ext = (model.tau - tau_hat)[predicted]
    if predicted.any():
        tau_ext = lowpass_segments(tau_ext, model.segment[predicted], model.rate, lowpass)
    measured = model.unscored[predicted] == 0
    return model.t[predicted][measured], tau_ext[measured]


def loads_per_kilogram(
    chain: Chain, robot: Robot, moves_with: str, position: Sequence[float] | None, motion: tuple[Array, Array, Array]
) -> tuple[Array, Array]:
    """Joint effort of a kilogram (N, n) at a position on a joint or link, or at the tip, and at its mirror position."""
    names = [joint.name for joint in robot.joints]
    place = tip(chain, np.zeros(len(names))) - remote_centre(chain) if position is None else np.array(position)
    link = moves_with or chain.links[int(chain.body[chain.names.index(chain.tip)]) - 1]
    if link in names:  # a joint, with which a link moves
        link = weighing.moved_with(chain, names.index(link))
    stated, opposite = (weighing.unit_load(chain, link, at, *motion) for at in (place, weighing.mirror_position(place)))
    return stated, opposite


def periods_of(
    load: tuple[Array, Array], tau_ext: tuple[Array, Array], first: float, length: float, count: int
) -> list[Rows]:
    """The rows of each almost whole period of a path, in `count` parts, of a load and an effort with their times."""
    rows = []
    for period in range(int((load[0][-1] - first) // length) + 1):
        ends = (first + period * length, first + (period + 1) * length)
        inside = [(t, values, slice(*np.searchsorted(t, ends))) for t, values in (load, tau_ext)]
        x, y = (path_means(t[part], values[part], first, length, count) for t, values, part in inside)
        both = np.isfinite(x) & np.isfinite(y)
        if both.sum() > MIN_WHOLE * count:
            rows.append(Rows(x[both], y[both], np.zeros(int(both.sum()), np.int64)))
    return rows


def path_means(t: Array, x: Array, first: float, length: float, count: int) -> Array:
    """Mean of a signal (N,) in each of `count` parts of the path; NaN in parts without samples."""
    part = ((t - first) / length % 1.0 * count).astype(np.int64) % count
    samples = np.bincount(part, minlength=count)
    sums = np.bincount(part, x, count)
    return np.where(samples > 0, sums / np.maximum(samples, 1), np.nan)


def unseen_part(load: Load) -> Load | None:
    """Rows of a load with effort residuals from refits without those rows; None if the rows are too few."""
    unseen = np.isfinite(load.tau_ext_unseen)
    if unseen.sum() < MIN_ROWS:
        return None
    part = load.select(unseen)
    return replace(part, tau_ext=part.tau_ext_unseen)


def rows_of(loads: Sequence[Load], sigma: dict[str, float], column: str) -> list[Rows]:
    """Rows of the regression for the mass, one entry per joint of a log, weighted by the error of its model."""
    return [
        Rows(getattr(load, column), load.tau_ext, np.arange(len(load)) * PARTS // len(load), sigma.get(load.joint, 1.0))
        for load in loads
    ]


def errors_between(carrying: Sequence[Load], tare: Sequence[Load], others: Sequence[Load]) -> dict[str, float]:
    """Standard error of the mass that each joint alone tells, by its spread between periods, with that of the tare."""
    spreads = {
        joint: [(load.periods, load.period_spread) for load in loads]
        for joint, loads in by_name([*carrying, *others], "joint").items()
    }
    errors = {load.joint: error_between(spreads[load.joint], load.periods) for load in carrying}
    for load in tare:
        if load.joint in errors:
            errors[load.joint] = float(np.hypot(errors[load.joint], error_between(spreads[load.joint], load.periods)))
    return errors


def subtract_tare(loads: Sequence[Load], tare: Sequence[Load]) -> tuple[list[Load], str]:
    """Subtract the effort of the tare at the same positions of the path; if that is not possible, return the reason."""
    by_joint = {load.joint: load for load in tare}
    missing = [load.joint for load in loads if load.joint not in by_joint]
    if missing:
        return [], f"does not move {' and '.join(missing)}"
    pairs = [(load, by_joint[load.joint]) for load in loads]
    period, tare_period = pairs[0][0].period, pairs[0][1].period
    if abs(period - tare_period) > MAX_PERIOD_DIFFERENCE * period:
        return [], f"repeats every {tare_period:.4g} s and not every {period:.4g} s (0: not at all)"
    q, q_tare = (np.stack([even_positions(load) for load in column], axis=1) for column in zip(*pairs, strict=True))
    samples, apart = circular(q, q_tare) if period else straight(q, q_tare)
    if apart.max() > MAX_TARE_DISTANCE:
        worst = loads[int(apart.argmax())].joint
        distance = f"{apart.max():.2g} of the standard deviation of {worst}"
        return [], f"is not on the same path: at best it is off by {distance}, above {MAX_TARE_DISTANCE:g}"
    return [subtract_joint_tare(*pair, samples) for pair in pairs], ""


def even_positions(load: Load) -> Array:
    """Position of a joint at `PHASES` phases of a period, or at the load's rate if the motion does not repeat."""
    if load.period:
        phase = (np.arange(PHASES) + 0.5) / PHASES
        return np.asarray(np.interp(phase, load.t / load.period, load.q, period=1.0))
    return np.asarray(np.interp(np.arange(load.t[0], load.t[-1], 1.0 / load.rate), load.t, load.q))


def subtract_joint_tare(load: Load, tare: Load, samples: float) -> Load:
    """Subtract the effort of a joint's tare, which lags by `samples`, on the part of the path that both logs cover."""
    if load.period:
        phase = load.t / load.period + samples / PHASES
        tare_effort = np.interp(phase, tare.t / tare.period, tare.tau_ext, period=1.0)
        return replace(load, tau_ext=load.tau_ext - tare_effort)
    t = load.t - load.t[0] + tare.t[0] + samples / load.rate
    shared = (t >= tare.t[0]) & (t <= tare.t[-1])
    part = load.select(shared)
    return replace(part, tau_ext=part.tau_ext - np.interp(t[shared], tare.t, tare.tau_ext))
