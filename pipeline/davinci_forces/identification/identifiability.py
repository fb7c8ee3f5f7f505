"""Text on the identifiability of a joint: correlated and insignificant parameters, and what to record next."""

from collections.abc import Sequence

import numpy as np

from davinci_forces.estimators.problem import Estimate, Regression
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation import least_squares
from davinci_forces.records.record import join_names
from davinci_forces.robots import ROBOTS
from davinci_forces.robots.robot import ANYWHERE, Joint, Robot

MIN_CORRELATION = 0.95  # two parameters are reported as correlated from this correlation on
MIN_UNCERTAINTY_RATIO = 20.0  # a combination this many times less certain than the best one is reported
MIN_PART_NAMED = 0.1  # a combination is reported with the parameters whose squared component is at least this
MIN_Z = 2.0  # ratio of a parameter to its standard error; a smaller one is not significant
MIN_R2 = 0.5  # a model that explains less of the effort's variance hardly describes the effort
MAX_OMITTED = 0.1  # share of the largest harmonic; where a larger one is left out, that may be why a fit is bad


def describe_correlated(names: Sequence[str], conditioning: least_squares.ColumnAnalysis) -> list[str]:
    """Describe correlated pairs of parameters, and the uncertain combinations that are not of such a pair."""
    correlated = least_squares.correlated_pairs(conditioning, MIN_CORRELATION)
    texts = [f"the estimates of {join_names([names[i], names[j]])} are correlated: {r:.2f}" for i, j, r in correlated]
    reported = [{i, j} for i, j, _ in correlated]
    for members, ratio in least_squares.uncertain_combinations(conditioning, MIN_UNCERTAINTY_RATIO, MIN_PART_NAMED):
        if len(members) > 1 and set(members) not in reported:
            parameters = join_names([names[i] for i in members])
            certainty = f"{ratio:.0f} times less certain than the combination that the data determine best"
            texts.append(f"one combination of {parameters} is {certainty}")
    return texts


def describe_insignificant(problem: Regression, estimate: Estimate) -> list[str]:
    """Describe parameters whose estimates noise alone could explain, with an upper bound of their effort.

    They are compared with their error due to noise alone.  Other terms of the model may change a parameter, too, but
    then the data do determine it.  The upper bound takes both parts of the error.
    """
    noise_std = estimate.standard_errors.noise
    upper = np.abs(estimate.theta) + MIN_Z * estimate.theta_std
    shares = np.minimum(upper * np.linalg.norm(problem.Phi, axis=0) / (np.linalg.norm(problem.tau) or 1.0), 1.0)
    numbers = zip(problem.names, estimate.theta, noise_std, shares, strict=True)
    return [
        f"{name} is not significant: {theta:.2g} ± {std:.1g}, at most {percent(share)} of the effort"
        for name, theta, std, share in numbers
        if abs(theta) < MIN_Z * std
    ]


def advice(robot: Robot, joint: Joint, problems: Sequence[str]) -> str:
    """Recommend what to record next; "" without problems."""
    command = excite_command(robot, joint.name)
    return f"{command} designs a motion that excites these parameters best" if problems else ""


def excite_command(robot: Robot, joint: str) -> str:
    """Return the command that designs a motion of a joint, or of `all`, and where and when a robot's file allows it."""
    listed = robot.name in ROBOTS and not robot.file
    name = robot.name if listed else robot.file or f"{robot.name}.toml"
    limits = [j.limits for j in robot.joints if joint in (j.name, "all")]
    lacking = f" (once {name} states limits of q and dq)" * any(ANYWHERE in (limit.q, limit.dq) for limit in limits)
    return f"`davinci-forces excite {name} {joint}`" + ("" if listed else f" in the study's folder{lacking}")


def why_not_positive(
    robot: Robot, joint: Joint, estimate: Estimate, conditioning: least_squares.ColumnAnalysis, others: Sequence[str]
) -> str:
    """Explain from its fit why an inertia is not positive; `others` are joints that move in the same logs.

    If friction is negative, too, a sign is wrong.  Otherwise, if the estimate is not significantly negative, the motion
    hardly excites the inertia; if it is, the model lacks a term.
    """
    inertia_coefficients = np.array([term.a for term in joint.terms])  # term.a is the coefficient of the acceleration
    value = float(inertia_coefficients @ estimate.theta)
    std = least_squares.std_of_sum(conditioning.correlation, estimate.theta_std, inertia_coefficients)
    inertia = f"{value:.2g} ± {std:.1g} {joint.unit('{inertia}')}"
    omitted = f"; this model leaves out the effects of {join_names(others)} in the same logs" if others else ""
    friction = np.array([term.positive for term in joint.terms]) & (inertia_coefficients == 0)
    if are_negative(estimate.theta[friction], estimate.theta_std[friction]):
        text = f"{inertia}, and friction is negative, too: the effort opposes the motion"
        return f"{text}; correct the `sign` of the effort or of the position"
    if value > -MIN_Z * std:
        text = f"{inertia} cannot be distinguished from 0, because the motion hardly excites it{omitted}"
        by_itself = "by itself, " if others else ""
        return f"{text}; record the joint {by_itself}with larger accelerations: {excite_command(robot, joint.name)}"
    text = f"{inertia}, while friction is not negative, so the signs are right"
    if others:
        return f"{text}{omitted}; record the joint by itself: {excite_command(robot, joint.name)}"
    causes = "effort and motion may be logged at different times, or friction acts as a spring at reversals"
    return f"{text}: {causes}"


def are_negative(theta: Array, theta_std: Array) -> bool:
    """Whether of some parameters, with their standard errors, at least half are significantly negative."""
    return bool(len(theta) and 2 * np.count_nonzero(theta < -MIN_Z * theta_std) >= len(theta))


def hardly_described(joint: Joint, r2: float, others: Sequence[str], omitted: float = 0.0) -> str:
    """Report that a model hardly describes the effort, with a possible cause; "" if it describes the effort.

    `omitted` is the largest harmonic left out of its motion, over the largest.  A motion without a commanded harmonic
    is another one, so a bad fit to it says nothing of the channels; that harmonic is reported by `differentiate`.
    """
    if r2 >= MIN_R2 or omitted > MAX_OMITTED:
        return ""
    text = f"its own terms explain {percent(max(r2, 0.0))} of the effort's variance"
    if others:
        move = f"{join_names(others)} move{'s' if len(others) == 1 else ''}"
        remedy = "record the joint by itself, unless a model of the whole arm is chosen for it"
        return f"{text}: {move} in the same logs, which its terms omit; {remedy}"
    return f"{text}: check that its effort and motion are channels of one joint, and which terms its model needs"


def percent(share: float) -> str:
    """Format a share in per cent."""
    return f"{float(f'{100.0 * share:.2g}'):g} %"  # 100 rather than 1e+02


def moving_with(joint: str, logs: Sequence[str], moves: Sequence[tuple[str, str]]) -> list[str]:
    """Return the other joints that move in these logs; `moves` has (log, joint) of every joint that moves."""
    return list(dict.fromkeys(name for log, name in moves if log in logs and name != joint))
