"""The arm as URDF with physically consistent bodies, and a table of errors, combinations and of what URDF cannot hold.

theta = A x: many bodies x have the identified parameters.  Those nearest to the robot's guesses, or of the least mass,
are written; drives, cables and offsets get what no body can explain.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from davinci_forces.errors import BadRequest
from davinci_forces.exports.identified import DRIVE, FREE_ROLES, Export, ModelTerm, terms_of
from davinci_forces.identification.joint_models import LogModels
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.estimation.conic import LENGTH, complete
from davinci_forces.maths.mechanics.bodies import PARAMETERS, as_bodies
from davinci_forces.maths.models.coupled import ADDED, LINK_UNITS, CoupledArm
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
NEGLIGIBLE_COEFFICIENT = 1e-9  # of a combination: a rounding error of 0
PREFERENCE = 10.0  # price of efforts of drives, cables and offsets over that of links, which explain what they can


class IdentifiedArm(NamedTuple):
    """An arm with bodies, and the other numbers of its consistent fit."""

    robot: Robot
    fit: Fit
    model: CoupledArm
    inertial: Array  # (L, 10) parameters of the links
    remainder: tuple[tuple[ModelTerm, str, float], ...]  # what URDF cannot hold: term, unit, value

    @property
    def friction(self) -> dict[str, tuple[float, float]]:
        """Viscous and Coulomb friction of each joint."""
        values = {(t.joint, t.term): v for t, v in zip(terms_of(self.model), self.fit.theta.tolist(), strict=True)}
        return {name: (values[name, viscous], values[name, coulomb]) for name in self.model.efforts}


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
        raise BadRequest(f"{export.study.name}: a URDF needs {'; and '.join(missing)}; json does not")
    arm = completed_arm(robot, consistent_fit(export))
    note = [f"bodies and friction: {'.'.join(arm.fit.key)}; {TABLE} says what a URDF does not hold"]
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
    refitted = fits(selection.chosen, shared, len(logs), study.robot, True) if selection else ()
    for record in refitted:
        if isinstance(record, Fit) and record.estimator == CONSISTENT:
            return record
    raise BadRequest(f"{study.name}: a URDF needs bodies, and no identification log moves the joints together")


def completed_arm(robot: Robot, fit: Fit) -> IdentifiedArm:
    """Complete a consistent fit to bodies, drives and cables."""
    from davinci_forces.identification.used import Identified

    model = Identified(robot, [fit]).model(fit)
    assert isinstance(model, CoupledArm)
    L, m = len(model.chain.links), len(model.rows)
    kinds = [robot.joints[row].kind for row in model.rows]
    length = np.array([1.0 if kind is Kind.PRISMATIC else LENGTH for kind in kinds])
    price = PREFERENCE / np.r_[length**2, GRAVITY * length, GRAVITY * length]
    frictions = np.ones(len(model.parameters) - len(model.base.columns))
    guess = robot.bodies.parameters(model.chain.n) if robot.bodies else None
    x = complete(fit.theta, model.mechanism, np.r_[price, frictions], guess)
    inertial = x[: 10 * L].reshape(L, 10)
    inertial = inertial * (inertial[:, :1] > NEGLIGIBLE_MASS)
    drives = [ModelTerm(name, DRIVE[which]) for which in range(len(ADDED)) for name in model.efforts]
    values = [*zip(drives, x[10 * L : 10 * L + 3 * m].tolist(), strict=True)]
    values += [*zip(terms_of(model), fit.theta.tolist(), strict=True)][len(model.base.columns) :]
    remainder = tuple(
        (about, robot.joint(about.joint).unit(about.term.unit), value)
        for about, value in values
        if about.term and about.term not in (viscous, coulomb)
    )
    return IdentifiedArm(replace(robot, bodies=as_bodies(inertial)), fit, model, inertial, remainder)


def remaining_effort(about: ModelTerm, value: float, model: CoupledArm, motion: ArmMotion) -> Array:
    """The effort (N,) of one term along a motion of all joints."""
    assert about.term
    joint, effort = model.joints.index(about.joint), np.zeros(len(motion.q))
    z = friction_state(motion, joint, about.term)[0]
    add(about.term, motion.q[:, joint], motion.dq[:, joint], motion.ddq[:, joint], z, effort)
    return value * effort


def _tables(export: Export, arm: IdentifiedArm) -> Iterator[str]:
    fit, names = arm.fit, [f"{p} of {link}" for link in arm.model.chain.links for p in PARAMETERS]
    K = arm.model.base.combination
    yield "\n# Identified parameters\n\nOnly these combinations follow from the logs."
    yield from _table("parameter", "value", "standard error", "unit", "combination")
    for i, name in enumerate(fit.parameter):
        terms = enumerate(K[i, : len(names)].tolist()) if i < len(K) else ()
        text = " ".join(f"{c:+.4g} {names[k]}" for k, c in terms if abs(c) > NEGLIGIBLE_COEFFICIENT)
        yield from _table(name, f"{fit.theta[i]:.6g}", f"{fit.theta_std[i]:.2g}", fit.unit[i], text, head=False)
    near = "nearest to the robot's guesses" if export.study.robot.bodies else "of the least mass"
    yield f"\n# Bodies\n\nOf all bodies with these parameters, those {near}, about the origins of the links' frames."
    units = (f"{name} [{unit}]" for name, unit in zip(PARAMETERS, LINK_UNITS, strict=True))
    yield from _table("link", *units)
    for link, ten in zip(arm.model.chain.links, arm.inertial, strict=True):
        yield from _table(link, *(f"{value:.5g}" for value in ten), head=False)
    yield from _efforts(export, arm)


def _efforts(export: Export, arm: IdentifiedArm) -> Iterator[str]:
    """What URDF cannot hold, and the error of both models, over the logs of free motion."""
    logs: dict[str, list[Motion]] = {}
    for motion in export.catalogue.records(Motion):
        if motion.role in FREE_ROLES:
            logs.setdefault(motion.log, []).append(motion)
    along = [LogModels(export.identified, log) for log in logs.values() if len(log) == len(arm.model.joints)]
    yield "\n# What the URDF does not hold\n\nShare: of the root mean square of the measured effort in free motion."
    yield from _table("joint", "term", "value", "unit", "share")
    rms = {name: _rms([log.effort(name) for log in along]) for name in arm.model.efforts}
    for about, unit, value in arm.remainder:
        tau = (remaining_effort(about, value, arm.model, log.motion(arm.fit, about.joint)) for log in along)
        term = about.term.name if about.term else ""
        term = ADDED[DRIVE.index(about.term)] if about.term in DRIVE else term
        share = f"{100 * _rms([*tau]) / rms[about.joint]:.2g} %"
        yield from _table(about.joint, term, f"{value:.5g}", unit, share, head=False)
    yield "\n# Error of the models, where fitted and validated, root mean square"
    yield from _table("joint", "unit", "effort", "this fit", "chosen model")
    for joint in export.joints:
        errors = [
            _rms([log.effort(joint.name) - log.tau_hat(fit, joint.name) for log in along])
            for fit in (arm.fit, joint.fit)
        ]
        numbers = (f"{number:.4g}" for number in (rms[joint.name], *errors))
        yield from _table(joint.name, joint.joint.unit("{effort}"), *numbers, head=False)


def _rms(signals: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(signals) ** 2)))


def _table(*cells: object, head: bool = True) -> Iterator[str]:
    if head:
        yield ""
    yield f"| {' | '.join(map(str, cells))} |"
    if head:
        yield "|---" * len(cells) + "|"
