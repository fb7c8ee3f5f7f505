"""What the data tell of a joint's parameters, in words: what moves together, what is not seen, what to record next."""

from collections.abc import Sequence

import numpy as np

from davinci_forces.estimators.problem import Estimate, Regression
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation.least_squares import Told, combinations, deviation, pairs
from davinci_forces.robots import ROBOTS
from davinci_forces.robots.robot import Joint, Robot

TOGETHER = 0.95  # correlation from which on two parameters are said to move together
WEAK = 20.0  # times less well than the best, from which on a combination is said to be told badly
PART = 0.1  # share of a combination's square that a parameter has to have to be named with it
SEEN = 2.0  # standard errors from zero, below which a parameter is not seen
POOR = 0.5  # share of the effort's variance, less than which a model hardly says anything of it


def together(names: Sequence[str], told: Told) -> list[str]:
    """Parameters that move together: pairs by their correlation, and combinations of more by how badly they are told.

    A combination of two that are named as a pair is not said twice.
    """
    close = pairs(told, TOGETHER)
    said = [f"{names[i]} and {names[j]} move together: correlation {r:.2f}" for i, j, r in close]
    named = [{i, j} for i, j, _ in close]
    for members, ratio in combinations(told, WEAK, PART):
        if len(members) > 1 and set(members) not in named:
            which = listed([names[i] for i in members])
            said.append(f"one combination of {which} is told {ratio:.0f} times less well than what is told best")
    return said


def not_seen(problem: Regression, estimate: Estimate) -> list[str]:
    """Parameters that cannot be told from zero, and how much of the effort they can make at most."""
    most = np.abs(estimate.theta) + SEEN * estimate.theta_std
    shares = most * np.linalg.norm(problem.Phi, axis=0) / (np.linalg.norm(problem.tau) or 1.0)
    numbers = zip(problem.names, estimate.theta, estimate.theta_std, shares, strict=True)
    return [
        f"{name} is not seen: {theta:.2g} ± {std:.1g}, at most {percent(share)} of the effort"
        for name, theta, std, share in numbers
        if abs(theta) < SEEN * std
    ]


def advice(robot: Robot, joint: Joint, said: Sequence[str]) -> str:
    """What to record next; nothing where nothing is wanting."""
    return f"{better_motion(robot, joint)} designs a motion that tells them best" if said else ""


def better_motion(robot: Robot, joint: Joint) -> str:
    """The command that designs a motion of a joint; a robot that is not listed is in a file beside the study."""
    named = robot.file or (robot.name if robot.name in ROBOTS else f"{robot.name}.toml")
    return f"`davinci-forces excite {named} {joint.name}`"


def inertia_at_fault(robot: Robot, joint: Joint, estimate: Estimate, told: Told, others: Sequence[str]) -> str:
    """Why an inertia is not positive, by what else the same fit says; `others` are joints that move in the same logs.

    One that cannot be told from a positive one was not excited; one that can is wrong together with friction where a
    sign is, and by itself where the model leaves something out.
    """
    weights = np.array([term.a for term in joint.terms])
    value, std = float(weights @ estimate.theta), deviation(told.correlation, estimate.theta_std, weights)
    found = f"{value:.2g} ± {std:.1g} {joint.unit('{inertia}')}"
    beside = f", and {moving(others)} in the same logs, which this model leaves out" if others else ""
    alone = "by itself, " if others else ""
    if value > -SEEN * std:
        said = f"{found} cannot be told from a positive one, as the motion hardly excites it{beside}"
        return f"{said}; record it {alone}accelerating more: {better_motion(robot, joint)}"
    friction = np.array([term.positive and not term.a for term in joint.terms])
    backward = friction & (estimate.theta < -SEEN * estimate.theta_std)
    if friction.any() and backward.sum() * 2 >= friction.sum():
        return f"{found}, and so is friction: the effort pushes against the motion; correct the `sign` of one of them"
    said = f"{found}, while friction is not negative, so the signs are right"
    if others:
        return f"{said}{beside}; record it by itself: {better_motion(robot, joint)}"
    return f"{said}: effort and motion may be logged at different times, or friction gives before it slides"


def hardly_described(joint: Joint, r2: float, others: Sequence[str]) -> str:
    """That a model hardly describes the effort, and why that may be; "" where it does."""
    if r2 >= POOR:
        return ""
    said = f"its own terms explain {percent(max(r2, 0.0))} of the effort's variance"
    if others:
        return f"{said}: {moving(others)} in the same logs, which they leave out; record it moving by itself"
    return f"{said}: check that its effort and its motion are channels of one joint, and which terms it needs"


def listed(names: Sequence[str]) -> str:
    """Names in a row: 'a, b and c'."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def moving(joints: Sequence[str]) -> str:
    """Joints with their verb: 'a moves', 'a and b move'."""
    return f"{listed(joints)} move{'s' if len(joints) == 1 else ''}"


def percent(share: float) -> str:
    """A share in words."""
    return f"{100.0 * share:.2g} %"


def moving_with(joint: str, logs: Sequence[str], every: Sequence[tuple[str, str]]) -> list[str]:
    """The other joints that move in some logs, given (log, joint) of all that move."""
    return list(dict.fromkeys(other for log, other in every if log in logs and other != joint))


def flat(told: Told) -> Array:
    """The correlation matrix row by row (p^2,)."""
    return np.asarray(told.correlation.ravel())
