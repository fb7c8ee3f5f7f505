"""Predict and score the effort of logs that no fit has used, and compute the modelled effort along every log."""

from collections.abc import Collection, Iterable, Iterator

import numpy as np

from davinci_forces.identification.identifiability import are_negative
from davinci_forces.identification.joint_models import Identified, LogModels, at_samples, refits_of
from davinci_forces.identification.observations import is_evaluated
from davinci_forces.identification.scores import Scorer
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.periods.averaging import Phases
from davinci_forces.maths.signals.faults import beyond_steps
from davinci_forces.maths.signals.smoothing import lowpass_segments
from davinci_forces.maths.signals.standstill import is_far_from_reversals
from davinci_forces.maths.signals.windows import UNSCORED_SAMPLE, UNSCORED_STRETCH, is_outside, spans
from davinci_forces.records.model import Choice, Fit, FittedPaths, Residual
from davinci_forces.records.prediction import CHOSEN, SAME_PATH, JointModel, PathShare, Prediction
from davinci_forces.records.record import Counts, Diagnostic, diagnostic
from davinci_forces.records.recordings import Average, Motion
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

OPPOSED = 0.5  # the error by the other sign, over the error, of an effort with a wrong sign
EDGE = 3.0  # largest duration of what a low-pass spoils at the end of a log, times its cutoff
MIN_LOST = 0.01  # share of a log that is not scored, from which a warning says so


def run(
    motions: Collection[Motion],
    fits: Iterable[Fit | Choice | FittedPaths],
    entry: LogEntry,
    robot: Robot,
    *,
    lowpass: float,
    fit: str,
) -> Iterator[Prediction | PathShare | Diagnostic]:
    """Predict the effort of each moving joint by each fit, in a log that no parameter was fitted to.

    Of every log of free motion or contact, it is computed how new its path and its speed are.  A joint at rest is not
    predicted, and standstill is not scored: friction takes any value up to its static level there.  Stages `fit` and
    `choose` predict identification logs.
    """
    if entry.role not in ("identification", "validation", "contact"):
        return
    along = LogModels(Identified(robot, fits), motions)
    for motion in motions:
        if not motion.at_rest:
            identified, moving = along.identified, float(np.mean(motion.standing == 0))
            new, speed = identified.path_new(motion), identified.speed_ratio(motion)
            outside = identified.share_outside(motion)
            yield PathShare(motion.log, motion.joint, motion.role, new, moving, speed, outside)
            if entry.role != "identification":
                yield from predict_joint(motion, along, entry, lowpass, fit)


def predict_joint(
    motion: Motion, along: LogModels, entry: LogEntry, lowpass: float, setting: str
) -> Iterator[Prediction | Diagnostic]:
    """Predict the effort of a joint by its own fits, by the chosen one, and by the one that the setting `fit` names."""
    name = f"{motion.log}/{motion.joint}"
    identified, on_clock = along.identified, along.joints_on_clock(motion.joint)
    independent = [f for f in identified.fits if f.group == motion.joint and f.model == "independent"]
    chosen = None
    if identified.fit_of(motion.joint, CHOSEN) is not None:
        chosen, missing = identified.fit_along(motion.joint, CHOSEN, on_clock)
        if missing:
            yield diagnostic("predict", f"{motion.log}.{motion.joint}", "note", f"{name}: {missing}")
    labelled = [(f.model, f.estimator, f) for f in independent]
    if chosen is not None:
        labelled.append((CHOSEN, f"{chosen.model}.{chosen.estimator}", chosen))
    named = identified.fit_of(motion.joint, setting) if setting != CHOSEN else None
    if named and named not in independent and set(identified.model(named).joints) <= on_clock:
        labelled.append((named.model, named.estimator, named))
    scored = is_scored(motion, along, chosen, entry)
    free = scored & is_outside(motion.t, entry.possible_contact)
    if not free.any():
        message = f"{name}: contact and standstill cover the whole log, so no prediction can be scored"
        yield diagnostic("predict", f"{motion.log}.{motion.joint}", "warning", message)
        return
    if steps := spans(motion.t, ~scored & is_evaluated(motion)):
        lost = sum(end - start for start, end in steps) / (motion.t[-1] - motion.t[0])
        severity = "warning" if lost > MIN_LOST else "note"
        why = "the effort steps there as the motion does not explain, as where a controller starts or stops"
        edge = ", or where a log begins or ends amid a motion, which its low-pass cannot follow there"
        texts = [
            f"{name}: {start:.2f} to {end:.2f} s are not scored: {why}"
            + (edge if end - start < EDGE / motion.cutoff else "; leave them out by `skip` and `until`")
            for start, end in steps
        ]
        yield diagnostic("predict", f"{motion.log}.{motion.joint}.steps", severity, *texts)
    if labelled:
        yield from sign_warning(motion, along.tau_hat(labelled[-1][2], motion.joint), free)
    scorer, path = Scorer(motion, free, lowpass), identified.path(motion)
    for model, estimator, fit in labelled:
        yield scorer.score(model, estimator, entry.role, path, along.tau_hat(fit, motion.joint))


