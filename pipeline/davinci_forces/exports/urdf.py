"""The arm as URDF with physically consistent bodies, and a table of errors, combinations and of what URDF cannot hold.

theta = A x: many bodies x have the identified parameters.  Those nearest to the robot's guesses, or of the least mass,
are written; drives, cables and offsets get what no body can explain.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from davinci_forces.errors import BadRequest
from davinci_forces.exports.identified import DRIVE, FREE_ROLES, Export, ExportedJoint, ModelTerm, Rendering, terms_of
from davinci_forces.identification.joint_models import Identified, LogModels
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.estimation.conic import LENGTH, complete
from davinci_forces.maths.mechanics.bodies import as_bodies
from davinci_forces.maths.models.coupled import ADDED, CoupledArm
from davinci_forces.maths.models.independent import add
from davinci_forces.maths.models.memory import friction_state
from davinci_forces.maths.models.model import ArmMotion, Model
from davinci_forces.maths.models.terms import coulomb, viscous
from davinci_forces.records import Average, Fit, Motion, by_name
from davinci_forces.robots.models import ARM
from davinci_forces.robots.robot import Kind, Robot
from davinci_forces.robots.urdf import writing

TABLE = "arm.md"
CONSISTENT = "consistent"  # estimator
NEGLIGIBLE_MASS = 1e-8  # [kg] of a link: the solver's error of 0
PREFERENCE = 10.0  # price of efforts of drives, cables and offsets over that of links, which explain what they can
FreeLogs = tuple[list[LogModels], dict[str, list[Array]]]  # of free motion; and the efforts of each joint in them


class IdentifiedArm(NamedTuple):
    """An arm with bodies, and the other numbers of its consistent fit."""

    robot: Robot
    fit: Fit
    model: CoupledArm
    friction: dict[str, tuple[float, float]]  # viscous and Coulomb, by joint
    remainder: dict[ModelTerm, float]  # what URDF cannot hold


def render(export: Export) -> Rendering:
    """Render the URDF and the table beside it.

    Raises BadRequest if the robot has no chain, an effort is a current, or no log moves the joints together.
    """
    robot, currents = export.study.robot, [joint.name for joint in export.joints if joint.joint.effort]
    missing = [f"effort in N m or N: that of {', '.join(currents)} is in A; state torque_constant"] * bool(currents)
    missing += ["the geometry of the robot: state its chain"] * (robot.chain is None)
    if missing:
        raise BadRequest(f"{export.study.name}: a URDF needs {'; and '.join(missing)}; json and c do not")
    arms = [completed_arm(robot, fit) for fit in consistent_fits(export)]
    arm = min(arms, key=lambda arm: (_left_out_error(export, arm), len(arm.fit.theta)))
    consistent = replace(export, joints=tuple(joint._replace(fit=arm.fit, model=arm.model) for joint in export.joints))
    near = "nearest to the robot's guesses" if robot.bodies else "of the least mass"
    free = _free_logs(export, arm.model)
    lost = _lost(export, arm, free)
    lacks = ", ".join(f"{row[0]} {row[1]} {row[-1]}" for row in lost if float(row[-1].split()[0]) >= 1.0)
    beyond = [text for joint in consistent.joints if (text := _beyond_limits(joint))]
    note = [
        f"fit {'.'.join(arm.fit.key)}: of {len(arms)} with possible bodies, its URDF errs least in logs left out",
        f"many bodies have it, as only combinations follow from the logs: these are {near}, "
        "so a single mass or inertia need not be that of the real link",
        *beyond,
        f"warning: a URDF cannot hold {lacks or 'terms with less than 1 %'} of the joint's effort; {TABLE} lists all",
    ]
    urdf = writing.text(arm.robot, consistent.head(arm.fit) + note, arm.friction)
    table = "\n".join([*consistent.head(), *note, *_tables(export, arm, free, lost)]) + "\n"
    return Rendering({"arm.urdf": urdf, TABLE: table}, [*consistent.remarks(), note[0], *beyond, note[-1]])


def _beyond_limits(exported: ExportedJoint) -> str:
    """Warn where the logs go beyond the limits of the robot's description, at which a simulation stops the joint."""
    unit = exported.joint.unit("{position}")
    (low, high), (least, most) = exported.joint.limits.q, exported.validity["position"]
    if low <= least and most <= high:
        return ""
    return (
        f"warning: {exported.name} moved from {least:.4g} to {most:.4g} {unit} in its logs, beyond its limits of "
        f"{low:.4g} to {high:.4g} {unit}, which the URDF keeps; correct the limits in the robot's description"
    )


