"""Predict the effort of logs that a fit has not seen, and score it; and model every joint along every log."""

from collections.abc import Collection, Iterable, Iterator

import numpy as np

from davinci_forces.identification.joint_models import Along, at_samples, refits_of
from davinci_forces.identification.scores import Judge
from davinci_forces.identification.used import FALLBACK, Identified
from davinci_forces.maths.signals.windows import outside
from davinci_forces.records import (
    Choice,
    Diagnostic,
    Fit,
    FittedPaths,
    JointModel,
    Motion,
    Prediction,
    diagnostic,
)
from davinci_forces.records.prediction import CHOSEN, SAME_PATH
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry


def run(
    motions: Collection[Motion],
    fits: Iterable[Fit | Choice | FittedPaths],
    entry: LogEntry,
    robot: Robot,
    *,
    lowpass: float,
) -> Iterator[Prediction | Diagnostic]:
    """One Prediction per fit and joint of a log that no parameter was fitted to.

    A joint at rest is not predicted: at standstill friction takes any value up to its Coulomb level.  Predictions of
    identification logs come with the fits, and with the choice.
    """
    if entry.role in ("validation", "contact"):
        along = Along(Identified(robot, fits), motions)
        for motion in motions:
            if not motion.at_rest:
                yield from unseen(motion, along, entry, lowpass)


def unseen(motion: Motion, along: Along, entry: LogEntry, lowpass: float) -> Iterator[Prediction | Diagnostic]:
    """Predict a joint of a log that no parameter was fitted to, by its own fits and by the chosen one."""
    name, free = f"{motion.log}/{motion.joint}", outside(motion.t, entry.contact)
    if not free.any():
        said = f"{name}: its contact windows cover the whole log, so nothing is left to score a prediction on"
        yield diagnostic("predict", f"{motion.log}.{motion.joint}", "warning", said)
        return
    identified = along.identified
    own = [f for f in identified.fits if f.group == motion.joint and f.model == "independent"]
    chosen = identified.used(motion.joint, CHOSEN)
    if chosen is not None and not set(identified.model(chosen).joints) <= along.held(motion.joint):
        missing = f"{name}: the log does not hold the other joints that the chosen model needs"
        said = f"{missing}, so {FALLBACK} stands in for it; add their channels"
        yield diagnostic("predict", f"{motion.log}.{motion.joint}", "note", said)
        chosen = identified.used(motion.joint, FALLBACK)
    named = [(f.model, f.estimator, f) for f in own]
    if chosen is not None:
        named.append((CHOSEN, f"{chosen.model}.{chosen.estimator}", chosen))
    judge, path = Judge(motion, free, lowpass), identified.path(motion)
    for model, by, fit in named:
        yield judge.scored(model, by, entry.role, entry.role, path, along.tau_hat(fit, motion.joint))


def apply(
    motions: Collection[Motion],
    predictions: Collection[Prediction],
    fits: Iterable[Fit | Choice | FittedPaths],
    entry: LogEntry,
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
    if entry.role == "friction":
        return
    identified, is_fitted = Identified(robot, fits), entry.role == "identification"
    along = Along(identified, motions)
    described = [joint for joint in along.joints if identified.describing(joint)]
    used = {joint: identified.used_along(joint, fit, along.held(joint)) for joint in described}
    refits = refits_of(predictions, {joint: own for joint, (own, _) in used.items()}, fit) if is_fitted else {}
    for motion in motions:
        about, name = f"{motion.log}.{motion.joint}.model", f"{motion.log}/{motion.joint}"
        if motion.joint not in used:
            said = "no identification log moves this joint, so its external effort is not tracked"
            yield diagnostic("predict", about, "note", f"{name}: {said}")
            continue
        own, stand_in = used[motion.joint]
        if stand_in:
            yield diagnostic("predict", about, "note", f"{name}: {stand_in}")
        terms = along.by(own, motion.joint)
        if terms["inertia"].min() <= 0:
            yield diagnostic("predict", about, "warning", not_positive(motion, own))
            continue
        path = SAME_PATH if is_fitted else identified.path(motion)
        refit = refits.get(motion.joint)
        yield JointModel(
            log=motion.log, joint=motion.joint, role=motion.role, stand_in=stand_in, path=path,
            scheme=refit.scheme if refit else "" if is_fitted else motion.role,
            path_unseen=refit.path if refit else "" if is_fitted else path,
            rate=motion.rate, at_rest=motion.at_rest, t=motion.t, q=motion.q, dq=motion.dq, ddq=motion.ddq,
            q_measured=motion.q_measured, dq_measured=motion.dq_measured, tau=motion.tau, segment=motion.segment,
            tau_hat_unseen=at_samples(refit, motion) if refit else np.full(len(motion), np.nan), **terms,
        )  # fmt: skip


def not_positive(motion: Motion, fit: Fit) -> str:
    """Why a joint is not tracked."""
    return (
        f"{motion.log}/{motion.joint}: the inertia of {fit.model}.{fit.estimator} is not positive along it, so no "
        f"motion follows from it and nothing is tracked; what `fit` says of {motion.joint} tells why: a motion that "
        "hardly excites it, a sign, other joints that move in the same logs, or what the model leaves out"
    )
