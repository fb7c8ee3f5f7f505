"""Estimate the mass on the arm from the joint efforts of a weight log, and torque constants from a known mass."""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.identification import loads as paths
from davinci_forces.maths.contact import weighing
from davinci_forces.maths.contact.weighing import Agreement, MassEstimate
from davinci_forces.maths.signals.smoothing import lowpass_segments
from davinci_forces.maths.uncertainty.bootstrap import root_mean_square
from davinci_forces.maths.uncertainty.error_band import NORMAL_95
from davinci_forces.records.prediction import JointModel
from davinci_forces.records.record import Diagnostic, by_name, diagnostic, join_names
from davinci_forces.records.recordings import Motion
from davinci_forces.records.weight import SAME, FreeWeight, Load, TorqueConstant, Weight
from davinci_forces.robots.robot import Joint, Robot
from davinci_forces.study import LogEntry, Weighing, Weighings

FREE_ROLES = ("identification", "validation")  # roles of logs in which nothing touches the arm
ROWS_PER_CUTOFF_PERIOD = 6.0  # rows of a Load per period of the low-pass's cutoff frequency
MIN_LOAD = 1e-6  # [effort/kg]; a joint with less does not carry the mass
MAX_RELATIVE_ERROR = 1 / 3  # standard error over the mass, up to which a torque constant is proposed
MIN_SIDE_DIFFERENCE = 2.0  # [standard errors] by which the better side of a link must explain the effort better


def run(
    models: Sequence[JointModel],
    motions: Sequence[Motion],
    entry: LogEntry,
    robot: Robot,
    weighings: Weighings,
    *,
    lowpass: float,
) -> Iterator[Load | Diagnostic]:
    """Compute the joint effort per kilogram of each mass, along its weight log and along free motion.

    One Load per weight and moving joint.  Its effort is measured minus modelled effort, not the filter's effort, whose
    lag and random walk would bias the mass.  Joints that the log does not hold are taken to be at 0.  Of a joint whose
    effort is in A, the load is the current of a motor with a torque constant of 1 N m/A.
    """
    relevant = [w for w in weighings.each if entry.role in FREE_ROLES or w.log == entry.name]
    if relevant and robot.chain is None:
        message = f"{entry.name}: {robot.name} has no chain, so the joint effort of a mass is not known"
        yield diagnostic("weigh", entry.name, "note", f"{message}; no mass is estimated")
        return
    moving = [model for model in models if not model.at_rest and len(model) == len(motions[0])]
    if entry.role not in FREE_ROLES and (currents := [m.joint for m in moving if robot.joint(m.joint).effort]):
        names = ", ".join(currents)
        message = f"{entry.name}: the effort of {names} is a current, not a force, and is left out"
        yield diagnostic("weigh", entry.name, "note", f"{message}; state torque_constant where it is known")
    if not relevant or not moving or robot.chain is None:
        return
    measured = {source.joint for source in entry.channels if source.symbol == "i"}
    motion = paths.whole_motion(motions, robot)
    period = paths.period_of([m for m in motions if m.joint in {model.joint for model in moving}], robot)
    efforts = {model.joint: paths.external_effort(model, model.tau_hat, lowpass) for model in moving}
    unseen = efforts
    if entry.role == "identification":
        unseen = {model.joint: paths.external_effort(model, model.tau_hat_unseen, lowpass) for model in moving}
    for weight_log in relevant:
        sides = paths.loads_per_kilogram(
            robot.chain, robot, weight_log.weight.moves_with, weight_log.weight.position, motion
        )
        for model in moving:
            joint = robot.joint(model.joint)
            per_current = joint.gear_ratio if joint.effort else 1.0
            column = [joint.name for joint in robot.joints].index(model.joint)
            first = float(model.t[0]) - 0.5 / model.rate  # a sample is in the middle of its time
            length = period or float(model.t[-1]) + 0.5 / model.rate - first
            count = max(int(length * min(model.rate, ROWS_PER_CUTOFF_PERIOD * lowpass) * (1 + 1e-9)), 1)
            loads = [
                lowpass_segments(side[:, column] / per_current, motions[0].segment, model.rate, lowpass)
                for side in sides
            ]
            columns = {
                "q": paths.path_means(model.t, motion[0][:, column], first, length, count),
                "load": paths.path_means(model.t, loads[0], first, length, count),
                "load_mirrored": paths.path_means(model.t, loads[1], first, length, count),
                "tau_ext": paths.path_means(*efforts[model.joint], first, length, count),
                "tau_ext_unseen": paths.path_means(*unseen[model.joint], first, length, count),
            }
            reached = np.isfinite(columns["q"]) & np.isfinite(columns["tau_ext"])
            each = paths.periods_of((model.t, loads[0]), efforts[model.joint], first, length, count)
            spread = weighing.spread_between(each) if np.abs(loads[0]).max() > MIN_LOAD else 0.0
            yield Load.like(
                model, weight=weight_log.log, rate=count / length, period=period, periods=len(each),
                period_spread=spread, is_current=int(bool(joint.effort) or joint.name in measured),
                t=((np.arange(count) + 0.5) / count * length)[reached],
                **{name: values[reached] for name, values in columns.items()},
            )  # fmt: skip


