"""The fits of a robot's joints, and the model of each joint along a log, as a filter takes it, by the fit in use."""

from collections.abc import Collection, Iterable
from typing import Any

import numpy as np

from davinci_forces.errors import PipelineError
from davinci_forces.identification.regression import joined_motion, motion_at
from davinci_forces.maths.arrays import BLOCK_SAMPLES, Array, Booleans
from davinci_forces.maths.models.memory import efforts, pieces
from davinci_forces.maths.models.model import ArmMotion, JointDynamics, Model
from davinci_forces.maths.periods.shift import SAME_PATH as LIKE
from davinci_forces.maths.periods.shift import likeness
from davinci_forces.maths.signals.smoothing import delay_segments, segments
from davinci_forces.maths.signals.standstill import speed_of
from davinci_forces.records import Choice, Fit, FittedPaths, JointModel, Motion, Prediction
from davinci_forces.records.prediction import ANOTHER_PATH, BIAS, CHOSEN, SAME_PATH
from davinci_forces.robots.models import ARM, model_of
from davinci_forces.robots.robot import Robot

FALLBACK = "independent.lse"  # for joints that the chosen model does not cover
STATIC_FRICTION = ("Coulomb friction", "Stribeck friction")  # parameters that add up at standstill
OUTSIDE_MARGIN = 0.05  # of the fitted range of positions, on either side
MIN_SINGULAR_SHARE = 1e-3  # combinations with a smaller share of the largest singular value are not refitted


class Identified:
    """The fits of a robot's joints, chosen models and fitted paths, of those records that a stage has read."""

    def __init__(self, robot: Robot, records: Iterable[Fit | Choice | FittedPaths]) -> None:
        records = list(records)
        self.robot, self._models = robot, dict[tuple[str, ...], Model]()
        self.fits = [r for r in records if isinstance(r, Fit)]
        self._choices = [r for r in records if isinstance(r, Choice)]
        self._paths = {r.joint: r for r in records if isinstance(r, FittedPaths)}

    def model(self, fit: Fit) -> Model:
        """Return the model of a fit."""
        if fit.key not in self._models:
            scales, names = fit.scale.tolist(), [str(name) for name in fit.parameter]
            self._models[fit.key] = model_of(self.robot, fit.structure, fit.model, fit.group, names, scales)
        return self._models[fit.key]

    def cutoff_and_lag(self, fit: Fit, joint: str) -> tuple[float, float]:
        """Return the cutoff [Hz] of a fit's motion and the lag [s] of the effort, for the effort of a joint."""
        i = self.model(fit).efforts.index(joint)
        return fit.cutoff[i], fit.effort_lag[i]

    def is_friction(self, fit: Fit, joint: str) -> Booleans:
        """Select the parameters (p,) of a joint's friction that are efforts and add up at standstill."""
        suffix = f" of {joint}" if len(self.model(fit).efforts) > 1 else ""
        effort = self.robot.joint(joint).unit("{effort}")
        pairs = zip(map(str, fit.parameter), map(str, fit.unit), strict=True)
        adds_up = (name.startswith(STATIC_FRICTION) and name.endswith(suffix) and u == effort for name, u in pairs)
        return np.fromiter(adds_up, np.bool_)

    def static_friction(self, fit: Fit, joint: str) -> float:
        """Return the largest friction of a joint at standstill: its friction parameters that are efforts, unsigned."""
        return float(np.abs(fit.theta[self.is_friction(fit, joint)]).sum())

    def fits_of(self, joint: str) -> list[Fit]:
        """Return the fits of a joint's effort: its own, and those of its arm."""
        return [f for f in self.fits if f.group == joint or (f.group == ARM and joint in self.model(f).efforts)]

    def fit_of(self, joint: str, setting: str) -> Fit | None:
        """Return the fit named by the setting `fit`, or `FALLBACK` if the chosen model does not cover the joint."""
        by_name = {f"{f.model}.{f.estimator}": f for f in self.fits_of(joint)}
        if setting != CHOSEN:
            return by_name.get(setting)
        names = [f"{choice.model}.{choice.estimator}" for choice in self._choices if choice.group in (joint, ARM)]
        return next((by_name[name] for name in (*names, FALLBACK) if name in by_name), None)

    def stand_in(self, joint: str) -> Fit | None:
        """Return the physical fit of a joint by itself that cross-validation ranks first, or `FALLBACK` without any."""
        by_name = {f"{f.model}.{f.estimator}": f for f in self.fits_of(joint) if f.structure == "independent"}
        ranked = sorted(
            (score, str(variant))
            for choice in self._choices if choice.group in (joint, ARM)
            for score, variant, physical in zip(choice.score, choice.variant, choice.physical, strict=True) if physical
        )  # fmt: skip
        names = (f"{variant}.{estimator}" for _, variant in ranked for estimator in ("lse", "ridge"))
        return next((by_name[name] for name in (*names, FALLBACK) if name in by_name), None)

    def fit_along(self, joint: str, setting: str, held: Collection[str]) -> tuple[Fit, str]:
        """Return the fit of a joint along a log with the joints `held`, and why it replaces the fit of the setting.

        Raises PipelineError if there is no fit of that name.
        """
        fit, stand_in = self.fit_of(joint, setting), self.stand_in(joint)
        if fit is None:
            names = ", ".join(f"{f.model}.{f.estimator}" for f in self.fits_of(joint))
            raise PipelineError(f"{joint}: there is no fit {setting!r}; set fit in [settings] to one of {names}")
        if stand_in is None or set(self.model(fit).joints) <= set(held):
            return fit, ""
        needs = f"the log does not hold the other joints that {fit.model}.{fit.estimator} needs"
        return stand_in, f"{needs}, so {stand_in.model}.{stand_in.estimator} is used; add their channels"

    def path(self, motion: Motion) -> str:
        """Return whether a recording follows a path fitted in other logs, as `SAME_PATH` or `ANOTHER_PATH`."""
        return SAME_PATH if self.path_new(motion) < 1.0 - LIKE**2 else ANOTHER_PATH

    def path_new(self, motion: Motion) -> float:
        """Return the share of a position's variance that no path of another log explains: 1 - r^2, r the likeness.

        It is 1 if no other log's path is known.
        """
        paths = self._paths.get(motion.joint)
        if paths is None:
            return 1.0
        part = max(segments(motion.segment), key=lambda s: s.stop - s.start)
        periods = dict(zip(paths.source.tolist(), paths.period.tolist(), strict=True))
        likenesses = [
            likeness(motion.t[part], motion.q_measured[part], paths.q[paths.source == log], period)
            for log, period in periods.items()
            if log != motion.log
        ]
        return 1.0 - max([0.0, *likenesses]) ** 2

    def speed_ratio(self, motion: Motion) -> float:
        """Return the speed of a recording over that of the fastest fitted log; NaN if no fitted path is known."""
        paths = self._paths.get(motion.joint)
        return speed_of(motion.dq) / paths.speed if paths is not None else np.nan

    def share_outside(self, motion: Motion) -> float:
        """Return the share of samples beyond the positions of all fitted paths, with a margin; NaN without any."""
        paths = self._paths.get(motion.joint)
        if paths is None:
            return np.nan
        low, high = float(paths.q.min()), float(paths.q.max())
        margin = OUTSIDE_MARGIN * (high - low)
        return float(np.mean((motion.q < low - margin) | (motion.q > high + margin)))


