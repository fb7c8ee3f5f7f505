"""What is exported of a study: the model of each joint with its errors, noise and validity, and the head of a file."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from davinci_forces.errors import BadRequest
from davinci_forces.files import visible
from davinci_forces.filters import DEFAULT
from davinci_forces.filters.error_bands import free_errors
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.filters.response import noise_model
from davinci_forces.identification.used import Identified
from davinci_forces.maths.contact.detection import FreeMotionStatistics, alarm_level
from davinci_forces.maths.mechanics.bodies import PARAMETERS
from davinci_forces.maths.models.coupled import CoupledArm
from davinci_forces.maths.models.independent import IndependentJoint
from davinci_forces.maths.models.model import Model
from davinci_forces.maths.models.terms import Term, inertia, offset, stiffness
from davinci_forces.maths.uncertainty.error_band import Calibration, calibrate
from davinci_forces.records import Choice, ErrorBand, FilterNoise, Fit, FreeSpace, Motion
from davinci_forces.records.catalogue import Catalogue
from davinci_forces.records.prediction import CHOSEN
from davinci_forces.robots.robot import Joint
from davinci_forces.study import Study

SAFETY = "research use, not a medical device; try at reduced effort with the stop in hand"
FREE_ROLES = ("identification", "validation")  # of logs without contact, whose motion and effort bound the validity
DRIVE = (inertia, stiffness, offset)  # terms of a coupled joint's drive and cables, in the order of `coupled.ADDED`
STATIC_FUNCTIONS = ("1", "sin q", "cos q", "q")
STATIC_STATES = ("q^2", "q^3", "sin 2q", "cos 2q", "sin 3q", "cos 3q")  # functions of z that hold a resting arm


class ExportOrigin(NamedTuple):
    """The report that an export belongs to, and why it is exported despite a verdict."""

    version: str
    report_id: str
    verdicts: Mapping[str, str]  # of page one, by joint: good, warn or bad
    despite: tuple[str, ...] = ()


class Validity(NamedTuple):
    """Ranges of position, velocity and effort in the logs of free motion, in the joint's units."""

    q: tuple[float, float]
    dq: tuple[float, float]
    tau: tuple[float, float]

    @property
    def largest_effort(self) -> float:
        """The largest effort recorded, in either direction."""
        return max(map(abs, self.tau))


class OnlineFilter(NamedTuple):
    """The default filter of a joint, its error band and its alarm level; None where free motion does not give them."""

    rate: float  # [Hz]
    noise: NoiseModel
    initial_std: float
    band: Calibration | None
    alarm: float | None


class ModelTerm(NamedTuple):
    """What a parameter multiplies: an inertial parameter of a link, or a term in the effort of one joint."""

    joint: str
    term: Term | None
    link: str = ""
    inertial: str = ""

    @property
    def role(self) -> str:
        """The kind of effort: link, inertia, gravity (all that holds a resting arm) or friction."""
        if self.term is None:
            return "link"
        if self.term.a:
            return "inertia"
        static = set(self.term.b) <= set(STATIC_FUNCTIONS) or self.term.of_motion in STATIC_STATES
        return "gravity" if static else "friction"


@dataclass(frozen=True)
class ExportedJoint:
    """A joint with the fit that describes its effort."""

    joint: Joint
    fit: Fit
    model: Model
    cutoff: float  # [Hz] of the low-pass of the motion
    effort_lag: float  # [s]
    validity: Validity
    filter: OnlineFilter | None

    @property
    def name(self) -> str:
        """The joint's name."""
        return self.joint.name

    @property
    def fit_name(self) -> str:
        """The key of its fit."""
        return ".".join(self.fit.key)


@dataclass(frozen=True)
class Export:
    """A study's model of some joints, with its origin."""

    study: Study
    catalogue: Catalogue
    identified: Identified
    joints: tuple[ExportedJoint, ...]
    origin: ExportOrigin

    @property
    def fits(self) -> dict[str, Fit]:
        """The fits of the joints, each once, by key."""
        return {joint.fit_name: joint.fit for joint in self.joints}

    def head(self) -> list[str]:
        """The lines at the head of every file: origin, safety, ranges of validity, parameters with standard errors."""
        origin, study = self.origin, self.study
        lines = [f"davinci-forces {origin.version}, report ID {origin.report_id}", f"study {study.name}: {study.title}"]
        lines += ["SIMULATED: the logs of this study are simulated"] * study.simulated
        lines += [SAFETY, *(f"exported despite: {reason}" for reason in origin.despite)]
        lines += ["SI units: rad, m, s, kg, N m, N; A where the effort is a motor current", "valid in the range of:"]
        return [visible(line) for line in (*lines, *(f"  {_range(joint)}" for joint in self.joints))]


