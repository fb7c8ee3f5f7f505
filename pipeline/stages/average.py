"""Find the period of every identification log and average its periods."""

from collections.abc import Iterator, Sequence

import numpy as np

from pipeline.errors import NotPeriodic
from pipeline.maths.signals import averaging, period
from pipeline.maths.signals.averaging import Folded
from pipeline.maths.signals.smoothing import segments
from pipeline.records import Average, Column, Diagnostic, PeriodResidual, Signal, diagnostic
from pipeline.robots.robot import Robot
from pipeline.study import LogEntry

DIFFERS = 0.01  # of the motion's standard deviation: a smaller difference between periods is not worth a remark
ODD = 2.0  # times the usual difference from the mean: a period that differs by more stands out
MISMATCH = 5e-4  # a stated period is wrong by more than this share when the data disagree with it


def run(
    signals: Sequence[Signal], entry: LogEntry, robot: Robot, *, harmonics: int
) -> Iterator[Average | PeriodResidual | Diagnostic]:
    """One period of each joint that moves; the joints of a log share the period."""
    if entry.role != "identification":
        return
    moving = [signal for signal in signals if not signal.at_rest]
    at_rest = [signal.joint for signal in signals if signal.at_rest]
    if at_rest:
        yield diagnostic(
            "average", entry.name, "note", *(f"{entry.name}: {j} does not move: at rest, and left out" for j in at_rest)
        )
    if not moving:
        raise NotPeriodic(
            f"{entry.name}: no joint moves, so there is nothing to identify; check its channels and units"
        )
    orders = max(harmonics or robot.joint(signal.joint).harmonics for signal in moving)
    moving, guess, remarks = repeating(moving, entry)
    if guess is None and not entry.period:
        seconds = moving[0].t[-1] - moving[0].t[0] + 1.0 / moving[0].rate
        said = f"{entry.name}: {seconds:.2f} s hold no motion that repeats at least twice, so nothing is averaged"
        yield diagnostic("average", entry.name, "note", f"{said}; its parameters come from the low-passed samples")
        return
    found, more = shared_period(moving, guess, entry, orders)
    remarks += more
    for signal in moving:
        for record in averaged(signal, found, entry.period or 0.0):
            yield record
            if isinstance(record, PeriodResidual):
                remarks += odd_period(record, signal, found.length)
    if remarks:
        yield diagnostic("average", entry.name, "warning", *remarks)


def repeating(moving: list[Signal], entry: LogEntry) -> tuple[list[Signal], float | None, list[str]]:
    """The joints that repeat, after how many samples they do so together, and what there is to say of the others."""
    guess = guessed(moving)
    alone = [signal for signal in moving if guessed([signal]) is not None] if guess is None else []
    if not alone:
        return moving, guess, []
    out = [signal.joint for signal in moving if signal not in alone]
    said = [f"{entry.name}: {joint} does not repeat, unlike the other joints, and is left out" for joint in out]
    return alone, guessed(alone), said


def guessed(signals: Sequence[Signal]) -> float | None:
    """The shortest lag [samples] after which joints repeat together, or None where they do not."""
    return period.guess([signal.q[longest(signal)] for signal in signals])


def longest(signal: Signal) -> slice:
    """The longest segment without a gap."""
    return max(segments(signal.segment), key=lambda s: s.stop - s.start)


def odd_period(noise: PeriodResidual, signal: Signal, length: float) -> list[str]:
    """Whether one of the periods differs from the others, as a transient at the start or a stop at the end does."""
    number = ((noise.t - noise.t[0]) / length + 1e-9).astype(int)
    size = np.sqrt(np.bincount(number, noise.q_noise**2) / np.maximum(np.bincount(number), 1))
    worst, usual = int(size.argmax()), float(np.median(size))
    if size[worst] < DIFFERS * float(signal.q.std()) or (len(size) > 2 and size[worst] < ODD * usual):
        return []
    which = f"period {worst + 1} of {len(size)}" if len(size) > 2 else "the periods"
    return [
        f"{noise.log}/{noise.joint}: {which} differs from the mean by {size[worst]:.3g} rms, "
        f"{size[worst] / signal.q.std():.1%} of the motion: skip a transient at the start (skip = ... in study.toml), "
        "or cut off a stop at the end"
    ]


def shared_period(
    signals: Sequence[Signal], guess: float | None, entry: LogEntry, harmonics: int
) -> tuple[period.Period, list[str]]:
    """The period that all moving joints repeat with, and what there is to say about the one the study states.

    Raises
    ------
    NotPeriodic
        If the joints do not repeat, or fewer than two periods were recorded.
    """
    first = signals[0]
    seconds = first.t[-1] - first.t[0] + 1.0 / first.rate
    if guess is None:
        stated = f"; the study states {entry.period} s" if entry.period else ""
        raise NotPeriodic(
            f"{entry.name}: {seconds:.2f} s hold no motion that repeats at least twice{stated}; record more periods, "
            "skip the transient at the start, or give the log another role"
        )
    remarks = []
    found = period.refine(first.t - first.t[0], [signal.q for signal in signals], guess / first.rate, harmonics)
    if entry.period and abs(entry.period - found.length) > max(MISMATCH * entry.period, 5 * found.std):
        remarks.append(
            f"{entry.name}: the study states a period of {entry.period} s, but the joints repeat every "
            f"{found.length:.4f} s (+- {found.std:.1g} s); the latter is used: "
            "correct the period in study.toml, or leave it out"
        )
    if averaging.whole_periods(first.t, found.length, first.rate) < 2:
        raise NotPeriodic(f"{entry.name}: {seconds:.2f} s hold fewer than two periods of {found.length:.4f} s")
    return found, remarks


def averaged(signal: Signal, found: period.Period, stated: float) -> Iterator[Average | PeriodResidual]:
    """Fold one joint at a period."""
    K = averaging.phases(found.length, signal.rate)
    M = averaging.whole_periods(signal.t, found.length, signal.rate)
    used = signal.t - signal.t[0] < M * found.length - 0.5 / signal.rate
    t = signal.t[used]

    def folded(x: Column) -> Folded:
        return averaging.fold(t, x[used], found.length, K)

    q, dq, tau = folded(signal.q), folded(signal.dq), folded(signal.tau)
    yield Average(
        log=signal.log,
        joint=signal.joint,
        rate=signal.rate,
        period=found.length,
        period_std=found.std,
        stated_period=stated,
        periods=M,
        sigma_q=averaging.noise_std(q),
        sigma_dq=averaging.noise_std(dq),
        sigma_tau=averaging.noise_std(tau),
        t=np.arange(K) / K * found.length,
        q=q.mean,
        dq=dq.mean,
        tau=tau.mean,
        q_var=q.var,
        dq_var=dq.var,
        tau_var=tau.var,
        count=q.counts,
    )
    yield PeriodResidual(signal.log, signal.joint, t=t, q_noise=q.noise, dq_noise=dq.noise, tau_noise=tau.noise)
