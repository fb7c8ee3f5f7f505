"""Smooth the motion of identification logs without delay, and differentiate it, as models are chosen and judged by."""

from collections.abc import Iterator

from pipeline.estimators.regression import measured_motion
from pipeline.maths.signals.noise import noise_std
from pipeline.records import Signal, Smoothed
from pipeline.study import LogEntry


def run(signal: Signal, entry: LogEntry, *, lowpass: float) -> Iterator[Smoothed]:
    """One Smoothed per joint of an identification log, of joints at rest, too: others may move about them."""
    if entry.role != "identification":
        return
    motion = measured_motion(signal, lowpass)
    q, dq, ddq = (x[:, 0] for x in (motion.q, motion.dq, motion.ddq))
    sigma_q, sigma_dq, sigma_tau = (
        noise_std(x, signal.segment, signal.rate, lowpass) for x in (signal.q, signal.dq, signal.tau)
    )
    yield Smoothed(
        log=signal.log, joint=signal.joint, rate=signal.rate, at_rest=signal.at_rest,
        sigma_q=sigma_q, sigma_dq=sigma_dq, sigma_tau=sigma_tau,
        t=signal.t, q=q, dq=dq, ddq=ddq, tau=signal.tau, segment=signal.segment,
    )  # fmt: skip
