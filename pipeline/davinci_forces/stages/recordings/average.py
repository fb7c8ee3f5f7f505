"""Find the period of every identification log and average its periods."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from davinci_forces.errors import NotPeriodic
from davinci_forces.maths.arrays import Integers
from davinci_forces.maths.periods import averaging
from davinci_forces.maths.periods.agreement import Difference, agreeing_stretch, multiple_of_period, stretch
from davinci_forces.maths.periods.averaging import Phases, end, phases, whole_periods
from davinci_forces.maths.periods.period import Period, refine, standard_error
from davinci_forces.maths.periods.repetition import Repetition, harmonics_of, repetition
from davinci_forces.maths.signals.smoothing import lowpass_segments, noise_std, segments, share_passed
from davinci_forces.maths.uncertainty.bootstrap import error_of_pooled_mean
from davinci_forces.records import Average, Diagnostic, PeriodResidual, Signal, diagnostic
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

MIN_MISMATCH = 5e-4  # relative difference above which a stated period may be reported as wrong
MIN_STANDARD_ERRORS = 4.0  # difference, in standard errors, above which the data exclude a stated period
MAX_SEGMENTS = 5  # a repetition is searched for in this many of the longest segments
MULTIPLES = (2, 3)  # multiples of the shortest period that are tried, since motion may almost repeat within a period
MIN_REPORTED_TRANSIENT = 0.1  # share of a period; a shorter transient after a standstill is not reported
MEASURED = ("q", "dq", "tau")


def run(
    signals: Sequence[Signal], entry: LogEntry, robot: Robot, *, harmonics: int, lowpass: float
) -> Iterator[Average | PeriodResidual | Diagnostic]:
    """Average the periods of each moving joint over the longest periodic stretch that all joints of a log share.

    Samples are narrowed in three steps.  In the `periodic` stretch the motion repeats.  In the `agreeing` stretch the
    periods do not differ.  Of that, whole periods of measured samples are `used`.
    """
    if entry.role != "identification":
        return
    moving = [signal for signal in signals if not signal.at_rest]
    at_rest = [signal.joint for signal in signals if signal.at_rest]
    if texts := [f"{entry.name}: {joint} does not move: at rest, and left out" for joint in at_rest]:
        yield diagnostic("average", entry.name, "note", *texts)
    if not moving:
        why = f"no joint moves of those that study.toml names, {', '.join(at_rest)}, so there is nothing to identify"
        remedy = "name the channels of the joint that moves, or check their units, and the clock"
        raise NotPeriodic(f"{entry.name}: {why}; {remedy}, of {signals[0].rate:.4g} Hz")
    least = max(harmonics or robot.joint(signal.joint).harmonics for signal in moving)
    moving, repeat, remarks = periodic_joints(moving, entry)
    if repeat is None:
        message = f"{no_repetition_message(moving[0], entry)}, so nothing is averaged"
        yield diagnostic("average", entry.name, "note", f"{message}; parameters are fitted to its low-passed samples")
        return
    max_harmonics = harmonics_of([signal.q for signal in moving], repeat, least)
    periodic, length = longest_stretch(moving, repeat, max_harmonics, entry)
    # A derived velocity says nothing that its position does not, and its low-pass errs at the ends of a recording.
    compared = [(x, symbol) for x in moving for symbol in MEASURED if symbol != "dq" or x.velocity == "logged"]
    names = [f"{symbol} of {signal.joint}" for signal, symbol in compared]
    columns = [getattr(signal, symbol) for signal, symbol in compared]
    positions = [signal.q for signal in moving]
    t, rate = moving[0].t, moving[0].rate
    agreeing, length, differing = agreeing_stretch(t, positions, columns, periodic, length, rate, max_harmonics)
    yield from omissions(moving[0], periodic, agreeing, length, [(names[d.signal], d) for d in differing])
    std = standard_error(t[agreeing], [x[agreeing] for x in positions], length, max_harmonics)
    period, period_remarks = reconcile_period(Period(length, std), entry)
    remarks += period_remarks
    filled = np.any([signal.filled for signal in moving], axis=0)
    start = agreeing.start + int(np.argmin(filled[agreeing]))  # the first sample that was measured, not filled in
    used = np.arange(start, end(t, slice(start, agreeing.stop), period.length, rate))
    used = used[~filled[used]]
    phased = Phases(t[used], period.length, phases(period.length, rate))
    for signal in moving:
        yield from average_joint(signal, used, phased, period, entry.period or 0.0, lowpass)
    if remarks:
        yield diagnostic("average", entry.name, "warning", *remarks)


def periodic_joints(moving: list[Signal], entry: LogEntry) -> tuple[list[Signal], Repetition | None, list[str]]:
    """The joints that repeat, their common repetition in samples, and a remark on each joint that does not.

    Raises NotPeriodic if no joint repeats, and the study states a period.
    """
    repeat, periodic = common_repetition(moving), moving
    if repeat is None:
        periodic = [signal for signal in moving if common_repetition([signal]) is not None]
        repeat = common_repetition(periodic) if periodic else None
    if repeat is None and entry.period:
        why = f"{no_repetition_message(moving[0], entry)}, but the study states a period of {entry.period} s"
        remedy = "record more periods, leave out what comes before and after them (skip and until in study.toml)"
        raise NotPeriodic(f"{why}; {remedy}, or give the log another role")
    if repeat is None:
        return moving, None, []
    aperiodic = [signal.joint for signal in moving if signal not in periodic]
    remarks = [f"{entry.name}: {j} does not repeat, unlike the other joints, and is left out" for j in aperiodic]
    return periodic, repeat, remarks


def no_repetition_message(first: Signal, entry: LogEntry) -> str:
    """Return the message that a log does not repeat, with its duration."""
    duration = first.t[-1] - first.t[0] + 1.0 / first.rate
    return f"{entry.name}: {duration:.2f} s contain no motion that repeats at least twice"


def common_repetition(signals: Sequence[Signal]) -> Repetition | None:
    """The repetition that joints share, in the longest segment with a repetition."""
    parts = sorted(segments(signals[0].segment), key=lambda part: part.start - part.stop)
    for part in parts[:MAX_SEGMENTS]:
        if repeat := repetition([signal.q[part] for signal in signals]):
            return Repetition(repeat.lag, *(part.start + i for i in repeat[1:]))
    return None


def longest_stretch(
    signals: Sequence[Signal], repeat: Repetition, max_harmonics: int, entry: LogEntry
) -> tuple[slice, float]:
    """The longest stretch around a repetition in which the period is constant, and the period.

    Raises NotPeriodic if the stretch has fewer than two periods.
    """
    t, rate, positions = signals[0].t, signals[0].rate, [signal.q for signal in signals]
    span, length = slice(0, 0), 0.0
    middle = max((repeat.start + repeat.stop) // 2 - round(repeat.lag), repeat.start)
    for start in (repeat.best_start, middle):  # the two periods that differ least may hold the slow part of a run-in
        two_periods = slice(start, min(start + round(2 * repeat.lag), len(t)))
        if two_periods.start < span.start or two_periods.stop > span.stop:
            other = stretch(t, positions, repeat.lag / rate, two_periods, max_harmonics)
            span, length = max((span, length), other, key=lambda each: each[0].stop - each[0].start)
    t, positions = t[span], [x[span] for x in positions]
    stated = [round(entry.period / length)] if entry.period else []  # the factor of the stated period is tried first
    most = whole_periods(t, length, rate) // 2
    factors = [k for k in dict.fromkeys([*stated, *MULTIPLES]) if 2 <= k <= most]
    factor = multiple_of_period(t, positions, length, rate, factors)
    if factor > 1:
        length = refine(t, positions, factor * length, max_harmonics)
    if whole_periods(t, length, rate) < 2:
        where = f"from {t[0]:.2f} to {t[-1]:.2f} s, fewer than two periods of {length:.4f} s"
        raise NotPeriodic(f"{entry.name}: the motion repeats only {where}; record more periods")
    return span, length


def omissions(
    first: Signal, periodic: slice, agreeing: slice, length: float, differing: Sequence[tuple[str, Difference]]
) -> Iterator[Diagnostic]:
    """Describe samples that do not repeat or repeat badly, what uses them, and the keys of study.toml that remove them.

    Times count from the log's first sample, as `skip` and `until` do.  Less than two periods at either end, as of a
    rest, a run-in, a transient or a stop, are expected, so they are a note.
    """
    t, gaps = first.t, gaps_at(first, periodic)
    first_time, last_time = t[periodic.start], t[periodic.stop - 1]
    sides = [f"the {first_time - t[0]:.2f} s before {first_time:.2f} s"] * (periodic.start > 0)
    sides += [f"the {t[-1] - last_time:.2f} s after {last_time:.2f} s"] * (periodic.stop < len(t))
    faults = [f"{' and '.join(sides)} do not repeat, as in a stop, a ramp or another motion{gaps}"] * bool(sides)
    for name, d in differing:
        inside = d.has_periods_on_both_sides
        long = t[agreeing.start] - first_time > MIN_REPORTED_TRANSIENT * length
        if inside or long or not sides:  # beside a standstill, a short transient is expected
            span = f"the period from {d.start:.2f} to {d.start + length:.2f} s"
            what = "and is kept, because it is not at an end" if inside else "as in a transient"
            size = f"in {name} by {d.ratio:.1f} times what noise explains"
            faults.append(f"{span} differs from the others {size}, {what}")
    keys = [f"skip = {np.floor(t[agreeing.start] * 1e4 + 1e-3) / 1e4:.10g}"] * (agreeing.start > 0)
    keys += [f"until = {np.ceil(t[agreeing.stop - 1] * 1e4 - 1e-3) / 1e4:.10g}"] * (agreeing.stop < len(t))
    start, whole = t[agreeing.start], whole_periods(t[agreeing], length, first.rate)
    used = f"Averages are of {whole} whole periods, {start:.2f} to {start + whole * length:.2f} s"
    rest = "; the chosen model is fitted to all motion. Only if something touched the arm in the rest, or the log is "
    remedy = f"faulty there, write {' and '.join(keys)} in study.toml: fits then leave the rest out"
    advice = rest + remedy if keys else ""
    short = max(t[agreeing.start] - t[0], t[-1] - t[agreeing.stop - 1]) < 2.0 * length
    expected = short and not gaps and not any(d.has_periods_on_both_sides for _, d in differing)
    if faults:
        repeats = f"{first.log}: joints repeat every {length:.4f} s"
        text = f"{repeats}; {'; '.join(faults)}. {used}{advice}"
        yield diagnostic("average", first.log, "note" if expected else "warning", text)


def gaps_at(signal: Signal, periodic: slice) -> str:
    """Report clock gaps at the ends of the periodic stretch, after which the phase of the motion is unexpected."""
    t, segment = signal.t, signal.segment
    edges = [i for i in (periodic.start, periodic.stop) if 0 < i < len(t) and segment[i] != segment[i - 1]]
    gaps = [f"{t[i] - t[i - 1]:.4g} s at {t[i - 1]:.2f} s" for i in edges]
    return f"; after the clock's gap of {' and of '.join(gaps)}, the motion does not continue in phase" if gaps else ""


def reconcile_period(estimate: Period, entry: LogEntry) -> tuple[Period, list[str]]:
    """The stated period, or the estimate if the data exclude the stated one, with a remark if they differ much.

    The standard error is that of the estimate.
    """
    stated = entry.period
    if not stated:
        return estimate, []
    difference = abs(stated - estimate.length)
    if difference <= MIN_STANDARD_ERRORS * estimate.std:
        return Period(stated, estimate.std), []
    if difference <= MIN_MISMATCH * stated:
        return estimate, []
    measured = f"{estimate.length:.4f} s (+- {estimate.std:.1g} s), which is used"
    what = f"{entry.name}: the study states a period of {stated} s, but the joints repeat every {measured}"
    return estimate, [f"{what}; correct the period in study.toml, or leave it out"]


def average_joint(
    signal: Signal, used: Integers, phased: Phases, period: Period, stated: float, lowpass: float
) -> Iterator[Average | PeriodResidual]:
    """Average one joint over its periods at each phase, from the first used sample on."""
    slow_tau = lowpass_segments(signal.tau, signal.segment, signal.rate, lowpass)
    rms_tau = float(np.sqrt(np.mean(slow_tau[used] ** 2))) or 1.0
    folded = {symbol: phased.fold(getattr(signal, symbol)[used]) for symbol in MEASURED}
    q, tau = folded["q"], folded["tau"]
    # Noise that does not repeat and is faster than the motion: a ripple of the drive is fast, too, but it repeats, and
    # errors that depend on the motion are slower.  The mean at each phase takes one degree of freedom.
    correction = float(np.sqrt(len(tau.noise) / averaging.degrees_of_freedom(tau)))
    white = noise_std(tau.noise, signal.segment[used], signal.rate, lowpass) * correction
    relative_noise = white * float(np.sqrt(share_passed(signal.rate, lowpass))) / rms_tau
    columns: dict[str, Any] = {}
    for symbol, x in folded.items():
        columns |= {symbol: x.mean, f"{symbol}_var": x.var, f"sigma_{symbol}": averaging.noise_std(x)}
        columns[f"sigma_{symbol}_std"] = error_of_pooled_mean(x.var, function=np.sqrt)
    yield Average.like(
        signal,
        period=period.length,
        period_std=period.std,
        stated_period=stated,
        periods=whole_periods(phased.t, period.length, signal.rate),
        t_start=float(phased.t[0]),
        sigma_tau_white=white,
        relative_noise=relative_noise,
        relative_noise_std=relative_noise / float(np.sqrt(2.0 * len(used))),  # the noise is white
        t=np.arange(phased.K) / phased.K * period.length,
        tau_alternating=averaging.alternating_mean(tau, phased),
        count=q.counts,
        **columns,
    )
    noise = {f"{symbol}_noise": x.noise for symbol, x in folded.items()}
    yield PeriodResidual(signal.log, signal.joint, t=phased.t, **noise)
