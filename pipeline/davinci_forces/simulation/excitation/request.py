"""What is asked of an excitation, as options of a command line, and the trajectories that answer it."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from davinci_forces import robots
from davinci_forces.errors import BadRequest
from davinci_forces.maths.excitation.arm import ArmExcitationProblem, arm_observation, arm_problem, design_together
from davinci_forces.maths.excitation.fourier import CRITERIA, Fourier, Range, condition
from davinci_forces.maths.excitation.joint import ExcitationProblem
from davinci_forces.maths.excitation.search import Tell, nothing
from davinci_forces.robots.robot import Joint, Robot
from davinci_forces.simulation.excitation.trajectory import (
    PERIODS,
    ExcitationTrajectory,
    coefficient_names,
    designed,
    problem_of,
)
from davinci_forces.toml import unlikely

STARTS_OF_ARM = 2  # starts of one joint for one of the arm, which takes longer


@dataclass(frozen=True)
class Request:
    """What is asked for; None is left to the joint."""

    robot: str
    joint: str  # or "all"
    evaluate: str | None
    period: float | None  # [s]
    harmonics: int | None
    criterion: str
    limits: tuple[str | None, str | None, str | None]  # of position, velocity and acceleration: "lower,upper"
    starts: int
    seed: int
    samples: int  # K, instants of a period that the criterion looks at


class ArmExcitation(NamedTuple):
    """What all joints together tell about the arm, and the criterion that each start of the search has come to."""

    objective: float
    condition: float
    base_parameters: int
    optima: tuple[float, ...]


class Answer(NamedTuple):
    """A trajectory for each joint asked for; of all joints together, what they are worth where the links are known."""

    trajectories: list[ExcitationTrajectory]
    arm: ArmExcitation | None = None


def answer(request: Request, tell: Tell = nothing) -> Answer:
    """A trajectory for each joint asked for: designed, or the given one; `tell` hears of each start for an arm.

    Joints that move together share a period.  Where the arm's links are known, their trajectories are the best ones for
    the arm as a whole; else the joints' models are independent, and the best for all of them is the best of each.

    Raises
    ------
    BadRequest, BadRobot
        If the request makes no sense or cannot be met.
    """
    named = Path(request.robot)  # a listed robot, or a .toml file
    robot = robots.load(named.name, named.parent) if named.suffix == ".toml" else robots.load(request.robot, Path())
    together = request.joint == "all"
    joints = robot.joints if together else (robot.joint(request.joint),)
    if request.criterion not in CRITERIA:
        raise BadRequest(f"--criterion is one of {', '.join(CRITERIA)}, not {request.criterion!r}")
    if request.period is not None and not (math.isfinite(request.period) and request.period > 0):
        raise BadRequest(f"--period must be positive, not {request.period:g}")
    if wrong := unlikely("--period", request.period or 0.0, "period"):
        raise BadRequest(f"{wrong}, not {request.period:g}")
    if together and request.evaluate:
        raise BadRequest("--evaluate judges one joint; name it instead of `all`")
    period = request.period or max(PERIODS[joint.kind] for joint in joints)
    problems = [_problem(request, joint, period) for joint in joints]
    if together and robot.chain is not None:
        return _of_arm(request, robot, arm_problem(robot.chain, problems), tell)
    return Answer([_excitation(request, *each) for each in zip(joints, problems, strict=True)])


def _of_arm(request: Request, robot: Robot, problem: ArmExcitationProblem, tell: Tell) -> Answer:
    try:
        found = design_together(problem, max(1, request.starts // STARTS_OF_ARM), request.seed, tell)
    except ValueError as error:
        raise BadRequest(f"{robot.name}: {error}") from None
    F = arm_observation(problem, found.series)
    parts = zip(robot.joints, problem.joints, found.series, strict=True)
    return Answer(
        [ExcitationTrajectory(*part) for part in parts],
        ArmExcitation(
            float(CRITERIA[request.criterion](F)), float(10 ** condition(F)), F.shape[-1], tuple(found.optima.tolist())
        ),
    )


def _problem(request: Request, joint: Joint, period: float) -> ExcitationProblem:
    problem = problem_of(joint, period, request.harmonics, request.criterion, request.samples)
    given = zip(("--q", "--dq", "--ddq"), request.limits, problem.limits, strict=True)
    q, dq, ddq = (_limits(option, text) if text else own for option, text, own in given)
    return replace(problem, limits=(q, dq, ddq))


def _excitation(request: Request, joint: Joint, problem: ExcitationProblem) -> ExcitationTrajectory:
    if request.evaluate is None:
        return designed(joint, problem, request.starts, request.seed)
    x = _numbers("--evaluate", request.evaluate)
    if len(x) < 3 or len(x) % 2 == 0:
        named = ",".join(coefficient_names(2))
        raise BadRequest(f"--evaluate takes {named} or as many pairs as there are harmonics, not {len(x)} numbers")
    given = replace(problem, harmonics=(len(x) - 1) // 2)
    return ExcitationTrajectory(joint, given, Fourier.of(np.array(x), problem.period))


def _limits(option: str, text: str) -> Range:
    values = _numbers(option, text)
    if len(values) != 2 or values[0] >= values[1]:
        raise BadRequest(f"{option} takes lower,upper with lower < upper, not {text!r}")
    return values[0], values[1]


def _numbers(option: str, text: str) -> list[float]:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        raise BadRequest(f"{option} takes numbers with commas between them, not {text!r}") from None
    if not all(map(math.isfinite, values)):
        raise BadRequest(f"{option} takes finite numbers, not {text!r}")
    if wrong := next(filter(None, (unlikely(option, x, "motion") for x in values)), ""):
        raise BadRequest(f"{wrong}, not {text!r}")
    return values