def sign_warning(motion: Motion, tau_hat: Array, free: Booleans) -> Iterator[Diagnostic]:
    """Warn of an effort that the model (N,) explains far better with the other sign, at free samples (N,)."""
    wrong, right = (float(np.std((motion.tau - sign * tau_hat)[free])) for sign in (1.0, -1.0))
    if right < OPPOSED * wrong:
        falls = f"whose error falls from {wrong:.2g} to {right:.2g} by the other sign"
        what = f"{motion.log}/{motion.joint}: the effort is the opposite of the model's, {falls}"
        text = f"{what}; correct the `sign` of its effort or position in study.toml"
        yield diagnostic("predict", f"{motion.log}.{motion.joint}.sign", "warning", text)


def apply(
    motions: Collection[Motion],
    predictions: Collection[Prediction],
    averages: Iterable[Average],
    fits: Iterable[Fit | Choice | FittedPaths],
    entry: LogEntry,
    robot: Robot,
    *,
    fit: str,
) -> Iterator[JointModel | Residual | Diagnostic]:
    """Evaluate the model of each joint along a log; a diagnostic says why a joint has none.

    A model of more than the joint also gets its residual in an identification log, as the fits of joints by themselves
    have theirs.

    Raises PipelineError if no fit has the name that the settings state.
    """
    if entry.role == "friction":
        return
    identified, is_fitted = Identified(robot, fits), entry.role == "identification"
    along = LogModels(identified, motions)
    described = [joint for joint in along.joints if identified.fits_of(joint)]
    used = {joint: identified.fit_along(joint, fit, along.joints_on_clock(joint)) for joint in described}
    periods = {average.joint: average for average in averages}
    refits = refits_of(predictions if is_fitted else (), {joint: f for joint, (f, _) in used.items()}, fit)
    for motion in motions:
        about, name = f"{motion.log}.{motion.joint}.model", f"{motion.log}/{motion.joint}"
        if motion.joint not in used:
            message = "no identification log moves this joint, so its external effort is not estimated"
            yield diagnostic("predict", about, "note", f"{name}: {message}")
            continue
        joint_fit, stand_in = used[motion.joint]
        if stand_in:
            yield diagnostic("predict", about, "note", f"{name}: {stand_in}")
        unscored = unscored_flags(motion, is_scored(motion, along, joint_fit, entry))
        path = SAME_PATH if is_fitted else identified.path(motion)
        terms = along.fields_of(joint_fit, motion.joint)
        if terms["inertia"].min() <= 0:
            yield diagnostic("predict", about, "warning", inertia_warning(motion, joint_fit, identified))
            continue
        refit = refits.get(motion.joint)
        model = JointModel.like(
            motion, stand_in=stand_in, path=path, scheme=refit.scheme if refit else "" if is_fitted else motion.role,
            path_unseen=refit.path if refit else "" if is_fitted else path,
            tau_hat_unseen=at_samples(refit, motion) if refit else np.broadcast_to(np.nan, len(motion)),
            unscored=unscored, **terms,
        )  # fmt: skip
        yield from model.blocks()
        if is_fitted and (fit == CHOSEN or joint_fit.model != "independent") and not motion.at_rest:
            names = model.model, model.estimator
            yield residual_of(model, periods.get(motion.joint), (CHOSEN, ".".join(names)) if fit == CHOSEN else names)


