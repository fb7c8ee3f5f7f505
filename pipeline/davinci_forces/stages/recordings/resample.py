"""Put every recording on a uniform clock, with its gaps marked, and low-pass and differentiate its motion."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from davinci_forces.errors import BadLog
from davinci_forces.maths.arrays import Booleans
from davinci_forces.maths.periods.harmonics import are_apart, even_step
from davinci_forces.maths.signals.clock import GAP
from davinci_forces.maths.signals.faults import saturated, stuck
from davinci_forces.maths.signals.smoothing import (
    measured_motion,
    noise_std,
    segments,
    share_passed,
    smoothed,
    white_std,
)
from davinci_forces.maths.signals.standstill import standing
from davinci_forces.maths.signals.windows import runs, unbroken
from davinci_forces.records import Column, Diagnostic, Motion, Recording, Signal, diagnostic
from davinci_forces.robots.robot import Joint

Indices = NDArray[np.intp]

EVEN = 0.02  # of a sampling time: clocks that stray less than this from a uniform one are taken as uniform
AT_REST = 0.01  # share of a joint's range, or of 1 rad or 1 m where it has no limits, below which it is at rest
SLOW = 5.0  # [Hz] below which a logged velocity is compared with that of the position
FAR = 20.0  # times its limits, beyond which no position of a joint is
AGREES = 0.1  # how far their ratio may be from 1
FEWEST = 4  # samples that a cubic spline needs; a shorter segment is left out
NAMED = 3  # stretches at most that a remark names


def run(recording: Recording, joint: Joint, *, lowpass: float) -> Iterator[Signal | Motion | Diagnostic]:
    """One Signal and one Motion per recording.  Gaps start a new segment; nothing is interpolated across one.

    Raises
    ------
    BadLog
        If no segment between gaps holds more than a few samples.
    """
    T_s = even_step(recording.t) or float(np.median(np.diff(recording.t)))
    whole = unbroken(recording.t, GAP * T_s)
    cuts = [part.start for part in whole[1:]]
    parts = [part for part in whole if part.stop - part.start >= FEWEST]
    if not parts:
        raise BadLog(f"{recording.log}/{recording.joint}: no segment without a gap holds {FEWEST} samples")
    if all(is_even(recording.t[part], T_s) for part in parts):
        # The mean over the longest segment; a median would carry the rounding of the time stamps.
        T_s = step_of(max((recording.t[part] for part in parts), key=len))
        method, columns = "as recorded", [as_recorded(recording, part) for part in parts]
    else:
        method = "cubic spline through the samples of each segment"
        columns = [on_uniform_clock(recording, part, T_s) for part in parts]
    segment = np.repeat(np.arange(len(parts)), [len(t) for t, *_ in columns])
    t, q, dq, tau = (np.concatenate(column) if len(parts) > 1 else column[0] for column in zip(*columns, strict=True))
    smooth = measured_motion(q, None if recording.velocity == "derived" else dq, segment, 1.0 / T_s, lowpass)
    if recording.velocity == "derived":
        dq = smooth[1]
    at_rest = not moves(q, joint)
    signal = Signal(
        log=recording.log,
        joint=recording.joint,
        role=recording.role,
        rate=1.0 / T_s,
        method=method,
        velocity=recording.velocity,
        gaps=len(parts) - 1,
        at_rest=int(at_rest),
        t=t,
        q=q,
        dq=dq,
        tau=tau,
        segment=segment,
    )
    yield signal
    motion = without_noise(signal, smooth, lowpass)
    yield motion
    yield from remarks(recording, method, cuts, sum(part.stop - part.start for part in parts))
    if recording.role == "identification" and not at_rest and motion.standing.any():
        yield diagnostic("resample", f"{recording.log}.{recording.joint}", "note", standstill(motion))
    wrong = [] if at_rest else [*disagreement(recording, q, dq, segment, 1.0 / T_s), *faults(recording, joint)]
    if wrong:
        yield diagnostic("resample", f"{recording.log}.{recording.joint}", "warning", *wrong)


def moves(q: Column, joint: Joint) -> bool:
    """Whether a joint moves enough to say anything about its dynamics."""
    low, high = joint.limits.q
    # Percentiles, so that a single glitch of an encoder does not set a joint at rest moving.
    reach = float(np.subtract(*np.percentile(q, [99.0, 1.0])))
    return reach > AT_REST * (high - low if np.isfinite(high - low) else 1.0)


def derived(q: Column, segment: Indices, rate: float, cutoff: float) -> Column:
    """The velocity (N,) of a low-passed position (N,), segment by segment."""
    slow = smoothed(q, segment, rate, cutoff)
    return np.concatenate([np.gradient(slow[part], 1.0 / rate) for part in segments(segment)])


def without_noise(signal: Signal, smooth: tuple[Column, Column, Column], lowpass: float) -> Motion:
    """The Motion of a joint, at rest, too: others may move about it; the noise is what the low-pass takes out."""
    q, dq, ddq = smooth
    passed, rate, segment = share_passed(signal.rate, lowpass), signal.rate, signal.segment
    sigma_q = white_std(signal.q - q, passed)
    logged = signal.velocity == "logged"
    still = standing(q, dq, segment, rate, sigma_q * float(np.sqrt(passed)), round(rate / lowpass))
    return Motion(
        log=signal.log, joint=signal.joint, role=signal.role, rate=rate, velocity=signal.velocity,
        cutoff=lowpass, effort_lag=0.0, at_rest=signal.at_rest, sigma_q=sigma_q,
        sigma_dq=white_std(signal.dq - dq, passed) if logged else noise_std(dq, segment, rate, lowpass),
        sigma_tau=noise_std(signal.tau, segment, rate, lowpass),
        t=signal.t, q=q, dq=dq, ddq=ddq, q_measured=signal.q, dq_measured=signal.dq, tau=signal.tau, segment=segment,
        standing=still.astype(np.int64),
    )  # fmt: skip


def disagreement(recording: Recording, q: Column, dq: Column, segment: Indices, rate: float) -> list[str]:
    """Whether a logged velocity is that of the logged position, judged where both are slow enough to compare."""
    if recording.velocity == "derived":
        return []
    cutoff = min(SLOW, 0.1 * rate)
    expected, logged = derived(q, segment, rate, cutoff), smoothed(dq, segment, rate, cutoff)
    slope = float(expected @ logged / (expected @ expected))
    if abs(slope - 1) < AGREES:
        return []
    return [
        f"{recording.log}/{recording.joint}: the logged velocity is {slope:.3g} times that of the logged position; "
        "check the sign, unit or column of either, and the rate of the clock"
    ]


def faults(recording: Recording, joint: Joint) -> Iterator[str]:
    """What the recording shows of a sensor that was stuck, a drive at its limit, or a unit that is not as stated."""
    name, far = f"{recording.log}/{recording.joint}", max(map(abs, joint.limits.q))
    for one in stuck(recording.t, recording.q):
        yield (
            f"{name}: the position stands still from {one.start:.3f} to {one.end:.3f} s and then jumps by "
            f"{one.jump:.3g}, as of a sensor that was stuck; leave that out by `skip` and `until`, or record it again"
        )
    if samples := saturated(recording.tau):
        yield (
            f"{name}: the effort is exactly at its largest or least value in {samples} samples: the drive, or what "
            "measures it, was saturated, and more was asked of the joint than the log says; record with less effort"
        )
    size = np.abs(recording.q)
    if size.max() > FAR * far and (reach := float(np.percentile(size, 99.0))) > FAR * far:
        said = f"{name}: positions reach {reach:.3g}, {reach / far:.0f} times the joint's limits"
        yield f"{said}; check the unit of the position"


def is_even(t: Column, T_s: float) -> bool:
    """Whether a segment runs on a uniform clock of its own, to a fraction of a sampling time."""
    return are_apart(t, step_of(t), EVEN * T_s / step_of(t))


def step_of(t: Column) -> float:
    """The mean time between samples."""
    return float((t[-1] - t[0]) / (len(t) - 1))


def uniform(t: Column, T_s: float) -> Column:
    """A uniform clock from the first sample of a segment, no further than its last."""
    steps = int(np.floor((t[-1] - t[0]) / T_s * (1 + 1e-12)))
    return np.asarray(t[0] + T_s * np.arange(steps + 1))


def as_recorded(recording: Recording, part: slice) -> tuple[Column, ...]:
    """Time, position, velocity and effort of one segment, in the memory of the recording."""
    return recording.t[part], recording.q[part], recording.dq[part], recording.tau[part]


def on_uniform_clock(recording: Recording, part: slice, T_s: float) -> tuple[Column, ...]:
    """Time, position, velocity and effort of one segment on a uniform clock."""
    from scipy.interpolate import make_interp_spline

    t, *columns = as_recorded(recording, part)
    clock = uniform(t, T_s)
    return clock, *np.ascontiguousarray(make_interp_spline(t, np.column_stack(columns), k=3)(clock).T)


def remarks(recording: Recording, method: str, cuts: list[int], kept: int) -> Iterator[Diagnostic]:
    """What was done to the clock, where anything was."""
    name, said = f"{recording.log}/{recording.joint}", []
    if len(cuts):
        where = ", ".join(f"{recording.t[c - 1]:.3f} s" for c in cuts[:5])
        said.append(f"{name}: {len(cuts)} gaps, not bridged, after {where}{' ...' if len(cuts) > 5 else ''}")
    if kept < len(recording):
        said.append(f"{name}: {len(recording) - kept} samples in segments of fewer than {FEWEST} were left out")
    if method != "as recorded":
        said.append(f"{name}: the clock is uneven, so the samples were put on a uniform one: {method}")
    if said:
        yield diagnostic("resample", f"{recording.log}.{recording.joint}", "note", *said)


def standstill(motion: Motion) -> str:
    """When a joint stands still, and what follows from that."""
    still: Booleans = motion.standing > 0
    parts = [f"{motion.t[part][0]:.2f} to {motion.t[part][-1]:.2f} s" for part in runs(still)]
    where = ", ".join(parts[:NAMED]) + (f" and {len(parts) - NAMED} times more" if len(parts) > NAMED else "")
    share = f"{100.0 * float(still.mean()):.2g} % of the log"
    why = "friction takes any value there, so no model is fitted to its effort then, nor judged by it"
    return f"{motion.log}/{motion.joint}: it stands still from {where}, {share}; {why}"
