"""Calibrate the error band of the external effort on the free motion of logs that no fit has used."""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.filters import DEFAULT, diverges, filter_parts
from davinci_forces.filters.problem import filter_inputs
from davinci_forces.filters.response import lag, noise_model
from davinci_forces.maths.arrays import Booleans, evenly
from davinci_forces.maths.signals.windows import free_space
from davinci_forces.maths.uncertainty import bootstrap
from davinci_forces.maths.uncertainty.error_band import LOG_BLOCKS, cells
from davinci_forces.maths.uncertainty.error_band import MIN_LOGS_BAND as MIN_LOGS_BAND
from davinci_forces.records import ErrorBand, FilterNoise, FreeMotion, JointModel
from davinci_forces.robots.robot import Joint
from davinci_forces.study import LogEntry

MIN_SAMPLES_BAND = 100  # of free motion
MAX_LOGS_BAND = 20


def run(
    model: JointModel, noise: FilterNoise | None, entry: LogEntry, joint: Joint, *, q_tau: float
) -> Iterator[FreeMotion]:
    """Compute the filter's error of a moving joint outside of contacts.

    In an identification log, the model comes from refits that left out the predicted samples.
    """
    if not entry.has_known_free_motion or model.at_rest or noise is None or not model.scheme:
        return
    free = free_space(model.t, entry.contact, model.rate)
    if int(free.sum()) < MIN_SAMPLES_BAND:
        return
    filter_noise = noise_model(noise, joint, 1.0 / model.rate, q_tau)
    parts = filter_inputs(model, np.where(np.isnan(model.tau_hat_unseen), model.tau_hat, model.tau_hat_unseen))
    estimate = filter_parts(DEFAULT, parts, filter_noise)
    if diverges(estimate):
        return
    late = lag(parts, filter_noise)[1]
    _, block, speed_bin, count, mean_square, filter_square, _ = cells(
        estimate.tau_ext[free], (estimate.tau_ext_std**2 + late**2)[free], model.dq_measured[free], noise.speed
    )
    yield FreeMotion(
        log=model.log, joint=model.joint, path=model.path_unseen, scheme=model.scheme, tested=int(free.sum()),
        free_mean=float(estimate.tau_ext[free].mean()), block=block, speed_bin=speed_bin, count=count,
        mean_square=mean_square, filter_square=filter_square,
    )  # fmt: skip


def gather(motions: Iterable[FreeMotion], noises: Iterable[FilterNoise]) -> Iterator[ErrorBand]:
    """Collect the out-of-sample model error of all logs, one error band per joint."""
    speeds = {noise.joint: noise.speed for noise in noises}
    by_joint: dict[str, list[FreeMotion]] = {}
    for motion in motions:
        by_joint.setdefault(motion.joint, []).append(motion)
    for joint, joint_motions in by_joint.items():
        spread = [joint_motions[i] for i in evenly(len(joint_motions), MAX_LOGS_BAND)]
        yield band(joint, spread, speeds[joint])


def band(joint: str, motions: list[FreeMotion], speed: float) -> ErrorBand:
    """The error band of a joint: the cells of all its logs, one log after the other."""
    names = ("block", "speed_bin", "count", "mean_square", "filter_square")
    columns = {name: np.concatenate([getattr(motion, name) for motion in motions]) for name in names}
    lengths = [len(motion) for motion in motions]
    logs = np.repeat(np.arange(len(motions)), lengths)
    parts = logs if len(motions) >= MIN_LOGS_BAND else logs * LOG_BLOCKS + columns["block"]
    return ErrorBand(
        joint=joint,
        speed=speed,
        band_rms=rms(columns, np.ones(len(logs), np.bool_)),
        band_rms_std=float(bootstrap.jackknife_std(lambda which: np.array([rms(columns, which)]), parts)[0]),
        source=np.repeat(np.array([motion.log for motion in motions], object), lengths),
        path_of=np.repeat(np.array([motion.path for motion in motions], object), lengths),
        log_mean=np.repeat([motion.free_mean for motion in motions], lengths),
        **columns,
    )


def rms(columns: dict[str, np.ndarray], which: Booleans) -> float:
    """Root mean square of some cells, with equal weight per sample."""
    return float(np.sqrt(np.average(columns["mean_square"][which], weights=columns["count"][which])))