def consistent_fits(export: Export) -> list[Fit]:
    """The consistent fits of all moving joints as one arm: those in the records, or a new one from the same logs.

    Raises BadRequest if the export lacks a joint, or no identification log holds all joints and moves several of them.
    """
    from davinci_forces.identification.candidates import candidates, reach_of
    from davinci_forces.identification.chosen import select_candidate
    from davinci_forces.stages.model.choose import fits, logs_of, modelled_logs

    study, identified = export.study, export.identified
    moving = {joint.name for joint in study.robot.joints if identified.fits_of(joint.name)}
    if moving != {joint.name for joint in export.joints}:
        raise BadRequest(f"{study.name}: a URDF is of the whole arm; leave --joint out")
    arms = [fit for fit in identified.fits if (fit.group, fit.estimator) == (ARM, CONSISTENT)]
    if recorded := [fit for fit in arms if set(identified.model(fit).efforts) == moving]:
        return recorded
    motions = export.catalogue.select(Motion, role="identification")
    logs = logs_of(motions, export.catalogue.records(Average), study.robot, study.settings.lowpass)
    separate, together = modelled_logs(logs, study.robot)
    reaches = {name: reach_of(joint_logs, name) for name, joint_logs in separate.items()}
    every = candidates(study.robot, separate, together, reaches, len(logs)) if together else []
    shared = [candidate for candidate in every if candidate.parts[0].model.group == ARM]
    selection = select_candidate(shared, len(logs)) if shared else None
    for record in fits(selection.chosen, shared, len(logs), study.robot, True) if selection else ():
        if isinstance(record, Fit) and record.estimator == CONSISTENT:
            return [record]
    raise BadRequest(f"{study.name}: a URDF needs bodies, and no identification log moves the joints together")


def completed_arm(robot: Robot, fit: Fit) -> IdentifiedArm:
    """Complete a consistent fit to bodies, drives and cables."""
    model = Identified(robot, [fit]).model(fit)
    assert isinstance(model, CoupledArm)
    L, base = 10 * len(model.chain.links), len(model.base.columns)
    length = np.array([1.0 if robot.joints[row].kind is Kind.PRISMATIC else LENGTH for row in model.rows])
    price = PREFERENCE / np.r_[length**2, GRAVITY * length, GRAVITY * length]  # of `ADDED`
    guess = robot.bodies.parameters(model.chain.n) if robot.bodies else None
    x = complete(fit.theta, fit.theta_std, model.mechanism, np.r_[price, np.ones(len(fit.theta) - base)], guess)
    inertial = x[:L].reshape(-1, 10)
    inertial = inertial * (inertial[:, :1] > NEGLIGIBLE_MASS)
    drives = [ModelTerm(name, term) for term in DRIVE for name in model.efforts]
    values = dict(zip([*drives, *terms_of(model)[base:]], x[L:].tolist(), strict=True))
    friction = {j: (values.pop(ModelTerm(j, viscous)), values.pop(ModelTerm(j, coulomb))) for j in model.efforts}
    return IdentifiedArm(replace(robot, bodies=as_bodies(inertial)), fit, model, friction, values)


def remaining_effort(about: ModelTerm, value: float, model: CoupledArm, motion: ArmMotion) -> Array:
    """The effort (N,) of one term along a motion of all joints."""
    assert about.term
    joint, effort = model.joints.index(about.joint), np.zeros(len(motion.q))
    z = friction_state(motion, joint, about.term)[0]
    add(about.term, motion.q[:, joint], motion.dq[:, joint], motion.ddq[:, joint], z, effort)
    return value * effort


