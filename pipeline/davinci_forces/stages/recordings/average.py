"""Find the period of every identification log and average its periods."""

from collections.abc import Iterator, Sequence

import numpy as np

from davinci_forces.errors import NotPeriodic
from davinci_forces.maths.periods import averaging
from davinci_forces.maths.periods.agreement import Difference, alike, alternation, stretch
from davinci_forces.maths.periods.averaging import Folded, Phases, end, phases, whole_periods
from davinci_forces.maths.periods.period import Period, refine, standard_error
from davinci_forces.maths.periods.repetition import Repetition, repetition
from davinci_forces.maths.signals.smoothing import noise_std, segments, share_passed, smoothed
from davinci_forces.records import Average, Counts, Diagnostic, PeriodResidual, Signal, diagnostic
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

MISMATCH = 5e-4  # a stated period is wrong by more than this share when the data disagree with it
EXCLUDED = 4.0  # standard errors from the period found, beyond which the data exclude a stated one
TRIED = 5  # segments, the longest first, in which a repetition is looked for
SEEMING = (2, 3)  # times: a motion may all but repeat within its period
BRIEF = 0.1  # of a period: how much more is left out beside a stop, without a word about it
MEASURED = ("q", "dq", "tau")


def run(
    signals: Sequence[Signal], entry: LogEntry, robot: Robot, *, harmonics: int, lowpass: float
) -> Iterator[Average | PeriodResidual | Diagnostic]:
    """One period of each joint that moves, of the longest stretch that repeats; the joints of a log share both."""
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
    moving, found, remarks = repeating(moving, entry)
    if found is None:
        said = f"{lasting(moving[0], entry)}, so nothing is averaged"
        yield diagnostic("average", entry.name, "note", f"{said}; its parameters come from the low-passed samples")
        return
    span, length = longest(moving, found, orders, entry)
    names = [f"{symbol} of {signal.joint}" for signal in moving for symbol in MEASURED]
    columns = [getattr(signal, symbol) for signal in moving for symbol in MEASURED]
    positions = [signal.q for signal in moving]
    t, rate = moving[0].t, moving[0].rate
    kept, length, odd = alike(t, positions, columns, span, length, rate, orders)
    remarks += left_out(moving[0], span, kept, length, [(names[d.signal], d) for d in odd])
    std = standard_error(t[kept], [x[kept] for x in positions], length, orders)
    period, more = honoured(Period(length, std), entry)
    used = slice(kept.start, end(t, kept, period.length, rate))
    phased = Phases(t[used], period.length, phases(period.length, rate))
    for signal in moving:
        yield from averaged(signal, used, phased, period, entry.period or 0.0, lowpass)
    if remarks + more:
        yield diagnostic("average", entry.name, "warning", *remarks, *more)


def repeating(moving: list[Signal], entry: LogEntry) -> tuple[list[Signal], Repetition | None, list[str]]:
    """The joints that repeat, where and after how many samples they do so together, and what to say of the others.

    Raises
    ------
    NotPeriodic
        If no joint repeats, and the study states a period.
    """
    found = together(moving)
    alone = [signal for signal in moving if together([signal]) is not None] if found is None else moving
    found = together(alone) if found is None and alone else found
    if found is None and entry.period:
        raise NotPeriodic(
            f"{lasting(moving[0], entry)}; the study states {entry.period} s; record more periods, "
            "leave out what comes before and after them (skip and until in study.toml), or give the log another role"
        )
    if found is None:
        return moving, None, []
    out = [signal.joint for signal in moving if signal not in alone]
    return alone, found, [f"{entry.name}: {j} does not repeat, unlike the other joints, and is left out" for j in out]


def lasting(first: Signal, entry: LogEntry) -> str:
    """How long a log lasts without repeating."""
    return (
        f"{entry.name}: {first.t[-1] - first.t[0] + 1.0 / first.rate:.2f} s hold no motion that repeats at least twice"
    )


def together(signals: Sequence[Signal]) -> Repetition | None:
    """Where joints repeat together, in the longest segment in which they do."""
    parts = sorted(segments(signals[0].segment), key=lambda part: part.start - part.stop)
    for part in parts[:TRIED]:
        if found := repetition([signal.q[part] for signal in signals]):
            return found._replace(core=part.start + found.core)
    return None


def longest(signals: Sequence[Signal], found: Repetition, orders: int, entry: LogEntry) -> tuple[slice, float]:
    """The longest stretch around what was found that repeats with one period, and that period.

    Raises
    ------
    NotPeriodic
        If it holds fewer than two periods.
    """
    t, rate, positions = signals[0].t, signals[0].rate, [signal.q for signal in signals]
    core = slice(found.core, min(found.core + round(2 * found.lag), len(t)))
    span, length = stretch(t, positions, found.lag / rate, core, orders)
    t, positions = t[span], [x[span] for x in positions]
    k = alternation(t, positions, length, rate, multiples(length, entry.period, whole_periods(t, length, rate)))
    if k > 1:
        length = refine(t, positions, k * length, orders)
    if whole_periods(t, length, rate) < 2:
        raise NotPeriodic(
            f"{entry.name}: the motion repeats from {t[0]:.2f} to {t[-1]:.2f} s only, which is fewer than two periods "
            f"of {length:.4f} s; record more of them"
        )
    return span, length