def gather(
    loads: Iterable[Load], robot: Robot, weighings: Weighings
) -> Iterator[Weight | FreeWeight | TorqueConstant | Diagnostic]:
    """Estimate one Weight per weight log, and one FreeWeight per log of free motion, without a mass.  Section 7.5

    Joints whose effort is in A are left out, because a current is not a force.  A known mass gives the torque constant
    of each joint whose current was measured.
    """
    usable = [load for load in loads if len(load) >= paths.MIN_ROWS and np.abs(load.load).max() > MIN_LOAD]
    for weight_log in weighings.each:
        carrying = [load for load in usable if load.weight == weight_log.log == load.log]
        others = [load for load in usable if load.weight == weight_log.log != load.log]
        of_tare = [load for load in others if load.log == weight_log.tare]
        tare, fault = paths.subtract_tare(carrying, of_tare) if weight_log.tare and carrying else ([], "")
        spread = paths.errors_between(carrying, of_tare if tare else (), others)
        constants = [*torque_constants(weight_log, carrying, tare, others, robot, spread)]
        yield from constants
        weight_loads, tare = ([ls for ls in of if not robot.joint(ls.joint).effort] for of in (carrying, tare))
        if not weight_loads:
            link = weight_log.weight.moves_with or "the tip"
            message = f"no moving joint carries the mass on {link}, or none of them has a fit"
            remedy = "move a joint that the mass loads"
            if carrying:
                message = "the efforts of the joints that carry the mass are currents"
                remedy = "state their torque_constant, which a log of a known mass gives"
                records = [record for record in constants if isinstance(record, TorqueConstant)]
                if values := [f"torque_constant = {of.torque_constant:.4g} for {of.joint}" for of in records]:
                    remedy = f"this known mass gives {join_names(values)}; write each in "
                    remedy += '[robot_overrides.<joint>] of study.toml, in place of effort = "A"'
            text = f"{weight_log.log}: {message}; no mass is estimated: {remedy}"
            yield diagnostic("weigh", f"{weight_log.log}.mass", "warning", text)
            continue
        if fault:
            message = f"{weight_log.log}: its tare {weight_log.tare} {fault}, and is not subtracted"
            remedy = "the mass is then of the model alone: record the tare along the same path, or delete that line"
            yield diagnostic("weigh", f"{weight_log.log}.mass", "warning", f"{message}; {remedy}")
        yield from estimate_mass(weight_log, weight_loads, tare, others, robot, spread)