def _tables(export: Export, arm: IdentifiedArm, free: FreeLogs, lost: Sequence[tuple[str, ...]]) -> Iterator[str]:
    fit = arm.fit
    numbers = zip(fit.parameter, fit.theta.tolist(), fit.theta_std.tolist(), fit.unit, fit.combination, strict=True)
    yield "\n# Identified parameters\n\nOnly these combinations follow from the logs."
    yield "Standard errors are those of the same model without the bounds of a mechanism."
    yield "Axes of a link have z along its joint."
    yield from _table("parameter", "value", "standard error", "unit", "combination")
    yield from (_row(name, f"{value:.6g}", f"{std:.2g}", unit, text) for name, value, std, unit, text in numbers)
    yield "\n# What the URDF does not hold\n\nShare: of the root mean square of the measured effort in free motion."
    yield from _table("joint", "term", "value", "unit", "share")
    yield from (_row(*cells) for cells in lost)
    yield "\n# Error of the models\n\nRoot mean square of measured minus modelled effort over all logs of free motion,"
    yield "with its noise. The report's model error is without that noise, in one log that was not fitted."
    yield from _table("joint", "unit", "effort", "URDF alone", "this fit", "chosen model")
    along, tau = free
    for name, joint, fit, *_ in export.joints:
        hats = (
            [_held(arm, log, name) for log in along],
            *([log.tau_hat(f, name) for log in along] for f in (arm.fit, fit)),
        )
        errors = (_rms(tau[name]), *(_error(tau, name, hat) for hat in hats))
        yield _row(name, joint.unit("{effort}"), *(f"{number:.4g}" for number in errors))


def _lost(export: Export, arm: IdentifiedArm, free: FreeLogs) -> list[tuple[str, ...]]:
    """What URDF cannot hold: joint, term, value, unit and share of the effort over the logs of free motion."""
    rows, (along, tau) = list[tuple[str, ...]](), free
    for about, value in arm.remainder.items():
        assert about.term
        effort = (remaining_effort(about, value, arm.model, log.motion(arm.fit, about.joint)) for log in along)
        name = ADDED[DRIVE.index(about.term)] if about.term in DRIVE else about.term.name
        unit = export.study.robot.joint(about.joint).unit(about.term.unit)
        rows.append(
            (about.joint, name, f"{value:.5g}", unit, f"{round(100 * _rms(effort) / _rms(tau[about.joint]), 2):.2g} %")
        )
    return rows


def _left_out_error(export: Export, arm: IdentifiedArm) -> float:
    """The error of what a URDF holds, over the effort, summed over joints, in logs for validation; else in all logs."""
    along, tau = _free_logs(export, arm.model, ("validation",))
    along, tau = (along, tau) if along else _free_logs(export, arm.model)
    return sum(_error(tau, name, (_held(arm, log, name) for log in along)) / _rms(tau[name]) for name in tau if along)


def _held(arm: IdentifiedArm, log: LogModels, name: str) -> Array:
    """The effort (N,) of a joint by what the URDF holds."""
    motion, lost = log.motion(arm.fit, name), [item for item in arm.remainder.items() if item[0].joint == name]
    return log.tau_hat(arm.fit, name) - sum(remaining_effort(*term, arm.model, motion) for term in lost)


def _free_logs(export: Export, model: Model, roles: Sequence[str] = FREE_ROLES) -> FreeLogs:
    """The logs of free motion that hold all joints of a model, and the efforts of each joint in them."""
    free = [motion for motion in export.catalogue.records(Motion) if motion.role in roles]
    logs = by_name(free, "log").values()
    whole = [log for log in logs if len(log) == len(model.joints) and len({len(motion) for motion in log}) == 1]
    tau = {name: [motion.tau for log in whole for motion in log if motion.joint == name] for name in model.joints}
    return [LogModels(export.identified, log) for log in whole], tau


def _error(tau: Mapping[str, Sequence[Array]], name: str, tau_hat: Iterable[Array]) -> float:
    return _rms(map(np.subtract, tau[name], tau_hat))


def _rms(signals: Iterable[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate([*signals]) ** 2)))


def _table(*titles: str) -> tuple[str, ...]:
    return ("", _row(*titles), "|---" * len(titles) + "|")


def _row(*cells: object) -> str:
    return f"| {' | '.join(map(str, cells))} |"
