"""The model of each joint along a log, as a filter takes it, and the effort that a fit predicts along the log."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from davinci_forces.identification.regression import joined_motion, motion_at
from davinci_forces.identification.used import Identified
from davinci_forces.maths.arrays import BLOCK_SAMPLES, Array, Booleans
from davinci_forces.maths.models.memory import efforts, pieces
from davinci_forces.maths.models.model import ArmMotion, JointDynamics
from davinci_forces.maths.signals.smoothing import delay_segments
from davinci_forces.records import Fit, JointModel, Motion, Prediction
from davinci_forces.records.prediction import CHOSEN
from davinci_forces.robots.models import ARM

# Fields of a record with the coefficients of the bias, in the order of `maths.models.bias`.
BIAS = ("constant", "gravity_sine", "gravity_cosine", "spring", "viscous", "coulomb", "presliding")
MIN_SINGULAR_SHARE = 1e-3  # combinations with a smaller share of the largest singular value are not refitted


class LogModels:
    """The models of fits along one log; results that the joints of an arm share are computed once.

    A model gets the motion through the low-pass of its fit, and delayed by the lag of the effort.
    """

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
        if joint in self._motions and self._motions[joint][0] != processing:
            del self._motions[joint]
        if joint not in self._motions:
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
        tau_hat = self._efforts.get(key)
        if tau_hat is None:
            tau_hat = efforts(model, fit.theta, self.motion(fit, joint))
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
        unknown: dict[str, Any] = {
            "scheme": "", "path_unseen": "", "tau_hat_unseen": np.broadcast_to(np.nan, len(model))
        }  # fmt: skip
        return JointModel.like(model, **self.fields_of(fit, model.joint), **unknown)


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