class LogModels:
    """The models of fits along one log, with the low-pass and lag of each; what joints share is computed once."""

    _motion_at = staticmethod(motion_at)

    def __init__(self, identified: Identified, motions: Iterable[Motion | JointModel]) -> None:
        self.identified = identified
        self._records = {motion.joint: motion for motion in motions}
        self._motions: dict[str, tuple[tuple[float, float], ArmMotion]] = {}  # each joint's last, as a log may be long
        self._efforts: dict[tuple[object, ...], Array] = {}
        self._dynamics: dict[tuple[object, ...], tuple[JointDynamics, ...]] = {}

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints in the log."""
        return tuple(self._records)

    def joints_on_clock(self, joint: str) -> set[str]:
        """Return the joints of the log that share the clock of a joint."""
        length = len(self._records[joint])
        return {name for name, record in self._records.items() if len(record) == length}

    def joint_motion(self, joint: str, processing: tuple[float, float]) -> ArmMotion:
        """Return the motion of one joint, low-passed at a cutoff [Hz] and delayed by a lag [s]."""
        if joint not in self._motions or self._motions[joint][0] != processing:
            self._motions.pop(joint, None)  # before the next one takes memory
            self._motions[joint] = processing, self._motion_at(self._records[joint], *processing)
        return self._motions[joint][1]

    def motion(self, fit: Fit, joint: str) -> ArmMotion:
        """Return the motion of the joints of a fit's model, for a joint's effort; the log must contain these joints."""
        processing = self.identified.cutoff_and_lag(fit, joint)
        return joined_motion([self.joint_motion(name, processing) for name in self.identified.model(fit).joints])

    def tau_hat(self, fit: Fit, joint: str) -> Array:
        """Compute the effort (N,) of a joint by a fit."""
        model = self.identified.model(fit)
        key = *fit.key, self.identified.cutoff_and_lag(fit, joint)
        tau_hat = self._efforts[key] if key in self._efforts else efforts(model, fit.theta, self.motion(fit, joint))
        if fit.group == ARM:
            self._efforts[key] = tau_hat
        return np.ascontiguousarray(tau_hat[:, model.efforts.index(joint)])

    def dynamics(self, fit: Fit, joint: str) -> JointDynamics:
        """Compute the dynamics of a joint by a fit, as a filter takes them.  (7.15), (7.16)"""
        model = self.identified.model(fit)
        key = *fit.key, self.identified.cutoff_and_lag(fit, joint)
        dynamics = self._dynamics.get(key) or model.joint_dynamics(fit.theta, self.motion(fit, joint))
        if fit.group == ARM:
            self._dynamics[key] = dynamics
        return dynamics[model.efforts.index(joint)]

    def fields_of(self, fit: Fit, joint: str) -> dict[str, Any]:
        """Return the fields of a JointModel that follow from a fit."""
        cutoff, effort_lag = self.identified.cutoff_and_lag(fit, joint)
        dynamics, record = self.dynamics(fit, joint), self._records[joint]
        motion = self.joint_motion(joint, (cutoff, effort_lag))
        delay = (effort_lag - record.effort_lag) * record.rate
        measured = ("q_measured", "dq_measured") if delay else ()  # else those of the record
        return {
            "model": fit.model, "estimator": fit.estimator, "inertia": dynamics.inertia, "tau_known": dynamics.known,
            "tau_hat": self.tau_hat(fit, joint), "cutoff": cutoff, "effort_lag": effort_lag,
            "q": motion.q[:, 0], "dq": motion.dq[:, 0], "ddq": motion.ddq[:, 0],
            "static_friction": self.identified.static_friction(fit, joint),
            **{name: delay_segments(getattr(record, name), record.segment, delay) for name in measured},
            **dict(zip(BIAS, map(float, dynamics.coefficients), strict=True)),
        }  # fmt: skip

    def with_fit(self, model: JointModel, fit: Fit) -> JointModel:
        """Return a joint's model by another fit, without predictions of unseen data."""
        fields, unknown = self.fields_of(fit, model.joint), np.broadcast_to(np.nan, len(model))
        return JointModel.like(model, **fields, scheme="", path_unseen="", tau_hat_unseen=unknown)


