"""Weigh what hangs on the arm: mass and scale from the external effort of the joints that carry it."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.contact.weighing import (
    PARTS,
    Rows,
    Weighed,
    better,
    mirrored,
    model_errors,
    moved_with,
    offset,
    residual,
    unit_load,
    weighed,
    widening,
)
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.periods.period import guess, refine
from davinci_forces.maths.periods.shift import circular, straight
from davinci_forces.maths.signals.smoothing import segments, smoothed
from davinci_forces.records import Diagnostic, FreeWeight, JointModel, Load, Motion, Weight, diagnostic
from davinci_forces.robots.robot import Robot
from davinci_forces.study import HungMass, LogEntry, Weighing, Weighings

FREE = ("identification", "validation")  # roles of logs in which nothing touches the arm
PER_CUTOFF = 6.0  # rows kept per period of the low-pass's cutoff
CARRIES = 1e-6  # effort of a kilogram, below which a joint does not carry it
FEWEST = 2 * PARTS  # rows of a path that tell anything
TOGETHER = 0.1  # of the range of motion, by how much a tare may be off the path
PHASES = 1000  # of a period, at which two paths are compared
SAME_PERIOD = 0.01  # of a period, by how much a tare's may differ
TELLS = 2.0  # standard errors by which one side of a link has to explain the effort better


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
        yield diagnostic("weigh", entry.name, "note", f"{said}; nothing is weighed")
        return
    moving = [model for model in models if not model.at_rest and len(model) == len(motions[0])]
    loaded = [model for model in moving if not robot.joint(model.joint).effort]
    if entry.role not in FREE and len(loaded) < len(moving):
        which = ", ".join(model.joint for model in moving if model not in loaded)
        said = f"{entry.name}: the effort of {which} is a current, which weighs nothing, and is left out"
        yield diagnostic("weigh", entry.name, "note", f"{said}; state torque_constant where it is known")
    if not hung or not loaded or robot.chain is None:
        return
    motion = whole_motion(motions, robot)
    period = period_of([m for m in motions if m.joint in {model.joint for model in loaded}], robot)
    efforts = {model.joint: external(model, model.tau_hat, lowpass) for model in loaded}
    unseen = efforts
    if entry.role == "identification":
        unseen = {model.joint: external(model, model.tau_hat_unseen, lowpass) for model in loaded}
    for weighing in hung:
        sides = asked(robot.chain, robot, weighing.weight, motion)
        for model in loaded:
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


def gather(loads: Iterable[Load], robot: Robot, weighings: Weighings) -> Iterator[Weight | FreeWeight | Diagnostic]:
    """One Weight per weight log, and one FreeWeight per log of free motion, in which nothing hangs.  Section 7.5

    A current weighs nothing, so joints whose effort is in A are left out.
    """
    every = defaultdict(list)
    for load in loads:
        if len(load) >= FEWEST and np.abs(load.load).max() > CARRIES and not robot.joint(load.joint).effort:
            every[load.weight, load.log].append(load)
    units = {joint.name: joint.unit("{effort}") for joint in robot.joints}
    for weighing in weighings.each:
        own = every[weighing.log, weighing.log]
        logs = {log: ls for (weight, log), ls in every.items() if weight == weighing.log and log != weighing.log}
        if not own:
            said = f"{weighing.log}: no joint that moves carries what hangs on {weighing.weight.moves_with}"
            yield diagnostic(
                "weigh", f"{weighing.log}.mass", "warning",
                f"{said}, or none of them has a fit, or their efforts are currents; nothing is weighed: move a joint "
                "that the mass loads, and state torque_constant where it is known",
            )  # fmt: skip
            continue
        tare, wrong = tared(own, logs.get(weighing.tare, [])) if weighing.tare else ([], "")
        if wrong:
            said = f"{weighing.log}: its tare {weighing.tare} {wrong}; nothing is subtracted"
            yield diagnostic("weigh", f"{weighing.log}.mass", "warning", f"{said}: record the tare along the same path")
        yield from of_log(weighing, own, tare, logs, units)


class Free(NamedTuple):
    """What free motion says of the errors of a mass."""

    sigma: dict[str, float]  # the model's error by joint
    fit_std: float  # [kg] of what all masses by this fit share
    widening: float
    masses: dict[str, Weighed]  # by log
    roles: dict[str, str]


def of_log(
    weighing: Weighing, own: Sequence[Load], tare: Sequence[Load], logs: dict[str, list[Load]], units: dict[str, str]
) -> Iterator[Weight | FreeWeight]:
    """The Weight of one log, and what its load would seem to weigh in logs of free motion."""
    free = of_free_motion(own, logs)
    kept = tare or own
    sides = [rows_of(kept, free.sigma, column) for column in ("load", "load_mirrored")]
    fit_std = 0.0 if tare else free.fit_std
    (mass, run_std), (other, other_std) = (weighed(rows) for rows in sides)
    std, mirrored_std = (free.widening * float(np.hypot(part, fit_std)) for part in (run_std, other_std))
    tells = better(*sides)
    stated = float("nan") if weighing.weight.mass is None else weighing.weight.mass
    of_tare = free.masses.get(weighing.tare, Weighed(float("nan"), float("nan"))) if tare else None
    alone = [weighed([row]) for row in sides[0]]
    left = [float(np.sqrt(np.mean(residual(row, mass) ** 2))) for row in sides[0]]
    yield Weight(
        log=weighing.log,
        moves_with=weighing.weight.moves_with,
        tare=weighing.tare if tare else "",
        stated_mass=stated,
        mass=mass,
        mass_std=std,
        run_std=run_std,
        fit_std=fit_std,
        widening=free.widening,
        mass_mirrored=other,
        mass_mirrored_std=mirrored_std,
        side="as stated" if tells > TELLS else "the other one" if tells < -TELLS else "not told",
        mass_scale=mass / stated,
        mass_scale_std=std / stated,
        tare_mass=of_tare.mass if of_tare else float("nan"),
        tare_mass_std=total(of_tare, free) if of_tare else float("nan"),
        loaded=np.array([load.joint for load in kept], object),
        unit=np.array([units[load.joint] for load in kept], object),
        mass_alone=np.array([w.mass for w in alone]),
        mass_alone_std=np.array([w.std for w in alone]),
        joint_offset=np.array([offset(row, mass) for row in sides[0]]),
        left_rms=np.array(left),
        free_error=np.array([free.sigma[load.joint] for load in kept]),
    )
    for log, seems in free.masses.items():
        yield FreeWeight(log, weighing.log, free.roles[log], seems.mass, total(seems, free))


def total(of_run: Weighed, free: Free) -> float:
    """The standard error of a mass: of its run and of the fit, widened as free motion asks for."""
    return free.widening * float(np.hypot(of_run.std, free.fit_std))


def of_free_motion(own: Sequence[Load], logs: dict[str, list[Load]]) -> Free:
    """The errors of a load's mass as free motion shows them that the fit has not seen.

    What the fit errs by is that of all logs that it was made of, where refits had not seen them; how much the masses
    of other logs exceed their errors widens every one.
    """
    joints = {load.joint for load in own}
    unseen = {
        log: [seen for load in ls if load.joint in joints and (seen := where_unseen(load))] for log, ls in logs.items()
    }
    unseen = {log: ls for log, ls in unseen.items() if ls}
    by_joint: dict[str, list[Rows]] = defaultdict(list)
    for load in (load for ls in unseen.values() for load in ls):
        by_joint[load.joint] += rows_of([load], {}, "load")
    sigma = {joint: model_errors(rows) for joint, rows in by_joint.items()}
    for load in own:  # of a joint that no free motion tells of, by what its own mass leaves
        [row] = rows_of([load], {}, "load")
        sigma.setdefault(load.joint, float(np.std(residual(row, weighed([row]).mass))))
    roles = {log: ls[0].role for log, ls in unseen.items()}
    rows = {log: rows_of(ls, sigma, "load") for log, ls in unseen.items()}
    masses = {log: weighed(of_log) for log, of_log in rows.items()}
    fitted = [row for log, of_log in rows.items() if roles[log] == "identification" for row in of_log]
    of_fit = weighed(fitted) if fitted else Weighed(0.0, 0.0)
    fit_std = max(abs(of_fit.mass), of_fit.std)
    others = [mass for log, mass in masses.items() if roles[log] != "identification"]
    return Free(sigma, fit_std, widening(others, fit_std), masses, roles)


def where_unseen(load: Load) -> Load | None:
    """A load with the effort that its fit has not seen; None where there is none."""
    kept = np.isfinite(load.tau_ext_unseen)
    if kept.sum() < FEWEST:
        return None
    columns = {name: getattr(load, name)[kept] for name in load.columns()}
    return replace(load, **{**columns, "tau_ext": columns["tau_ext_unseen"]})


def rows_of(loads: Sequence[Load], sigma: dict[str, float], column: str) -> list[Rows]:
    """What the joints of a log say of the mass, each weighted by its model's error."""
    return [
        Rows(getattr(load, column), load.tau_ext, np.arange(len(load)) * PARTS // len(load), sigma.get(load.joint, 1.0))
        for load in loads
    ]


def tared(own: Sequence[Load], tare: Sequence[Load]) -> tuple[list[Load], str]:
    """The loads of a log without the effort of its tare at the same places of the path; or what is wrong with it."""
    by_joint = {load.joint: load for load in tare}
    missing = [load.joint for load in own if load.joint not in by_joint]
    if missing:
        return [], f"does not move {' and '.join(missing)}"
    pairs = [(load, by_joint[load.joint]) for load in own]
    (first, its), *_ = pairs
    if abs(first.period - its.period) > SAME_PERIOD * first.period:
        return [], f"repeats every {its.period:.4g} s and not every {first.period:.4g} s (0: not at all)"
    q, other_q = (np.stack([evenly(load) for load in loads], axis=1) for loads in zip(*pairs, strict=True))
    shift = circular(q, other_q) if first.period else straight(q, other_q)
    if shift.apart.max() > TOGETHER:
        worst = own[int(shift.apart.argmax())].joint
        share = f"{shift.apart.max():.2g} of the standard deviation of {worst}"
        return [], f"is not on the same path: at best it is off by {share}, and may be by {TOGETHER:g}"
    return [subtracted(load, other, shift.samples) for load, other in pairs], ""


def evenly(load: Load) -> Array:
    """Where a joint is: so many times a period, or as often as its rate says."""
    if load.period:
        phase = (np.arange(PHASES) + 0.5) / PHASES
        return np.asarray(np.interp(phase, load.t / load.period, load.q, period=1.0))
    return np.asarray(np.interp(np.arange(load.t[0], load.t[-1], 1.0 / load.rate), load.t, load.q))


def subtracted(load: Load, tare: Load, samples: float) -> Load:
    """A load without the effort of its tare, which is so many samples later; where the tare is there, too."""
    if load.period:
        phase = load.t / load.period + samples / PHASES
        return less(load, np.interp(phase, tare.t / tare.period, tare.tau_ext, period=1.0))
    t = load.t - load.t[0] + tare.t[0] + samples / load.rate
    there = (t >= tare.t[0]) & (t <= tare.t[-1])
    kept = replace(load, **{name: getattr(load, name)[there] for name in load.columns()})
    return less(kept, np.interp(t[there], tare.t, tare.tau_ext))


def less(load: Load, tau_ext: Array) -> Load:
    """A load with so much less external effort."""
    return replace(load, tau_ext=load.tau_ext - tau_ext)
