"""Describe every joint along every log: which fit says so and why, its inertia, and the effort that is not external."""

from collections.abc import Collection, Iterable, Iterator, Sequence

import numpy as np

from davinci_forces.identification.joint_models import Along
from davinci_forces.identification.paths import SAME_PATH
from davinci_forces.identification.used import Identified
from davinci_forces.maths.arrays import Array
from davinci_forces.records import Choice, Diagnostic, Fit, FittedPaths, JointModel, Motion, Prediction, diagnostic
from davinci_forces.records.predict import CHOSEN
from davinci_forces.robots.robot import Robot


def run(
    motions: Sequence[Motion],
    predictions: Collection[Prediction],
    fits: Iterable[Fit | Choice | FittedPaths],
    robot: Robot,
    *,
    fit: str,
) -> Iterator[JointModel | Diagnostic]:
    """One JointModel per joint that a fit describes; a joint without one says why.

    Raises
    ------
    PipelineError
        If there is no fit of the name that the settings say.
    """
    if motions[0].role == "friction":
        return
    identified = Identified(robot, fits)
    along = Along(identified, motions)
    used = {
        m.joint: identified.used_along(m.joint, fit, along.held(m)) for m in motions if identified.describing(m.joint)
    }
    is_fitted = motions[0].role == "identification"
    refits = refits_of(predictions, {joint: own for joint, (own, _) in used.items()}, fit) if is_fitted else {}
    for motion in motions:
        about, name = f"{motion.log}.{motion.joint}", f"{motion.log}/{motion.joint}"
        if motion.joint not in used:
            said = "no identification log moves this joint, so its external effort is not tracked"
            yield diagnostic("describe", about, "note", f"{name}: {said}")
            continue
        own, stand_in = used[motion.joint]
        if stand_in:
            yield diagnostic("describe", about, "note", f"{name}: {stand_in}")
        terms = along.by(own, motion.joint)
        if terms["inertia"].min() <= 0:
            yield diagnostic("describe", about, "warning", not_positive(motion, own))
            continue
        path = SAME_PATH if is_fitted else identified.path(motion)
        refit = refits.get(motion.joint)
        yield JointModel(
            log=motion.log, joint=motion.joint, role=motion.role, stand_in=stand_in, path=path,
            scheme=refit.scheme if refit else "" if is_fitted else motion.role,
            path_unseen=refit.path if refit else "" if is_fitted else path,
            rate=motion.rate, at_rest=motion.at_rest, t=motion.t, q=motion.q, dq=motion.dq, ddq=motion.ddq,
            q_measured=motion.q_measured, dq_measured=motion.dq_measured, tau=motion.tau, segment=motion.segment,
            tau_hat_unseen=unseen(refit, motion) if refit else np.full(len(motion), np.nan), **terms,
        )  # fmt: skip


def refits_of(predictions: Iterable[Prediction], used: dict[str, Fit], setting: str) -> dict[str, Prediction]:
    """What refits that left data of a log out predict of each joint, in place of the fit that describes it."""
    refits: dict[str, Prediction] = {}
    for prediction in predictions:
        fit = used.get(prediction.joint)
        wanted = (CHOSEN,) if setting == CHOSEN else (fit.model, fit.estimator) if fit else ()
        if fit and prediction.joint not in refits and (prediction.model, prediction.estimator)[: len(wanted)] == wanted:
            refits[prediction.joint] = prediction
    return refits


def unseen(prediction: Prediction, motion: Motion) -> Array:
    """The predicted effort (N,) at the samples of a recording; NaN at those that are not predicted."""
    half = 0.5 / motion.rate
    at = np.minimum(np.searchsorted(prediction.t, motion.t - half), len(prediction) - 1)
    return np.where(np.abs(prediction.t[at] - motion.t) < half, prediction.tau_hat[at], np.nan)


def not_positive(motion: Motion, fit: Fit) -> str:
    """Why a joint is not tracked."""
    return (
        f"{motion.log}/{motion.joint}: the inertia of {fit.model}.{fit.estimator} is not positive along it, so no "
        f"motion follows from it and nothing is tracked; what `fit` says of {motion.joint} tells why: a motion that "
        "hardly excites it, a sign, other joints that move in the same logs, or what the model leaves out"
    )
