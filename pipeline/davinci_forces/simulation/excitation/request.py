"""Requests for excitation trajectories, from the options of a command, and the answers."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from davinci_forces import robots
from davinci_forces.errors import BadRequest
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.excitation import arm
from davinci_forces.maths.excitation.arm import ArmExcitationProblem
from davinci_forces.maths.excitation.fourier import CRITERIA, Fourier, Range, condition, expected_std
from davinci_forces.maths.excitation.joint import ExcitationProblem, design
from davinci_forces.maths.excitation.limits import ArmLimits, Box, Obstacles
from davinci_forces.maths.excitation.search import ReportStart
from davinci_forces.maths.models.coupled import LINK_UNITS
from davinci_forces.maths.models.terms import TERMS
from davinci_forces.robots.robot import Joint, Kind, Robot
from davinci_forces.simulation.excitation.trajectory import PERIODS, ExcitationTrajectory, ExpectedParameter
from davinci_forces.toml import numbers_of_option, unlikely

STARTS, STARTS_OF_ARM = 24, 2  # an arm's starts take longer, and agree better
WHOLE_TURN = (-math.pi, math.pi)  # [rad] positions of a revolute joint without limits


@dataclass(frozen=True)
class Request:
    """The options of a request; None selects the value of the joint."""

    robot: str
    joint: str  # or "all"
    evaluate: str | None
    period: float | None  # [s]
    harmonics: int | None
    criterion: str
    limits: tuple[str | None, str | None, str | None]  # of position, velocity and acceleration: "lower,upper"
    starts: int | None
    seed: int
    samples: int  # K, samples of a period in the criterion
    noise: str | None = None  # standard deviation of the effort's noise: of every joint, or one for each
    around: tuple[float | None, tuple[str, ...]] = (None, ())  # z of a floor [m], and boxes: "x,y,z,x,y,z"


class ArmExcitation(NamedTuple):
    """The excitation of the arm by all joints together, and the criterion that each start of the search reached."""

    objective: float
    condition: float
    base_parameters: int
    optima: tuple[float, ...]
    limits: ArmLimits
    standard_errors: tuple[ExpectedParameter, ...]  # standard errors of the base parameters, if noise is stated


class Answer(NamedTuple):
    """A trajectory for each requested joint; the excitation of the arm if its links are known, or the joints held."""

    trajectories: list[ExcitationTrajectory]
    arm: ArmExcitation | None = None
    held: tuple[str, ...] = ()


def answer(request: Request, report_start: ReportStart | None = None) -> Answer:
    """Design or evaluate a trajectory for each requested joint; `report_start` reports each start.

    Joints that move together share a period.  Where the arm's links are known, the trajectories are optimal for the
    whole arm.  Otherwise the joints' models are independent, and each trajectory is optimal for its own joint.
    Raises BadRequest or BadRobot if the request is invalid or cannot be met.
    """
    file = Path(request.robot)  # a listed robot, or a .toml file
    robot = robots.load(file.name, file.parent) if file.suffix == ".toml" else robots.load(request.robot, Path())
    all_joints = request.joint == "all"
    joints = robot.joints if all_joints else (robot.joint(request.joint),)
    if request.criterion not in CRITERIA:
        raise BadRequest(f"--criterion is one of {', '.join(CRITERIA)}, not {request.criterion!r}")
    if request.period is not None and not (math.isfinite(request.period) and request.period > 0):
        raise BadRequest(f"--period must be positive, not {request.period:g}")
    if unusual := unlikely("--period", request.period or 0.0, "period"):
        raise BadRequest(f"{unusual}, not {request.period:g}")
    if all_joints and request.evaluate:
        raise BadRequest("--evaluate takes one joint; name it instead of `all`")
    if _obstacles(request).present and (not all_joints or robot.chain is None):
        raise BadRequest("--floor and --box take `all` joints of a robot whose links are known")
    period = request.period or max(PERIODS[joint.kind] for joint in joints)
    problems = [_problem(request, joint, period) for joint in joints]
    noise = _noise(request.noise, len(joints))
    if all_joints and robot.chain is not None:
        efforts = [joint.limits.effort for joint in joints]
        problem = arm.arm_problem(robot.chain, problems, robot.bodies, efforts, _obstacles(request))
        return _of_arm(request, robot, problem, noise, report_start)
    excitations = [_excitation(request, *part, report_start) for part in zip(joints, problems, noise, strict=True)]
    return Answer(excitations, held=tuple(j.name for j in robot.joints if robot.chain is not None and j not in joints))


def _of_arm(
    request: Request, robot: Robot, problem: ArmExcitationProblem, noise: list[float], report_start: ReportStart | None
) -> Answer:
    try:
        series, optima = arm.design_together(problem, request.starts or STARTS_OF_ARM, request.seed, report_start)
    except ValueError as error:
        raise BadRequest(f"{robot.name}: {error}") from None
    F = arm.arm_observation(problem, series)
    value, cond = float(CRITERIA[request.criterion](F)), float(10 ** condition(F))
    standard_errors = _standard_errors(robot, problem, F, noise) if request.noise else ()
    parts = zip(robot.joints, problem.joints, series, strict=True)
    return Answer(
        [ExcitationTrajectory(*part) for part in parts],
        ArmExcitation(value, cond, F.shape[-1], tuple(optima.tolist()), problem.limits, standard_errors),
    )


def _standard_errors(
    robot: Robot, problem: ArmExcitationProblem, F: Array, noise: list[float]
) -> tuple[ExpectedParameter, ...]:
    """The standard errors of the arm's base parameters, each named by the column that it leads with."""
    std, parameters = expected_std(F, np.tile(noise, len(F) // len(noise))), list[ExpectedParameter]()
    for column, value in zip(problem.columns.tolist(), std.tolist(), strict=True):
        joint, name = arm.parameter_of(problem, column)
        if joint is None:
            parameters.append(ExpectedParameter(name, LINK_UNITS[column % 10], value))
        else:
            unit = robot.joints[joint].unit(TERMS[name.replace("rotor ", "")].unit)
            parameters.append(ExpectedParameter(f"{name} of {robot.joints[joint].name}", unit, value))
    return tuple(parameters)


def _problem(request: Request, joint: Joint, period: float) -> ExcitationProblem:
    options = zip(("--q", "--dq", "--ddq"), request.limits, joint.limits.motion, strict=True)
    q, dq, ddq = (_limits(option, text) if text else limits for option, text, limits in options)
    missing = [name for name, pair in (("q", q), ("dq", dq)) if not all(map(math.isfinite, pair))]
    if joint.kind is Kind.REVOLUTE and not any(map(math.isfinite, q)):
        q = WHOLE_TURN
    if request.evaluate is None and not all(map(math.isfinite, (*q, *dq))):
        remedy = " and ".join(f"--{name}" for name in missing)
        raise BadRequest(
            f"{joint.name}: no limits of {' and '.join(missing)} are stated, so no motion can be known to be safe; add "
            f"limits to the joint in the robot's file, or give {remedy}, each as lower,upper"
        )
    harmonics = request.harmonics or joint.harmonics
    return ExcitationProblem(joint.terms, (q, dq, ddq), period, harmonics, request.criterion, request.samples)


def _excitation(
    request: Request, joint: Joint, problem: ExcitationProblem, noise: float, report_start: ReportStart | None
) -> ExcitationTrajectory:
    if request.evaluate is None:
        try:
            series, optima = design(problem, request.starts or STARTS, request.seed, report_start)
        except ValueError as error:
            raise BadRequest(f"{joint.name}: {error}") from None
        return ExcitationTrajectory(joint, problem, series, tuple(optima.tolist()), noise)
    x = numbers_of_option("--evaluate", request.evaluate)
    if len(x) < 3 or len(x) % 2 == 0:
        raise BadRequest(f"--evaluate takes a0,a1,b1,a2,b2, or a0 and a pair for each harmonic, not {len(x)} numbers")
    problem = replace(problem, harmonics=(len(x) - 1) // 2)
    return ExcitationTrajectory(joint, problem, Fourier.from_coefficients(np.array(x), problem.period), noise=noise)


def _noise(text: str | None, n: int) -> list[float]:
    """The noise of each joint's effort; 0 if it is not stated."""
    values = numbers_of_option("--noise", text) if text else [0.0]
    if len(values) not in (1, n) or (text and min(values) <= 0):
        raise BadRequest(f"--noise takes one positive number, or {n} for the joints in their order, not {text!r}")
    return values * n if len(values) == 1 else values


def _obstacles(request: Request) -> Obstacles:
    floor, texts = request.around
    boxes: list[Box] = []
    for text in texts:
        box = numbers_of_option("--box", text)
        if len(box) != 6 or any(low >= high for low, high in zip(box[:3], box[3:], strict=True)):
            raise BadRequest(f"--box takes the lowest x,y,z and, all higher, the highest x,y,z, not {text!r}")
        boxes.append((box[0], box[1], box[2], box[3], box[4], box[5]))
    if floor is not None and not math.isfinite(floor):
        raise BadRequest(f"--floor must be a number [m], not {floor:g}")
    return Obstacles(-math.inf if floor is None else floor, tuple(boxes))


def _limits(option: str, text: str) -> Range:
    values = numbers_of_option(option, text)
    if len(values) != 2 or values[0] >= values[1]:
        raise BadRequest(f"{option} takes lower,upper with lower < upper, not {text!r}")
    return values[0], values[1]
