"""Calibrate the error band of the external effort on the free motion of logs that no fit has used."""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.filters import diverges, filter_parts
from davinci_forces.filters.problem import filter_inputs
from davinci_forces.filters.response import noise_model
from davinci_forces.maths.arrays import evenly
from davinci_forces.maths.signals.windows import MIN_FREE_SAMPLES, free_smoothed
from davinci_forces.maths.uncertainty.bootstrap import of_left_out, rms
from davinci_forces.maths.uncertainty.error_band import LOG_BLOCKS, MIN_LOGS_BAND, count_uncorrelated
from davinci_forces.records import ErrorBand, FilterNoise, FreeMotion, JointModel, by_name
from davinci_forces.records.forces import SMOOTHER
from davinci_forces.robots.robot import Joint
from davinci_forces.study import LogEntry

MAX_LOGS_BAND = 20
MAX_ROWS_BAND = 1000  # of a log, evenly spaced; fewer of them are uncorrelated


def run(
    model: JointModel, noise: FilterNoise | None, entry: LogEntry, joint: Joint, *, q_tau: float
) -> Iterator[FreeMotion]:
    """Compute the smoother's error of a moving joint outside of contacts and of standstill.

    In an identification log, the model comes from refits that left out the predicted samples.
    """
    if not entry.has_known_free_motion or model.at_rest or noise is None or not model.scheme:
        return
    free = free_smoothed(model.t, entry.possible_contact, model.rate, model.unscored)
    if int(free.sum()) < MIN_FREE_SAMPLES:
        return
    filter_noise = noise_model(noise, joint, 1.0 / model.rate, q_tau)
    parts = filter_inputs(model, np.where(np.isnan(model.tau_hat_unseen), model.tau_hat, model.tau_hat_unseen))
    estimate = filter_parts(SMOOTHER, parts, filter_noise, ("tau_ext", "tau_ext_std", "nis"))
    if diverges(estimate.tau_ext, float(np.mean(estimate.nis))):
        return
    samples = np.flatnonzero(free)
    rows = evenly(len(samples), MAX_ROWS_BAND)
    drawn, n = samples[rows], count_uncorrelated(estimate.tau_ext[free])
    yield FreeMotion(
        log=model.log, joint=model.joint, path=model.path_unseen, scheme=model.scheme, tested=len(samples),
        block=rows * LOG_BLOCKS // len(samples), dq=model.dq[drawn], tau_ext_smooth=estimate.tau_ext[drawn],
        tau_ext_std_filter=estimate.tau_ext_std[drawn], uncorrelated=np.full(len(drawn), n / len(drawn)),
    )  # fmt: skip


def gather(motions: Iterable[FreeMotion]) -> Iterator[ErrorBand]:
    """Collect the out-of-sample model error of all logs, one error band per joint, one log after the other."""
    names = ("block", "dq", "tau_ext_smooth", "tau_ext_std_filter", "uncorrelated")
    for joint, joint_motions in by_name(motions, "joint").items():
        used = [joint_motions[i] for i in evenly(len(joint_motions), MAX_LOGS_BAND)]
        columns = {name: np.concatenate([getattr(motion, name) for motion in used]) for name in names}
        lengths = [len(motion) for motion in used]
        logs = np.repeat(np.arange(len(used)), lengths)
        errors = columns["tau_ext_smooth"]
        parts = logs if len(used) >= MIN_LOGS_BAND else logs * LOG_BLOCKS + columns["block"]
        left_out = [[rms(errors[parts != number])] for number in np.unique(parts)]
        yield ErrorBand(
            joint=joint,
            band_rms=rms(errors),
            band_rms_std=float(of_left_out(np.array(left_out))[0]),
            source=np.repeat(np.array([motion.log for motion in used], object), lengths),
            path_of=np.repeat(np.array([motion.path for motion in used], object), lengths),
            **columns,
        )
