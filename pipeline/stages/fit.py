"""Fit the parameters of every joint to all identification logs together, with every estimator."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from pipeline.errors import NotIdentifiable
from pipeline.estimators import ESTIMATORS, estimator
from pipeline.estimators.problem import Estimate, Regression
from pipeline.estimators.regression import MODEL, pose
from pipeline.maths.models.dynamics import mass, regressor
from pipeline.records import Diagnostic, Fit, Residual, Trajectory, diagnostic
from pipeline.robots.robot import Joint, Robot


def run(trajectories: Iterable[Trajectory], robot: Robot) -> Iterator[Fit | Residual | Diagnostic]:
    """One Fit per joint and estimator; an estimator that cannot be used says why, and the rest goes on."""
    every = list(trajectories)
    for joint in robot.joints:
        own = [trajectory for trajectory in every if trajectory.joint == joint.name]
        if not own:
            continue
        problem = pose(own, joint)
        for name in ESTIMATORS:
            try:
                answer = estimator(name)(problem)
            except NotIdentifiable as error:
                yield diagnostic("fit", joint.name, "warning", f"{joint.name}: {name} is left out: {error}")
                continue
            if mass(joint.terms, answer.theta) <= 0:
                yield diagnostic(
                    "fit", joint.name, "warning", f"{joint.name}: {name} finds an inertia that is not positive"
                )
            yield summarised(own, joint, name, problem, answer)
            yield from residuals(own, joint, name, answer)


def summarised(own: Sequence[Trajectory], joint: Joint, name: str, problem: Regression, answer: Estimate) -> Fit:
    """A Fit with how well it describes the averaged periods."""
    residual = problem.tau - problem.Phi @ answer.theta
    spread = problem.tau - problem.tau.mean()
    return Fit(
        group=joint.name,
        model=MODEL,
        estimator=name,
        logs=tuple(t.log for t in own),
        samples=len(problem.tau),
        periods=min(t.periods for t in own),
        mse=float(np.mean(residual**2)),
        r2=float(1 - residual @ residual / (spread @ spread)),
        condition=float(np.linalg.cond(problem.Phi)),
        hac_lags=answer.hac_lags,
        parameter=np.array([term.name for term in joint.terms], object),
        phi=np.array([term.typst for term in joint.terms], object),
        unit=np.array([joint.unit(term.unit) for term in joint.terms], object),
        theta=answer.theta,
        theta_std=answer.theta_std,
        theta_std_hac=answer.theta_std_hac,
    )


def residuals(own: Sequence[Trajectory], joint: Joint, name: str, answer: Estimate) -> Iterator[Residual]:
    """What the fit leaves of each log's averaged effort.  (6.54)"""
    for t in own:
        tau_hat = regressor(joint.terms, t.q, t.dq, t.ddq) @ answer.theta
        yield Residual(t.log, joint.name, MODEL, name, t.rate, t=t.t, dq=t.dq, tau=t.tau, tau_hat=tau_hat)