def torque_constants(
    weight_log: Weighing, loads: Sequence[Load], tare: Sequence[Load], others: Sequence[Load], robot: Robot,
    spread: dict[str, float],
) -> Iterator[TorqueConstant | Diagnostic]:  # fmt: skip
    """Propose the torque constant of each joint whose current was measured, so that it carries the known mass.

    No stage applies it.  A joint whose current shows the mass with a larger relative error than
    `MAX_RELATIVE_ERROR` is left out.
    """
    for i, load in enumerate(loads if weight_log.weight.mass else ()):
        if not load.is_current:
            continue
        joint = robot.joint(load.joint)
        same = [other for other in others if other.joint == load.joint and not tare]
        parts = [tare[i] if tare else load, *filter(None, map(paths.unseen_part, same))]
        run, *free = (weighing.fit_mass(paths.rows_of([part], {}, "load")) for part in parts)
        run = run._replace(std=max(run.std, spread[load.joint]))
        apparent = MassEstimate(run.mass, weighing.pooled_std(run, free))
        if not apparent.std <= MAX_RELATIVE_ERROR * apparent.mass:
            text = (
                f"{load.log}/{load.joint}: its current shows the known mass too imprecisely for a torque constant, as "
                "where its axis is vertical; take the constant from a data sheet, or pull with a known force"
            )
            if apparent.std <= -MAX_RELATIVE_ERROR * apparent.mass:
                text = f"{load.log}/{load.joint}: the known mass appears negative, so it gives no torque constant"
            yield diagnostic("weigh", f"{load.log}.{load.joint}.torque-constant", "note", text)
            continue
        assert weight_log.weight.mass
        scaled = weighing.scaled_constant(joint.torque_constant, weight_log.weight.mass, apparent)
        stated = float("nan") if joint.effort else joint.torque_constant
        record = TorqueConstant(weight_log.log, load.joint, weight_log.weight.mass, stated, *scaled)
        yield record
        subject = f"{weight_log.log}.{load.joint}.torque-constant"
        yield diagnostic("weigh", subject, "note", proposal(record, joint))


def proposal(record: TorqueConstant, joint: Joint) -> str:
    """State the torque constant that a known mass gives, beside that of the study, and how to apply it."""
    value, std, used = record.torque_constant, record.torque_constant_std, record.torque_constant_used
    decimals = max(1 - int(np.floor(np.log10(std))), 0)
    constant = f"torque_constant = {value:.{decimals}f} ± {std:.{decimals}f} {joint.unit('{torque_constant}')}"
    gives = f"the known mass of {record.stated_mass:g} kg gives {constant} with gear_ratio = {joint.gear_ratio:g}"
    text = f"{record.log}/{record.joint}: {gives}"
    if np.isnan(used):
        return f'{text}; it is not applied: to use it, state it for this joint in place of effort = "A"'
    away = abs(value - used) / std
    agrees = away <= NORMAL_95 or abs(value - used) <= SAME * used
    verdict = "which agrees" if agrees else "which differs: check mass, position, gear and motor"
    return f"{text}; {used:g} is used, {away:.1f} standard errors away, {verdict}; the proposal is not applied"


class FreeMotionErrors(NamedTuple):
    """Errors of a mass, estimated from logs of free motion."""

    sigma: dict[str, float]  # error of the model, by joint
    sigma_std: dict[str, float]
    fit_std: float  # [kg] standard deviation of the error that all masses from this fit share
    false_mass: dict[str, float]  # [kg] root mean square of the mass that each joint alone tells in free motion
    widening: float
    masses: dict[str, MassEstimate]  # by log
    roles: dict[str, str]


