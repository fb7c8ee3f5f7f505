"""What is exported of a study: the model of each joint with errors, noise and validity, and the head of each file."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from davinci_forces.errors import BadRequest
from davinci_forces.files import json_number, visible
from davinci_forces.filters import DEFAULT
from davinci_forces.filters.error_bands import free_errors, joint_alarm_level
from davinci_forces.filters.response import noise_model, ramp_lag
from davinci_forces.filters.stepping import covariances
from davinci_forces.identification.joint_models import Identified
from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.mechanics.bodies import PARAMETERS
from davinci_forces.maths.mechanics.chain import FIXED, Chain
from davinci_forces.maths.models.coupled import CoupledArm
from davinci_forces.maths.models.independent import IndependentJoint
from davinci_forces.maths.models.model import Model
from davinci_forces.maths.models.terms import Term, inertia, offset, stiffness
from davinci_forces.maths.signals.smoothing import NORMAL_MAD, share_passed
from davinci_forces.maths.uncertainty.error_band import NORMAL_95, calibrate
from davinci_forces.records import Choice, ErrorBand, FilterNoise, Fit, FreeSpace, Motion, StreamLevel
from davinci_forces.records.catalogue import Catalogue
from davinci_forces.records.forces import MIN_COVERAGE
from davinci_forces.records.prediction import CHOSEN
from davinci_forces.robots.robot import Joint
from davinci_forces.study import Study

SAFETY = "research use, not a medical device; try at reduced effort with the stop in hand"
SOLVER_ZERO = 1e-9  # largest size of a parameter that a solver means as 0
FREE_ROLES = ("identification", "validation")  # of logs without contact, whose motion bounds the validity
VALID = "valid in the range of position and velocity of free motion (contact adds to its effort):"
DRIVE = (inertia, stiffness, offset)  # terms of a coupled joint's drive and cables, in the order of `coupled.ADDED`
STATIC = {"1", "sin q", "cos q", "q", "q^2", "q^3", "sin 2q", "cos 2q", "sin 3q", "cos 3q"}  # hold a resting arm
UNITS = {"position": "{position}", "velocity": "{position}/s", "effort": "{effort}"}


class ExportOrigin(NamedTuple):
    """The report that an export belongs to, and why it is exported despite a verdict."""

    version: str
    report_id: str
    verdicts: Mapping[str, str]  # of page one, by joint: good, warn or bad
    despite: tuple[str, ...] = ()


class ModelTerm(NamedTuple):
    """What a parameter multiplies: an inertial parameter of a link, or a term in the effort of one joint."""

    joint: str
    term: Term | None
    link: str = ""
    inertial: str = ""


class ExportedJoint(NamedTuple):
    """A joint with the fit of its effort, the ranges of its free motion, and its filter as JSON values."""

    name: str
    joint: Joint
    fit: Fit
    model: Model
    validity: dict[str, list[float]]
    filter: dict[str, Any] | None


@dataclass(frozen=True)
class Export:
    """A study's model of some joints, with its origin."""

    study: Study
    catalogue: Catalogue
    identified: Identified
    joints: tuple[ExportedJoint, ...]
    origin: ExportOrigin

    @property
    def fits(self) -> dict[str, tuple[Fit, Model]]:
        """The fits of the joints with their models, each once, by key."""
        return {".".join(joint.fit.key): (joint.fit, joint.model) for joint in self.joints}

    def head(self, *fits: Fit) -> list[str]:
        """The lines at the head of every file: origin, safety, ranges, and the parameters of fits with their errors."""
        origin, study = self.origin, self.study
        lines = [f"davinci-forces {origin.version}, report ID {origin.report_id}", f"study {study.name}: {study.title}"]
        lines += ["SIMULATED: the logs of this study are simulated"] * study.simulated
        lines += [SAFETY, *(f"exported despite: {reason}" for reason in origin.despite)]
        lines += ["SI units: rad, m, s, kg, N m, N; A where the effort is a motor current", VALID]
        for joint in self.joints:
            units = (joint.joint.unit(unit) for unit in UNITS.values())
            ranges = zip(UNITS, joint.validity.values(), units, strict=True)
            text = ", ".join(f"{name} {low:.5g} to {high:.5g} {unit}" for name, (low, high), unit in ranges)
            lines.append(f"  {joint.name}: {text}")
        exported = {joint.name for joint in self.joints}
        for motor in (joint for joint in study.joints_by_current if joint.name in exported):
            counts = f"{motor.effort_per_ampere:.6g} {motor.unit('{effort}')}"
            lines.append(f"  {motor.name}: 1 A of its motor counts as {counts}")
        lines += self.remarks()
        for fit in fits:
            lines.append(f"parameters of {'.'.join(fit.key)}, with standard errors:")
            rows = parameters_of(fit)
            lines += [f"  {name}: {value:.6g} +- {std:.2g} {unit}".rstrip() for name, value, std, unit in rows]
        return [visible(line) for line in lines]

    def narrow_bands(self) -> Iterator[str]:
        """Name the joints whose 95 % band is too narrow in free motion, of logs that no fit used if there are any."""
        for joint in self.joints:
            spaces = self.catalogue.select(FreeSpace, joint=joint.name, filter=DEFAULT)
            unfitted = [space for space in spaces if space.role != "identification"] or spaces
            narrowest = min(unfitted, key=lambda space: space.coverage, default=None)
            if narrowest is not None and narrowest.coverage < MIN_COVERAGE:
                covers = f"+-1.96 std covers {100 * narrowest.coverage:.0f} % of its free motion in {narrowest.log}"
                text = f"{joint.name}: as samples arrive, {covers}, not 95 %"
                yield f"warning: {text}; judge its external effort by the alarm level"

    def negative_parameters(self) -> Iterator[str]:
        """Name springs negative beyond their error, and what physics has positive, with a `fit` that settings take."""
        advice = "in a simulation or a compensation it can drive the joint; parameters that a mechanism can have"
        by_group = {f.group: f.model for f in self.identified.fits if f.estimator == "consistent" and f.model != CHOSEN}
        for key, (fit, model) in self.fits.items():
            remedy = f"{advice}: fit = '{by_group.get(fit.group, 'independent')}.consistent' in [settings]"
            for about, (name, value, std, unit) in zip(terms_of(model), parameters_of(fit), strict=True):
                is_spring = about.term == stiffness
                is_positive = is_spring or (about.term is not None and about.term.positive)
                if is_positive and value < (-NORMAL_95 * std if is_spring else -SOLVER_ZERO):
                    yield f"warning: {key}: {name} is negative, {value:.3g} +- {std:.2g} {unit}; {remedy}"

    def remarks(self) -> list[str]:
        """Name what the user has to know of bands and parameters."""
        return [*self.narrow_bands(), *self.negative_parameters()]

    def document(self) -> dict[str, Any]:
        """The model as JSON values."""
        robot, origin = self.study.robot, self.origin
        return {
            "head": self.head(), "report_id": origin.report_id, "version": origin.version, "robot": robot.name,
            "simulated": self.study.simulated, "despite_verdict": list(origin.despite),
            "coordinates": [joint.name for joint in robot.joints], "gravity": GRAVITY,
            "chain": _chain(robot.chain.with_coordinates(len(robot.joints))) if robot.chain else None,
            "models": {name: _model(*fit) for name, fit in self.fits.items()},
            "joints": [_joint(joint, origin.verdicts.get(joint.name)) for joint in self.joints],
        }  # fmt: skip


