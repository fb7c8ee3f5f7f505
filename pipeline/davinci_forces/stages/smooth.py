"""Smooth the motion of identification logs without delay, and differentiate it, as models are chosen and judged by."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.identification.regression import measured_motion
from davinci_forces.maths.arrays import Booleans
from davinci_forces.maths.signals.noise import noise_std
from davinci_forces.maths.signals.smoothing import share_passed
from davinci_forces.maths.signals.standstill import standing
from davinci_forces.maths.signals.windows import runs
from davinci_forces.records import Diagnostic, Signal, Smoothed, diagnostic
from davinci_forces.study import LogEntry

NAMED = 3  # stretches at most that a remark names


def run(signal: Signal, entry: LogEntry, *, lowpass: float) -> Iterator[Smoothed | Diagnostic]:
    """One Smoothed per joint of an identification log, of joints at rest, too: others may move about them."""
    if entry.role != "identification":
        return
    motion = measured_motion(signal, lowpass)
    q, dq, ddq = (x[:, 0] for x in (motion.q, motion.dq, motion.ddq))
    sigma_q, sigma_dq, sigma_tau = (
        noise_std(x, signal.segment, signal.rate, lowpass) for x in (signal.q, signal.dq, signal.tau)
    )
    q_std = sigma_q * float(np.sqrt(share_passed(signal.rate, lowpass)))
    still = standing(q, dq, signal.segment, signal.rate, q_std, round(signal.rate / lowpass))
    yield Smoothed(
        log=signal.log, joint=signal.joint, rate=signal.rate, at_rest=signal.at_rest,
        sigma_q=sigma_q, sigma_dq=sigma_dq, sigma_tau=sigma_tau,
        t=signal.t, q=q, dq=dq, ddq=ddq, tau=signal.tau, segment=signal.segment, standing=still.astype(np.int64),
    )  # fmt: skip
    if still.any() and not signal.at_rest:
        yield diagnostic("smooth", f"{signal.log}.{signal.joint}", "note", said(signal, still))


def said(signal: Signal, still: Booleans) -> str:
    """When a joint stands still (N,), and what follows from that."""
    parts = [f"{signal.t[part][0]:.2f} to {signal.t[part][-1]:.2f} s" for part in runs(still)]
    where = ", ".join(parts[:NAMED]) + (f" and {len(parts) - NAMED} times more" if len(parts) > NAMED else "")
    share = f"{100.0 * float(still.mean()):.2g} % of the log"
    why = "friction takes any value there, so no model is fitted to its effort then, nor judged by it"
    return f"{signal.log}/{signal.joint}: it stands still from {where}, {share}; {why}"
