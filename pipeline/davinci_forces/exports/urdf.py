"""The arm as URDF with physically consistent bodies, and a table of errors, combinations and of what URDF cannot hold.

theta = A x: many bodies x have the identified parameters.  Those nearest to the robot's guesses, or of the least mass,
are written; drives, cables and offsets get what no body can explain.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from davinci_forces.errors import BadRequest
from davinci_forces.exports.identified import DRIVE, FREE_ROLES, Export, ModelTerm, terms_of
from davinci_forces.identification.joint_models import LogModels
from davinci_forces.identification.used import Identified
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.estimation.conic import LENGTH, complete
from davinci_forces.maths.mechanics.bodies import PARAMETERS, as_bodies
from davinci_forces.maths.models.coupled import ADDED, CoupledArm
from davinci_forces.maths.models.independent import add
from davinci_forces.maths.models.memory import friction_state
from davinci_forces.maths.models.model import ArmMotion
from davinci_forces.maths.models.terms import coulomb, viscous
from davinci_forces.records import Average, Fit, Motion
from davinci_forces.robots.models import ARM
from davinci_forces.robots.robot import Kind, Robot
from davinci_forces.robots.urdf import writing

TABLE = "arm.md"
CONSISTENT = "consistent"  # estimator
NEGLIGIBLE_MASS = 1e-8  # [kg] of a link: the solver's error of 0
ROUNDING = 1e-9  # of a coefficient that is 0
PREFERENCE = 10.0  # price of efforts of drives, cables and offsets over that of links, which explain what they can


class IdentifiedArm(NamedTuple):
    """An arm with bodies, and the other numbers of its consistent fit."""

    robot: Robot
    fit: Fit
    model: CoupledArm
    inertial: Array  # (L, 10) parameters of the links
    friction: dict[str, tuple[float, float]]  # viscous and Coulomb, by joint
    remainder: dict[ModelTerm, float]  # what URDF cannot hold


def render(export: Export) -> dict[str, str]:
    """Render the URDF and the table beside it.

    Raises
    ------
    BadRequest
        If the robot has no chain, an effort is a current, or no log moves the joints together.
    """
    robot, currents = export.study.robot, [joint.name for joint in export.joints if joint.joint.effort]
    missing = [f"effort in N m or N: that of {', '.join(currents)} is in A; state torque_constant"] * bool(currents)
    missing += ["the geometry of the robot: state its chain"] * (robot.chain is None)
    if missing:
        raise BadRequest(f"{export.study.name}: a URDF needs {'; and '.join(missing)}; json and c do not")
    arm = completed_arm(robot, consistent_fit(export))
    near = "nearest to the robot's guesses" if robot.bodies else "of the least mass"
    fit = ".".join(arm.fit.key)
    note = [f"fit {fit}; of all bodies that have it, those {near}; {TABLE}: what a URDF does not hold"]
    urdf = writing.text(arm.robot, export.head(arm.fit) + note, arm.friction)
    return {"arm.urdf": urdf, TABLE: "\n".join([*export.head(), *note, *_tables(export, arm)]) + "\n"}


def consistent_fit(export: Export) -> Fit:
    """The consistent fit of all moving joints as one arm: the one in the records, or a new one from the same logs.

    Raises
    ------
    BadRequest
        If the export lacks a joint, or no identification log holds all joints and moves several of them.
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
        return min(recorded, key=lambda fit: len(fit.theta))
    motions = export.catalogue.select(Motion, role="identification")
    logs = logs_of(motions, export.catalogue.records(Average), study.robot, study.settings.lowpass)
    separate, together = modelled_logs(logs, study.robot)
    reaches = {name: reach_of(joint_logs, name) for name, joint_logs in separate.items()}
    every = candidates(study.robot, separate, together, reaches, len(logs)) if together else []
    shared = [candidate for candidate in every if candidate.parts[0].model.group == ARM]
    selection = select_candidate(shared, len(logs)) if shared else None
    for record in fits(selection.chosen, shared, len(logs), study.robot, True) if selection else ():
        if isinstance(record, Fit) and record.estimator == CONSISTENT:
            return record
    raise BadRequest(f"{study.name}: a URDF needs bodies, and no identification log moves the joints together")