class Rendering(NamedTuple):
    """An export as the text of each file, by its name, and the remarks for the user."""

    files: dict[str, str]
    remarks: list[str]


def terms_of(model: Model) -> list[ModelTerm]:
    """What each parameter of a model multiplies, in the order of theta."""
    if isinstance(model, IndependentJoint):
        return [ModelTerm(model.group, term) for term in model.terms]
    assert isinstance(model, CoupledArm)
    names = [ModelTerm("", None, link, which) for link in model.chain.links for which in PARAMETERS]
    names += [ModelTerm(joint, term) for term in DRIVE for joint in model.efforts]
    pairs = zip(model.efforts, model.friction, strict=True)
    frictions = (ModelTerm(joint, term) for joint, terms in pairs for term in terms)
    return [*(names[column] for column in model.base.columns.tolist()), *frictions]


def parameters_of(fit: Fit) -> list[tuple[str, float, float, str]]:
    """Name, value, standard error and unit of each parameter."""
    names, units = map(str, fit.parameter), map(str, fit.unit)
    return list(zip(names, fit.theta.tolist(), fit.theta_std.tolist(), units, strict=True))


def _chain(chain: Chain) -> dict[str, Any]:
    columns = (chain.links, chain.parent.tolist(), chain.coordinate.tolist(), chain.slides.tolist())
    rows = zip(*columns, chain.placement.tolist(), strict=True)
    names = ("name", "parent", "coordinate", "prismatic", "placement")
    links = [(name, i - 1 if i else None, None if k == FIXED else k, *more) for name, i, k, *more in rows]
    at = chain.names.index(chain.tip)
    link = int(chain.body[at]) - 1
    tip = {"link": link if link >= 0 else None, "position": chain.offset[at, :3, 3].tolist()}
    return {"up": list(chain.up), "tip": tip, "links": [dict(zip(names, link, strict=True)) for link in links]}


def _model(fit: Fit, model: Model) -> dict[str, Any]:
    parameters = [
        {"name": name, "joint": about.joint or None, "value": value, "std": json_number(std), "unit": unit}
        | (_term(about.term) if about.term else {"role": "link", "link": about.link, "inertial": about.inertial})
        for about, (name, value, std, unit) in zip(terms_of(model), parameters_of(fit), strict=True)
    ]
    about = {"structure": fit.structure, "efforts": list(model.efforts), "logs": list(fit.logs), "mse": fit.mse}
    return {**about, "parameters": parameters}


