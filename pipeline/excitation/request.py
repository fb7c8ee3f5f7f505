"""What is asked of an excitation, as options of a command line, and the trajectories that answer it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np

from pipeline import robots
from pipeline.errors import BadRequest
from pipeline.excitation.trajectory import PERIODS, ExcitationTrajectory, coefficient_names, designed, problem_of
from pipeline.maths.excitation.arm import arm_observation, arm_problem, design_together
from pipeline.maths.excitation.fourier import Fourier, Range, condition
from pipeline.maths.excitation.joint import CRITERIA, ExcitationProblem
from pipeline.maths.mechanics.chain import Chain
from pipeline.robots.robot import Joint, Robot

STARTS_OF_ARM = 12  # starts of one joint for one of the arm, which takes as much longer


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


def answer(request: Request) -> list[ExcitationTrajectory]:
    """A trajectory for each joint asked for: designed, or the given one.

    Joints that move together share a period.  Where the arm's links are known, their trajectories are the best ones for
    the arm as a whole; else the joints' models are independent, and the best for all of them is the best of each.

    Raises
    ------
    BadRequest, BadRobot
        If the request makes no sense or cannot be met.
    """
    robot = load(request.robot)
    together = request.joint == "all"
    joints = robot.joints if together else (robot.joint(request.joint),)
    if request.criterion not in CRITERIA:
        raise BadRequest(f"--criterion is one of {', '.join(CRITERIA)}, not {request.criterion!r}")
    if request.period is not None and not (math.isfinite(request.period) and request.period > 0):
        raise BadRequest(f"--period must be positive, not {request.period:g}")
    if together and request.evaluate:
        raise BadRequest("--evaluate judges one joint; name it instead of `all`")
    period = request.period or max(PERIODS[joint.kind] for joint in joints)
    problems = [_problem(request, joint, period) for joint in joints]
    if together and robot.chain is not None:
        return _of_arm(request, robot, problems)
    return [_excitation(request, joint, problem) for joint, problem in zip(joints, problems, strict=True)]


def arm_of(robot: Robot, trajectories: Sequence[ExcitationTrajectory]) -> tuple[float, float, int] | None:
    """Objective, condition number and number of base parameters of all joints together, where the links are known."""
    if robot.chain is None or len(trajectories) < len(robot.joints):
        return None
    problem = arm_problem(robot.chain, [trajectory.problem for trajectory in trajectories])
    F = arm_observation(problem, [trajectory.series for trajectory in trajectories])
    return CRITERIA[problem.joints[0].criterion](F)[0], float(10 ** condition(F)[0]), F.shape[1]


def _of_arm(request: Request, robot: Robot, problems: list[ExcitationProblem]) -> list[ExcitationTrajectory]:
    try:
        together = arm_problem(cast(Chain, robot.chain), problems)
        series = design_together(together, max(1, request.starts // STARTS_OF_ARM), request.seed)
    except ValueError as error:
        raise BadRequest(f"{robot.name}: {error}") from None
    return [ExcitationTrajectory(*each) for each in zip(robot.joints, problems, series, strict=True)]


def load(robot: str) -> Robot:
    """A listed robot, or the one of a .toml file."""
    return robots.load(Path(robot).name, Path(robot).parent) if robot.endswith(".toml") else robots.load(robot, Path())


def _problem(request: Request, joint: Joint, period: float) -> ExcitationProblem:
    problem = problem_of(joint, period, request.harmonics, request.criterion)
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
    return values