def estimate_mass(
    weight_log: Weighing, loads: Sequence[Load], tare: Sequence[Load], others: Sequence[Load], robot: Robot,
    spread: dict[str, float],
) -> Iterator[Weight | FreeWeight | Diagnostic]:  # fmt: skip
    """Estimate the mass of one weight log, by its loads without the `tare`, and the mass in logs of free motion."""
    free = free_motion_errors(loads, others)
    loads = tare or loads
    sides = [paths.rows_of(loads, free.sigma, column) for column in ("load", "load_mirrored")]
    joints = [load.joint for load in loads]
    false = np.zeros(len(loads)) if tare else np.array([free.false_mass.get(joint, 0.0) for joint in joints])
    fit_std = 0.0 if tare else free.fit_std
    alone = [
        [
            MassEstimate(mass, float(np.hypot(max(std, spread[load.joint]), error)))
            for (mass, std), load, error in zip(masses, loads, false, strict=True)
        ]
        for masses in ([weighing.fit_mass([row]) for row in side] for side in sides)
    ]
    test, mirrored_test = (weighing.agreement(masses) for masses in alone)
    between = float(np.linalg.norm(weighing.shares(sides[0]) * [spread[joint] for joint in joints]))
    (mass, run_std), (mass_mirrored, mirrored_run_std) = (weighing.fit_mass(rows) for rows in sides)
    run_std, mirrored_run_std = max(run_std, between), max(mirrored_run_std, between)
    std = widen(free.widening * float(np.hypot(run_std, fit_std)), mass, alone[0], test)
    mirrored_std = free.widening * float(np.hypot(mirrored_run_std, fit_std))
    stated = float("nan") if weight_log.weight.mass is None else weight_log.weight.mass
    residual_rms = np.array([root_mean_square(weighing.residual(row, mass)) for row in sides[0]])
    tare_mass = free.masses.get(weight_log.tare if tare else "", MassEstimate(float("nan"), float("nan")))
    differing = joints[test.differing] if test.ratio > 1.0 else ""
    if differing:
        text = contradiction(weight_log.log, joints, alone[0], test)
        yield diagnostic("weigh", f"{weight_log.log}.joints", "warning", text)
    yield Weight(
        log=weight_log.log, moves_with=weight_log.weight.moves_with, tare=weight_log.tare if tare else "",
        stated_mass=stated, mass=mass, mass_std=std, run_std=run_std, fit_std=fit_std, widening=free.widening,
        agreement=test.probability, agreement_mirrored=mirrored_test.probability, birge_ratio=test.ratio,
        differing=differing, mass_mirrored=mass_mirrored,
        mass_mirrored_std=widen(mirrored_std, mass_mirrored, alone[1], mirrored_test),
        side=side_of(weighing.better(*sides), mass_mirrored), mass_scale=mass / stated, mass_scale_std=std / stated,
        tare_mass=tare_mass.mass, tare_mass_std=total_std(tare_mass, free), loaded=np.array(joints, object),
        unit=np.array([robot.joint(joint).unit("{effort}") for joint in joints], object),
        mass_alone=np.array([m.mass for m in alone[0]]), mass_alone_std=np.array([m.std for m in alone[0]]),
        mirrored_alone=np.array([m.mass for m in alone[1]]), mirrored_alone_std=np.array([m.std for m in alone[1]]),
        false_mass=false,
        joint_offset=np.array([weighing.offset(row, mass) if row.varies else np.nan for row in sides[0]]),
        joint_offset_std=np.array([weighing.offset_std(row, MassEstimate(mass, std)) for row in sides[0]]),
        left_rms=residual_rms[:, 0], left_rms_std=residual_rms[:, 1],
        free_error=np.array([free.sigma[joint] for joint in joints]),
        free_error_std=np.array([free.sigma_std.get(joint, float("nan")) for joint in joints]),
    )  # fmt: skip
    for log, free_mass in free.masses.items():
        yield FreeWeight(log, weight_log.log, free.roles[log], free_mass.mass, total_std(free_mass, free))


def widen(std: float, mass: float, alone: Sequence[MassEstimate], test: Agreement) -> float:
    """Widen a standard error by the Birge ratio, and until its interval contains that of every contradicting joint.

    Which joint is right is not known, and the mean is near the joint with the smallest standard error.
    """
    if test.ratio == 1.0:
        return std
    return max(test.ratio * std, *(abs(joint.mass - mass) / NORMAL_95 + joint.std for joint in alone))