def _term(term: Term) -> dict[str, Any]:
    kinds = {"deflection": "displacement", "smooth sign": "width", "Stribeck": "decay_velocity"}
    states = [{"kind": kind, name: getattr(term, name)} for kind, name in kinds.items() if getattr(term, name)]
    states += [{"kind": "function", "function": term.of_motion}] * bool(term.of_motion)
    functions = {term.of_motion} if term.of_motion else set(term.b)
    role = "inertia" if term.a else "gravity" if functions <= STATIC else "friction"
    return {"role": role, "acceleration": term.a, "functions": dict(term.b), "state": next(iter(states), None)}


def _joint(joint: ExportedJoint, verdict: str | None) -> dict[str, Any]:
    i, units = joint.model.efforts.index(joint.name), {name: joint.joint.unit(unit) for name, unit in UNITS.items()}
    motion = {"cutoff": joint.fit.cutoff[i], "effort_lag": joint.fit.effort_lag[i]}
    bounds = joint.joint.limits
    ends = {"position": bounds.q, "velocity": bounds.dq, "effort": (-bounds.effort, bounds.effort)}
    limits = {name: [*map(json_number, pair)] for name, pair in ends.items()}
    return {
        "name": joint.name, "kind": joint.joint.kind.value, "verdict": verdict, "model": ".".join(joint.fit.key),
        "units": units, "motion": motion, "limits": limits, "validity": joint.validity, "filter": joint.filter,
    }  # fmt: skip


def export_of(study: Study, catalogue: Catalogue, origin: ExportOrigin, names: Sequence[str] = ()) -> Export:
    """Collect the models of these joints of a study; without names, of every joint with a model.

    Raises BadRequest if no model was chosen, or a joint has none; BadRobot if there is no such joint.
    """
    identified = Identified(study.robot, [*catalogue.records(Fit), *catalogue.records(Choice)])
    if study.settings.fit == CHOSEN and not catalogue.records(Choice):
        raise BadRequest(f"{study.name}: no model was chosen, so there is nothing to export; the report says why")
    joints = []
    for joint in [study.robot.joint(name) for name in names] or study.robot.joints:
        if fit := identified.fit_of(joint.name, study.settings.fit):
            free = [m for m in catalogue.select(Motion, joint=joint.name) if m.role in FREE_ROLES]
            columns = (np.concatenate([getattr(m, name) for m in free]) for name in ("q_measured", "dq", "tau"))
            ranges = ([float(x.min()), float(x.max())] for x in columns)
            validity, online = dict(zip(UNITS, ranges, strict=True)), _filter(study, catalogue, joint, free)
            if online:
                online["static_friction"] = identified.static_friction(fit, joint.name)
            joints.append(ExportedJoint(joint.name, joint, fit, identified.model(fit), validity, online))
        elif names:
            raise BadRequest(f"{study.name}: joint {joint.name} has no model, since no identification log moves it")
    return Export(study, catalogue, identified, tuple(joints), origin)


def least_velocity(m: Motion) -> float:
    """The low-passed velocity of a log, below which its sign is not known; see `standstill.without_doubtful_signs`."""
    return NORMAL_MAD * m.sigma_dq * (share_passed(m.rate, m.cutoff) ** 0.5 if m.velocity == "logged" else 1.0)


def _filter(study: Study, catalogue: Catalogue, joint: Joint, free: Sequence[Motion]) -> dict[str, Any] | None:
    """The default filter of a joint with its band and its alarm level, as far as free motion gives them.

    A controller samples all joints at one rate: the filters run at the lowest rate of the joints' identification logs.
    """
    for tuned in catalogue.select(FilterNoise, joint=joint.name):
        rate = min(noise.rate for noise in catalogue.records(FilterNoise))
        noise = noise_model(tuned, joint, 1.0 / rate, study.settings.q_tau)
        R_q, R_dq, Q_qq, Q_qd, Q_dd, Q_tau = covariances(noise, 1.0 / rate)
        bands = [calibrate(free_errors(band, False)) for band in catalogue.select(ErrorBand, joint=joint.name)]
        spaces = catalogue.select(FreeSpace, joint=joint.name, filter=DEFAULT)
        levels = [joint_alarm_level(spaces)[0]] if spaces else []
        levels += [stream.alarm_level for stream in catalogue.select(StreamLevel, joint=joint.name)]
        return {
            "rate": rate, "R": [R_q, R_dq], "Q": [[Q_qq, Q_qd, 0.0], [Q_qd, Q_dd, 0.0], [0.0, 0.0, Q_tau]],
            "least_velocity": float(np.median([least_velocity(m) for m in free if not m.at_rest])),
            "initial_std": float(np.mean([np.std(motion.tau) for motion in free if not motion.at_rest])),
            "band": next(({"edges": b.edges.tolist(), "factor": b.factor.tolist(), "model_variance": b.model_variance}
                          for b in bands), None),
            "alarm_level": max(levels, default=None), "lag": ramp_lag(tuned.inertia, tuned.viscous, 1.0 / rate, noise),
        }  # fmt: skip
    return None