def residual_of(model: JointModel, average: Average | None, label: tuple[str, str]) -> Residual:
    """A model's effort and the measured one, averaged over periods, or low-passed like the model's motion.

    `label` is the residual's model and estimator.  A phase that is scored in no period, as where the joint rests in
    each, has no residual: the measured effort is that of the model.
    """
    columns = [model.dq, model.tau, model.tau_hat]
    if average is None:
        samples = slice(None, None, max(int(model.rate / (2.0 * model.cutoff)), 1))
        smooth = (lowpass_segments(x, model.segment, model.rate, model.cutoff) for x in columns)
        t, (dq, tau, tau_hat) = model.t[samples], (x[samples] for x in smooth)
    else:
        last = average.t_start + (average.periods * average.period - 0.5 / model.rate)
        used = (model.t >= average.t_start - 0.5 / model.rate) & (model.t <= last)
        phased, is_scored = Phases(model.t[used], average.period, len(average)), model.unscored[used] == 0
        t, (dq, tau, tau_hat) = average.t, (phased.mean_of(x[used], is_scored) for x in columns)
        tau = np.where(np.bincount(phased.bins[is_scored], minlength=len(t)) > 0, tau, tau_hat)
    return Residual(model.log, model.joint, *label, model.rate, t=t, dq=dq, tau=tau, tau_hat=tau_hat)


def is_scored(motion: Motion, along: LogModels, fit: Fit | None, entry: LogEntry) -> Booleans:
    """The samples (N,) at which models are scored: not at standstill, nor where the controller starts or stops.

    Steps of the effort are sought in free motion that `fit` has not seen.  Friction may change by twice its static
    level, but not while the joint moves on.
    """
    moves = is_evaluated(motion)
    if fit is None or entry.role not in ("validation", "contact") or not entry.has_known_free_motion:
        return moves
    unbroken = np.diff(motion.segment, prepend=motion.segment[:1]) == 0
    free = moves & is_outside(motion.t, entry.possible_contact) & unbroken
    friction = 2.0 * along.identified.static_friction(fit, motion.joint)
    slack = np.where(is_far_from_reversals(motion.dq, 1.0 / motion.rate), 0.0, friction)
    residual = motion.tau - along.tau_hat(fit, motion.joint)
    return np.asarray(moves & ~beyond_steps(residual, free, slack, round(motion.rate / motion.cutoff)))


def unscored_flags(motion: Motion, scored: Booleans) -> Counts:
    """The flags (N,) of samples that are not scored; a sample that is only filled in has no transient."""
    alone = (motion.filled > 0) & (motion.standing == 0)
    return np.where(scored, 0, np.where(alone, UNSCORED_SAMPLE, UNSCORED_STRETCH))


def inertia_warning(motion: Motion, fit: Fit, identified: Identified) -> str:
    """State why the external effort of a joint is not estimated."""
    name, model = f"{motion.log}/{motion.joint}", f"{fit.model}.{fit.estimator}"
    text = f"{name}: the inertia of {model} is not positive along this log, so its external effort is not estimated"
    friction = identified.is_friction(fit, motion.joint)
    if are_negative(fit.theta[friction], fit.theta_std[friction]):
        fitted = ", ".join(fit.logs)
        return f"{text}; its friction is negative, too: correct the `sign` of its effort or position in {fitted}"
    causes = "a wrong sign, other joints that move in the same logs, or terms that the model lacks"
    where = f"the report may name the cause beside all fits of {motion.joint}"
    return f"{text}; {where}: a motion that hardly excites it, {causes}"