def contradiction(log: str, joints: Sequence[str], alone: Sequence[MassEstimate], test: Agreement) -> str:
    """State that the joints tell different masses, and by which joint."""
    masses = ", ".join(f"{joint} {m.mass:.3g} ± {m.std:.2g} kg" for joint, m in zip(joints, alone, strict=True))
    return (
        f"{log}: the joints tell different masses ({masses}; probability {test.probability:.1g} if they agree), "
        f"{joints[test.differing]} most of all; the interval is widened to contain all: check this joint's "
        "model at this speed, its gear and motor, and the position of the mass, which is from the remote centre that "
        "`davinci-forces robot` prints"
    )


def side_of(advantage: float, mirrored: float) -> str:
    """Side of the link on which the mass is, by how much better the stated side explains the effort.

    A `mirrored` mass that is negative shows that it is not on the other side.
    """
    if advantage > MIN_SIDE_DIFFERENCE:
        return "as stated"
    return "the other one" if advantage < -MIN_SIDE_DIFFERENCE and mirrored > 0.0 else "not told"


def total_std(mass: MassEstimate, free: FreeMotionErrors) -> float:
    """Standard error of a mass: of its run and of the fit, widened by the factor from free motion."""
    return free.widening * float(np.hypot(mass.std, free.fit_std))


def free_motion_errors(weight_loads: Sequence[Load], others: Sequence[Load]) -> FreeMotionErrors:
    """Compute the errors of a mass from free motion that the fit has not seen.

    The error of a joint is the mass that it alone shows in free motion, at the speeds of these logs; there are refits
    without the samples of identification logs.  The error of the fit combines the joints, or is the apparent mass in
    identification logs if that is larger.  The apparent masses of other logs, over their errors, give the factor that
    widens all errors.
    """
    joints = {load.joint for load in weight_loads}
    unseen = list(filter(None, (paths.unseen_part(load) for load in others if load.joint in joints)))
    by_log = by_name(unseen, "log")
    by_joint = {joint: paths.rows_of(ls, {}, "load") for joint, ls in by_name(unseen, "joint").items()}
    sigma = {joint: weighing.model_errors(rows) for joint, rows in by_joint.items()}
    sigma_std = {
        joint: root_mean_square(np.concatenate([weighing.residual(row, 0.0) for row in rows]))[1]
        for joint, rows in by_joint.items()
    }
    for load in weight_loads:  # a joint without free motion gets the residual of its weight log
        [row] = paths.rows_of([load], {}, "load")
        sigma.setdefault(load.joint, float(np.std(weighing.residual(row, weighing.fit_mass([row]).mass))))
    roles = {log: ls[0].role for log, ls in by_log.items()}
    rows = {log: paths.rows_of(ls, sigma, "load") for log, ls in by_log.items()}
    masses = {log: weighing.fit_mass(log_rows) for log, log_rows in rows.items()}
    fitted = [row for log, log_rows in rows.items() if roles[log] == "identification" for row in log_rows]
    of_fitted = weighing.fit_mass(fitted) if fitted else MassEstimate(0.0, 0.0)
    false_mass = {
        joint: float(np.sqrt(np.mean([np.max(np.square(weighing.fit_mass([row]))) for row in joint_rows])))
        for joint, joint_rows in by_joint.items()
    }
    weight_shares = weighing.shares(paths.rows_of(weight_loads, sigma, "load"))
    by_shares = np.linalg.norm(weight_shares * [false_mass.get(load.joint, 0.0) for load in weight_loads])
    fit_std = max(abs(of_fitted.mass), of_fitted.std, float(by_shares))
    validation = [mass for log, mass in masses.items() if roles[log] != "identification"]
    return FreeMotionErrors(
        sigma, sigma_std, fit_std, false_mass, weighing.widening_factor(validation, fit_std), masses, roles
    )