def multiples(length: float, stated: float | None, M: int) -> list[int]:
    """By how much the period may be longer than it seems: what the study states first."""
    said = [round(stated / length)] if stated else []
    return [k for k in dict.fromkeys([*said, *SEEMING]) if 2 <= k <= M // 2]


def left_out(
    first: Signal, span: slice, kept: slice, length: float, odd: Sequence[tuple[str, Difference]]
) -> list[str]:
    """What does not repeat, or not as well as the rest, and what to write in the study so that it need not be said."""
    t = first.t
    sides = [f"the {t[kept.start] - t[0]:.2f} s before"] * (span.start > 0)
    sides += [f"the {t[-1] - t[kept.stop - 1]:.2f} s after"] * (span.stop < len(t))
    said = [f"{' and '.join(sides)} do not, as in a stop, a ramp or another motion{at_gaps(first, span)}"] * bool(sides)
    for name, d in odd:
        if d.inside or t[kept.start] - t[span.start] > BRIEF * length or not sides:
            differs = f"period {d.period + 1} of {d.periods} differs from the others by {d.rms:.3g} rms in {name}"
            what = ", and is kept, because it is not at an end" if d.inside else ", as in a transient"
            said.append(f"{differs}, {d.ratio:.1f} times what noise explains{what}")
    keys = [f"skip = {np.floor(t[kept.start] * 1e4 + 1e-3) / 1e4:.10g}"] * (kept.start > 0)
    keys += [f"until = {np.ceil(t[kept.stop - 1] * 1e4 - 1e-3) / 1e4:.10g}"] * (kept.stop < len(t))
    advice = f"; the rest is left out: write {' and '.join(keys)} in study.toml to say so" if keys else ""
    return [
        f"{first.log}: {t[kept.start]:.2f} to {t[kept.stop - 1]:.2f} s are evaluated, which repeat every "
        f"{length:.4f} s; {'; '.join(said)}{advice}"
    ] * bool(said)


def at_gaps(signal: Signal, span: slice) -> str:
    """That a stretch ends where the clock has a gap, if it does: the gap is then not as long as the clock says."""
    t, segment = signal.t, signal.segment
    edges = [i for i in (span.start, span.stop) if 0 < i < len(t) and segment[i] != segment[i - 1]]
    gaps = [f"{t[i] - t[i - 1]:.4g} s after {t[i - 1]:.2f} s" for i in edges]
    return f"; the motion is not where it should be after the clock's gap of {' and of '.join(gaps)}" if gaps else ""


def honoured(found: Period, entry: LogEntry) -> tuple[Period, list[str]]:
    """The stated period unless the data exclude it, with its standard error from them; what to say where they do."""
    stated = entry.period
    if not stated:
        return found, []
    off = abs(stated - found.length)
    if off <= EXCLUDED * found.std:
        return Period(stated, found.std), []
    if off <= MISMATCH * stated:
        return found, []
    return found, [
        f"{entry.name}: the study states a period of {stated} s, but the joints repeat every "
        f"{found.length:.4f} s (+- {found.std:.1g} s); the latter is used: "
        "correct the period in study.toml, or leave it out"
    ]


def averaged(
    signal: Signal, used: slice, phased: Phases, found: Period, stated: float, lowpass: float
) -> Iterator[Average | PeriodResidual]:
    """Fold one joint at the phases of a period, from the first sample used on."""
    size = float(np.sqrt(np.mean(smoothed(signal.tau, signal.segment, signal.rate, lowpass)[used] ** 2))) or 1.0
    tau = phased.fold(signal.tau[used])
    white = white_noise(tau, signal.segment[used], signal.rate, lowpass)
    q, dq = phased.fold(signal.q[used]), phased.fold(signal.dq[used])
    yield Average(
        log=signal.log,
        joint=signal.joint,
        rate=signal.rate,
        period=found.length,
        period_std=found.std,
        stated_period=stated,
        periods=whole_periods(phased.t, found.length, signal.rate),
        t_start=float(phased.t[0]),
        sigma_q=averaging.noise_std(q),
        sigma_dq=averaging.noise_std(dq),
        sigma_tau=averaging.noise_std(tau),
        sigma_tau_white=white,
        relative_noise=white * float(np.sqrt(share_passed(signal.rate, lowpass))) / size,
        t=np.arange(phased.K) / phased.K * found.length,
        q=q.mean,
        dq=dq.mean,
        tau=tau.mean,
        q_var=q.var,
        dq_var=dq.var,
        tau_var=tau.var,
        count=q.counts,
    )
    yield PeriodResidual(signal.log, signal.joint, t=phased.t, q_noise=q.noise, dq_noise=dq.noise, tau_noise=tau.noise)


def white_noise(folded: Folded, segment: Counts, rate: float, lowpass: float) -> float:
    """The standard deviation of noise that neither repeats nor is as slow as motion, with a degree spent per phase.

    A ripple of the drive is faster than the motion, too, but repeats; what differs with the motion is slower.
    """
    shrunk = float(np.sqrt(len(folded.noise) / averaging.degrees(folded)))
    return noise_std(folded.noise, segment, rate, lowpass) * shrunk