def parameter_lines(fit: Fit) -> list[str]:
    """The parameters of a fit with their standard errors, a line each."""
    rows = zip(fit.parameter, fit.theta.tolist(), fit.theta_std.tolist(), fit.unit, strict=True)
    return [
        "parameters and standard errors:",
        *(f"  {p}: {x:.6g} +- {std:.2g} {unit}".rstrip() for p, x, std, unit in rows),
    ]


Renderer = Callable[[Export], dict[str, str]]  # the text of each file, by its name


def _range(joint: ExportedJoint) -> str:
    columns = zip(joint.validity, ("{position}", "{position}/s", "{effort}"), ("q", "dq", "tau"), strict=True)
    ranges = (f"{name} {low:.5g} to {high:.5g} {joint.joint.unit(unit)}" for (low, high), unit, name in columns)
    return f"{joint.name}: {', '.join(ranges)}"


def terms_of(model: Model) -> list[ModelTerm]:
    """What each parameter of a model multiplies, in the order of theta."""
    if isinstance(model, IndependentJoint):
        return [ModelTerm(model.group, term) for term in model.terms]
    assert isinstance(model, CoupledArm)
    links, terms = model.chain.links, []
    for column in model.base.columns.tolist():
        if column < 10 * len(links):
            terms.append(ModelTerm("", None, links[column // 10], PARAMETERS[column % 10]))
        else:
            which, row = divmod(column - 10 * len(links), len(model.rows))
            terms.append(ModelTerm(model.efforts[row], DRIVE[which]))
    pairs = zip(model.efforts, model.friction, strict=True)
    return [*terms, *(ModelTerm(joint, term) for joint, friction in pairs for term in friction)]


def export_of(study: Study, catalogue: Catalogue, origin: ExportOrigin, names: Sequence[str] = ()) -> Export:
    """Collect the models of these joints of a study; without names, of every joint with a model.

    Raises
    ------
    BadRequest
        If no model was chosen, or a joint has none.
    BadRobot
        If there is no such joint.
    """
    identified = Identified(study.robot, [*catalogue.records(Fit), *catalogue.records(Choice)])
    if study.settings.fit == CHOSEN and not catalogue.records(Choice):
        raise BadRequest(f"{study.name}: no model was chosen, so there is nothing to export; the report says why")
    joints = [study.robot.joint(name) for name in names] or study.robot.joints
    fits = {joint.name: identified.fit_of(joint.name, study.settings.fit) for joint in joints}
    if missing := [name for name, fit in fits.items() if fit is None and (names or not any(fits.values()))]:
        raise BadRequest(f"{study.name}: joint {missing[0]} has no model, since no identification log moves it")
    models = (_joint(study, catalogue, identified, joint, fit) for joint in joints if (fit := fits[joint.name]))
    return Export(study, catalogue, identified, tuple(models), origin)


def _joint(study: Study, catalogue: Catalogue, identified: Identified, joint: Joint, fit: Fit) -> ExportedJoint:
    free = [motion for motion in catalogue.select(Motion, joint=joint.name) if motion.role in FREE_ROLES]
    columns = ([getattr(motion, name) for motion in free] for name in ("q_measured", "dq", "tau"))
    ranges = ((min(float(x.min()) for x in xs), max(float(x.max()) for x in xs)) for xs in columns)
    tau_std = float(np.mean([np.std(motion.tau) for motion in free if not motion.at_rest]))
    processing = identified.cutoff_and_lag(fit, joint.name)
    online = _filter(study, catalogue, joint, tau_std)
    return ExportedJoint(joint, fit, identified.model(fit), *processing, Validity(*ranges), online)


def _filter(study: Study, catalogue: Catalogue, joint: Joint, initial_std: float) -> OnlineFilter | None:
    for tuned in catalogue.select(FilterNoise, joint=joint.name):
        noise = noise_model(tuned, joint, 1.0 / tuned.rate, study.settings.q_tau)
        bands = [calibrate(free_errors(band, False)) for band in catalogue.select(ErrorBand, joint=joint.name)]
        spaces = catalogue.select(FreeSpace, joint=joint.name, filter=DEFAULT)
        unfitted = [space for space in spaces if space.role != "identification"] or spaces
        levels = [alarm_level([FreeMotionStatistics(s.free_rms, s.free_max, s.crossings)]) for s in unfitted]
        return OnlineFilter(tuned.rate, noise, initial_std, next(iter(bands), None), max(levels, default=None))
    return None