def completed_arm(robot: Robot, fit: Fit) -> IdentifiedArm:
    """Complete a consistent fit to bodies, drives and cables."""
    model = Identified(robot, [fit]).model(fit)
    assert isinstance(model, CoupledArm)
    L, base = 10 * len(model.chain.links), len(model.base.columns)
    length = np.array([1.0 if robot.joints[row].kind is Kind.PRISMATIC else LENGTH for row in model.rows])
    price = PREFERENCE / np.r_[length**2, GRAVITY * length, GRAVITY * length]  # of `ADDED`
    guess = robot.bodies.parameters(model.chain.n) if robot.bodies else None
    x = complete(fit.theta, model.mechanism, np.r_[price, np.ones(len(fit.theta) - base)], guess)
    inertial = x[:L].reshape(-1, 10)
    inertial = inertial * (inertial[:, :1] > NEGLIGIBLE_MASS)
    drives = [ModelTerm(name, term) for term in DRIVE for name in model.efforts]
    values = dict(zip([*drives, *terms_of(model)[base:]], x[L:].tolist(), strict=True))
    friction = {j: (values.pop(ModelTerm(j, viscous)), values.pop(ModelTerm(j, coulomb))) for j in model.efforts}
    return IdentifiedArm(replace(robot, bodies=as_bodies(inertial)), fit, model, inertial, friction, values)


def remaining_effort(about: ModelTerm, value: float, model: CoupledArm, motion: ArmMotion) -> Array:
    """The effort (N,) of one term along a motion of all joints."""
    assert about.term
    joint, effort = model.joints.index(about.joint), np.zeros(len(motion.q))
    z = friction_state(motion, joint, about.term)[0]
    add(about.term, motion.q[:, joint], motion.dq[:, joint], motion.ddq[:, joint], z, effort)
    return value * effort


def _tables(export: Export, arm: IdentifiedArm) -> Iterator[str]:
    fit, names = arm.fit, [f"{which} of {link}" for link in arm.model.chain.links for which in PARAMETERS]
    rows = arm.model.mechanism.matrix[: len(arm.model.base.columns), : len(names)]
    sums = [
        " ".join(f"{c:+.4g} {name}" for c, name in zip(row, names, strict=True) if abs(c) > ROUNDING) for row in rows
    ]
    sums += [""] * (len(fit.theta) - len(sums))
    numbers = zip(fit.parameter, fit.theta.tolist(), fit.theta_std.tolist(), fit.unit, sums, strict=True)
    yield "\n# Identified parameters\n\nOnly these combinations follow from the logs."
    yield from _table("parameter", "value", "standard error", "unit", "combination")
    yield from (_row(name, f"{value:.6g}", f"{std:.2g}", unit, text) for name, value, std, unit, text in numbers)
    yield from _efforts(export, arm)


def _efforts(export: Export, arm: IdentifiedArm) -> Iterator[str]:
    """What URDF cannot hold, and the error of both models, over the logs of free motion."""
    free = [motion for motion in export.catalogue.records(Motion) if motion.role in FREE_ROLES]
    logs = [[motion for motion in free if motion.log == log] for log in dict.fromkeys(motion.log for motion in free)]
    whole = [log for log in logs if len(log) == len(arm.model.joints) and len({len(motion) for motion in log}) == 1]
    along = [LogModels(export.identified, log) for log in whole]
    tau = {name: [motion.tau for log in whole for motion in log if motion.joint == name] for name in arm.model.joints}
    yield "\n# What the URDF does not hold\n\nShare: of the root mean square of the measured effort in free motion."
    yield from _table("joint", "term", "value", "unit", "share")
    for about, value in arm.remainder.items():
        assert about.term
        effort = (remaining_effort(about, value, arm.model, log.motion(arm.fit, about.joint)) for log in along)
        name = ADDED[DRIVE.index(about.term)] if about.term in DRIVE else about.term.name
        unit = export.study.robot.joint(about.joint).unit(about.term.unit)
        yield _row(about.joint, name, f"{value:.5g}", unit, f"{100 * _rms(effort) / _rms(tau[about.joint]):.2g} %")
    yield "\n# Error of the models, where fitted and validated, root mean square"
    yield from _table("joint", "unit", "effort", "this fit", "chosen model")
    for name, joint, fit, *_ in export.joints:
        hats = ([log.tau_hat(f, name) for log in along] for f in (arm.fit, fit))
        errors = (_rms(map(np.subtract, tau[name], hat)) for hat in hats)
        yield _row(name, joint.unit("{effort}"), *(f"{number:.4g}" for number in (_rms(tau[name]), *errors)))


def _rms(signals: Iterable[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate([*signals]) ** 2)))


def _table(*titles: str) -> tuple[str, ...]:
    return ("", _row(*titles), "|---" * len(titles) + "|")


def _row(*cells: object) -> str:
    return f"| {' | '.join(map(str, cells))} |"