def refits_of(predictions: Iterable[Prediction], used: dict[str, Fit], setting: str) -> dict[str, Prediction]:
    """Return the out-of-sample prediction of each joint that belongs to the fit in use."""
    refits: dict[str, Prediction] = {}
    for prediction in predictions:
        fit = used.get(prediction.joint)
        wanted = (CHOSEN,) if setting == CHOSEN else (fit.model, fit.estimator) if fit else ()
        if fit and prediction.joint not in refits and (prediction.model, prediction.estimator)[: len(wanted)] == wanted:
            refits[prediction.joint] = prediction
    return refits


def at_samples(prediction: Prediction, motion: Motion) -> Array:
    """Return the predicted effort (N,) at the samples of a recording; NaN at those that are not predicted."""
    half = 0.5 / motion.rate
    at = np.minimum(np.searchsorted(prediction.t, motion.t - half), len(prediction) - 1)
    return np.where(np.abs(prediction.t[at] - motion.t) < half, prediction.tau_hat[at], np.nan)


def refit_effort(joint: JointModel, fit: Fit, along: LogModels, free: Booleans) -> Array:
    """Correct tau_hat (N,) of a fit by least squares on its residual along a joint's log, over the free samples (N,).

    Phi (theta + D d),    d = arg min |tau - tau_hat - Phi D d|,    D scales each column of Phi to length 1

    The equations of a long log are reduced to as many as unknowns, block by block: by Q' [Phi, tau - tau_hat] = R.
    """
    model = along.identified.model(fit)
    index, motion = model.efforts.index(joint.joint), along.motion(fit, joint.joint)
    tau_hat, blocks, equations = joint.tau_hat.copy(), list(pieces(model, motion, samples=BLOCK_SAMPLES)), []
    residual = joint.tau - tau_hat
    for block in blocks:
        regressor = model.regressor(block.motion)
        valid = free[block.place] & regressor.known
        rows = np.column_stack([regressor.Phi[valid, index], residual[block.place][valid]])
        equations.append(rows if len(blocks) == 1 else np.linalg.qr(rows, mode="r"))
    *columns, y = np.concatenate(equations).T
    Phi = np.column_stack(columns)
    length = np.linalg.norm(Phi, axis=0)
    scale = np.divide(1.0, length, out=np.zeros_like(length), where=length > 0)
    d, *_ = np.linalg.lstsq(Phi * scale, y, rcond=MIN_SINGULAR_SHARE)
    for block in blocks:
        tau_hat[block.place] += model.regressor(block.motion).Phi[:, index] @ (scale * d)
    return tau_hat
