"""The identifiability of a joint's parameters in words: correlated ones, insignificant ones, what to record next."""

from collections.abc import Sequence

import numpy as np

from davinci_forces.estimators.problem import Estimate, Regression
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation.least_squares import ColumnAnalysis, combinations, deviation, pairs
from davinci_forces.robots import ROBOTS
from davinci_forces.robots.robot import Joint, Robot

MIN_CORRELATION = 0.95  # from which on two parameters are named as correlated
MIN_UNCERTAINTY_RATIO = 20.0  # to the best combination, from which on one is named as uncertain
MIN_PART_NAMED = 0.1  # share of a combination's square for a parameter to be named with it
MIN_Z = 2.0  # standard errors from zero, below which a parameter is not significant
MIN_R2 = 0.5  # share of the effort's variance, below which a model hardly describes it


def describe_correlated(names: Sequence[str], conditioning: ColumnAnalysis) -> list[str]:
    """Describe correlated parameters: pairs by their correlation, and larger combinations by their uncertainty.

    A combination of two that are named as a pair is not named again.
    """
    close = pairs(conditioning, MIN_CORRELATION)
    texts = [f"the estimates of {names[i]} and {names[j]} are correlated: {r:.2f}" for i, j, r in close]
    named = [{i, j} for i, j, _ in close]
    for members, ratio in combinations(conditioning, MIN_UNCERTAINTY_RATIO, MIN_PART_NAMED):
        if len(members) > 1 and set(members) not in named:
            parameters = join_names([names[i] for i in members])
            texts.append(f"one combination of {parameters} is {ratio:.0f} times less certain than the best one")
    return texts


def not_seen(problem: Regression, estimate: Estimate) -> list[str]:
    """Describe parameters that do not differ significantly from zero, with an upper bound of their effort."""
    upper = np.abs(estimate.theta) + MIN_Z * estimate.theta_std
    shares = upper * np.linalg.norm(problem.Phi, axis=0) / (np.linalg.norm(problem.tau) or 1.0)
    numbers = zip(problem.names, estimate.theta, estimate.theta_std, shares, strict=True)
    return [
        f"{name} is not significant: {theta:.2g} ± {std:.1g}, at most {percent(share)} of the effort"
        for name, theta, std, share in numbers
        if abs(theta) < MIN_Z * std
    ]


def advice(robot: Robot, joint: Joint, problems: Sequence[str]) -> str:
    """Say what to record next; "" without problems."""
    return f"{better_motion(robot, joint)} designs a motion that excites them best" if problems else ""


def better_motion(robot: Robot, joint: Joint) -> str:
    """Return the command that designs a motion of a joint; a robot that is not listed has a file beside the study."""
    name = robot.file or (robot.name if robot.name in ROBOTS else f"{robot.name}.toml")
    return f"`davinci-forces excite {name} {joint.name}`"


def inertia_at_fault(
    robot: Robot, joint: Joint, estimate: Estimate, conditioning: ColumnAnalysis, others: Sequence[str]
) -> str:
    """Explain by the same fit why an inertia is not positive; `others` are joints that move in the same logs.

    If it may be positive, it was not excited.  If friction is negative, too, a sign is wrong.  Otherwise the model
    lacks a term.
    """
    weights = np.array([term.a for term in joint.terms])
    value, std = float(weights @ estimate.theta), deviation(conditioning.correlation, estimate.theta_std, weights)
    inertia = f"{value:.2g} ± {std:.1g} {joint.unit('{inertia}')}"
    beside = f", and {joints_move(others)} in the same logs, which this model omits" if others else ""
    if value > -MIN_Z * std:
        text = f"{inertia} may be positive, because the motion hardly excites it{beside}"
        by_itself = "by itself, " if others else ""
        return f"{text}; record it {by_itself}accelerating more: {better_motion(robot, joint)}"
    friction = np.array([term.positive and not term.a for term in joint.terms])
    backward = friction & (estimate.theta < -MIN_Z * estimate.theta_std)
    if friction.any() and backward.sum() * 2 >= friction.sum():
        text = f"{inertia}, and friction is negative, too: the effort opposes the motion"
        return f"{text}; correct the `sign` of one of them"
    text = f"{inertia}, while friction is not negative, so the signs are right"
    if others:
        return f"{text}{beside}; record it by itself: {better_motion(robot, joint)}"
    return f"{text}: effort and motion may be logged at different times, or friction yields before it slides"


def hardly_described(joint: Joint, r2: float, others: Sequence[str]) -> str:
    """Say that a model hardly describes the effort, and why that may be; "" if it does."""
    if r2 >= MIN_R2:
        return ""
    text = f"its own terms explain {percent(max(r2, 0.0))} of the effort's variance"
    if others:
        return f"{text}: {joints_move(others)} in the same logs, which they omit; record it moving by itself"
    return f"{text}: check that its effort and its motion are channels of one joint, and which terms it needs"


def join_names(names: Sequence[str]) -> str:
    """Join names: 'a, b and c'."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def joints_move(joints: Sequence[str]) -> str:
    """Return the clause 'a moves', or 'a and b move'."""
    return f"{join_names(joints)} move{'s' if len(joints) == 1 else ''}"


def percent(share: float) -> str:
    """Format a share in per cent."""
    return f"{100.0 * share:.2g} %"


def moving_with(joint: str, logs: Sequence[str], moves: Sequence[tuple[str, str]]) -> list[str]:
    """Return the other joints that move in some logs; `moves` are (log, joint) of all that move."""
    return list(dict.fromkeys(name for log, name in moves if log in logs and name != joint))


def flat(conditioning: ColumnAnalysis) -> Array:
    """Return the correlation matrix row by row (p^2,)."""
    return np.asarray(conditioning.correlation.ravel())
