"""Resample every recording on a uniform clock, with its gaps marked, and low-pass and differentiate its motion."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from davinci_forces.errors import BadLog
from davinci_forces.maths.arrays import Booleans, runs
from davinci_forces.maths.periods.harmonics import are_apart, even_step
from davinci_forces.maths.signals import smoothing
from davinci_forces.maths.signals.clock import are_gaps, are_missing, longest_bridge
from davinci_forces.maths.signals.faults import count_saturated, find_stuck
from davinci_forces.maths.signals.standstill import is_standing_still, without_doubtful_signs
from davinci_forces.records import Column, Counts, Diagnostic, Motion, Recording, Signal, diagnostic
from davinci_forces.robots.robot import ANYWHERE, Joint, Kind

Indices = NDArray[np.intp]

EVEN = 0.02  # of a sampling time: a clock that deviates less than this from a uniform clock counts as uniform
MIN_MOTION = 0.01  # of a joint's range, or of 1 rad or 1 m without limits: a joint that moves less is at rest
VELOCITY_CUTOFF = 5.0  # [Hz] below which a logged velocity is compared with the derivative of the position
MAX_VELOCITY_ERROR = 0.1  # of the ratio of the two velocities
MAX_VELOCITY_RATIO = 5.0  # beyond it or below its inverse, the log contradicts itself, and is refused
MAX_BEYOND_LIMITS, IMPOSSIBLE = 2.0, 20.0  # as multiples of a joint's limits; a warning, and a refusal
OVER_LIMITS, FAR_OVER_LIMITS = 0.02, 0.25  # of the range between limits, above which an excess is noted, or warned of
USUAL_LIMITS = (2.0 * np.pi, 20.0)  # [rad or m, rad/s or m/s] limits of a joint that states none, only to warn
MIN_JUMP, MAX_USUAL = 0.5, 20.0  # of the range of a position, and of its usual steps: a longer step is a jump
UNIT_HINTS = (  # by the ratio of a logged velocity to the derivative of the position; mm only of joints that slide
    (180.0 / np.pi, 'is the velocity in deg/s? write unit = "deg/s" for its channel'),
    (np.pi / 180.0, 'is the position in degrees? write unit = "deg" for its channel'),
    (30.0 / np.pi, 'is the velocity in rpm? write unit = "rpm" for its channel'),
    (1e3, 'is the velocity in mm/s? write unit = "mm/s" for its channel, or correct the unit of the position'),
    (1e3, 'is the time in ms? write unit = "ms" for its channel'),
    (1e-3, 'is the position in mm? write unit = "mm" for its channel, or correct the unit of the velocity'),
    (-1.0, "is the sign of one opposite? write sign = -1 for its channel"),
)
MIN_SAMPLES_SEGMENT = 4  # for a cubic spline
MAX_LISTED_STRETCHES = 3  # in a remark


def run(recording: Recording, joint: Joint, *, lowpass: float) -> Iterator[Signal | Motion | Diagnostic]:
    """Make one Signal and one Motion of a recording.  A gap starts a new segment and is not interpolated across.

    Raises BadLog if no segment between gaps holds more than a few samples, velocity and position contradict each other,
    or the motion lies far beyond the joint's limits.
    """
    T_s = even_step(recording.t) or float(np.median(np.diff(recording.t)))
    cuts = (np.flatnonzero(are_gaps(recording.t, T_s)) + 1).tolist()
    whole = [slice(*edges) for edges in pairwise([0, *cuts, len(recording)])]
    parts = [part for part in whole if part.stop - part.start >= MIN_SAMPLES_SEGMENT]
    if not parts:
        why = f"no segment without a gap holds {MIN_SAMPLES_SEGMENT} of the {len(recording)} samples"
        raise BadLog(f"{recording.log}/{recording.joint}: {why}; record more, without gaps")
    steps = [step_of(recording.t[part]) for part in parts]
    if all(are_apart(recording.t[part], step, EVEN * T_s / step) for part, step in zip(parts, steps, strict=True)):
        # The mean over the longest segment; a median would carry the rounding of the time stamps.
        T_s = step_of(max((recording.t[part] for part in parts), key=len))
        method, columns = "as recorded", [as_recorded(recording, part) for part in parts]
    else:
        method = "cubic spline through the samples of each segment"
        columns = [on_uniform_clock(recording, part, T_s) for part in parts]
    segment = np.repeat(np.arange(len(parts)), [len(t) for t, *_ in columns])
    t, q, dq, tau, filled = (np.concatenate(c) if len(parts) > 1 else c[0] for c in zip(*columns, strict=True))
    smooth = smoothing.measured_motion(q, None if recording.velocity == "derived" else dq, segment, 1.0 / T_s, lowpass)
    if recording.velocity == "derived":
        dq = smooth[1]
    at_rest = not moves(q, joint)
    wrong = [*velocity_faults(recording, joint, q, dq, segment, 1.0 / T_s), *limit_faults(recording, joint, smooth)]
    signal = Signal.like(
        recording, rate=1.0 / T_s, method=method, gaps=len(parts) - 1, at_rest=int(at_rest), t=t, q=q, dq=dq, tau=tau,
        segment=segment, filled=filled,
    )  # fmt: skip
    motion = without_noise(signal, smooth, lowpass)
    if motion.standing.all() and not at_rest:  # nothing of it could be fitted
        at_rest, signal, motion = True, replace(signal, at_rest=1), replace(motion, at_rest=1)
    yield signal
    yield motion
    yield from beyond_limits(recording, joint, smooth)
    yield from remarks(signal, recording, T_s, cuts, sum(part.stop - part.start for part in parts))
    if recording.role not in ("tissue", "friction") and not at_rest and motion.standing.any():
        yield diagnostic("resample", f"{recording.log}.{recording.joint}", "note", standstill(motion))
    if wrong := [*wrong, *(() if at_rest else faults(recording))]:
        yield diagnostic("resample", f"{recording.log}.{recording.joint}", "warning", *wrong)


def moves(q: Column, joint: Joint) -> bool:
    """Whether a joint moves enough to reveal its dynamics."""
    low, high = joint.limits.q
    # With percentiles, a single glitch of an encoder does not make a joint at rest count as moving.
    reach = float(np.subtract(*np.percentile(q, [99.0, 1.0])))
    return reach > MIN_MOTION * (high - low if np.isfinite(high - low) else 1.0)


def without_noise(signal: Signal, smooth: tuple[Column, Column, Column], lowpass: float) -> Motion:
    """The Motion of a joint, also of one at rest, which other joints may drive; the low-pass removes its noise."""
    q, dq, ddq = smooth
    passed, rate, segment = smoothing.share_passed(signal.rate, lowpass), signal.rate, signal.segment
    sigma_q = smoothing.white_std(signal.q - q, passed)
    logged = signal.velocity == "logged"
    sigma_dq = (
        smoothing.white_std(signal.dq - dq, passed) if logged else smoothing.noise_std(dq, segment, rate, lowpass)
    )
    q_std, dq_std = sigma_q * float(np.sqrt(passed)), sigma_dq * float(np.sqrt(passed) if logged else 1.0)
    if signal.at_rest:
        dq, still = np.zeros_like(dq), np.ones(len(dq), np.bool_)
    else:
        still = is_standing_still(q, dq, segment, rate, q_std, round(rate / lowpass))
        dq = without_doubtful_signs(dq, still, q_std, dq_std)
    sigma_tau = smoothing.noise_std(signal.tau, segment, rate, lowpass)
    return Motion.like(
        signal, cutoff=lowpass, effort_lag=0.0, sigma_q=sigma_q, sigma_dq=sigma_dq, sigma_tau=sigma_tau, q=q, dq=dq,
        ddq=ddq, q_measured=signal.q, dq_measured=signal.dq, standing=still.astype(np.int64),
    )  # fmt: skip


def velocity_faults(
    recording: Recording, joint: Joint, q: Column, dq: Column, segment: Indices, rate: float
) -> Iterator[str]:
    """State where a logged velocity differs from the derivative of the logged position, both low-passed.

    Raises BadLog if one is several times the other.
    """
    if recording.velocity == "derived" or not (moves(q, joint) or moves(np.cumsum(dq - dq.mean()) / rate, joint)):
        return
    cutoff = min(VELOCITY_CUTOFF, 0.1 * rate)
    slow = smoothing.lowpass_segments(q, segment, rate, cutoff)
    derived = np.concatenate([np.gradient(slow[part], 1.0 / rate) for part in smoothing.segments(segment)])
    ratio = median_ratio(smoothing.lowpass_segments(dq, segment, rate, cutoff), derived)
    if abs(ratio - 1) < MAX_VELOCITY_ERROR:
        return
    hints = (hint for factor, hint in UNIT_HINTS if abs(ratio / factor - 1) < MAX_VELOCITY_ERROR)
    fitting = (hint for hint in hints if joint.kind is Kind.PRISMATIC or "mm" not in hint)
    hint = next(fitting, "check the sign, unit and column of both, and the rate of the clock")
    times = f"is {ratio:.3g} times the derivative of the logged position"
    what = times if ratio < np.inf else "is not 0 though the position stands still"
    fault = f"{recording.log}/{recording.joint}: the logged velocity {what}; {hint}"
    if not 1 / MAX_VELOCITY_RATIO < ratio < MAX_VELOCITY_RATIO:
        raise BadLog(f"{fault}; without the channel of the velocity, it is derived from the position")
    yield fault


def median_ratio(x: Column, reference: Column) -> float:
    """Median of x / reference (N,), weighted by the size of the reference; infinite if that is 0 throughout."""
    nonzero = np.abs(reference) > 1e-12 * np.abs(reference).max()
    ratio, weight = x[nonzero] / reference[nonzero], np.abs(reference[nonzero])
    order = np.argsort(ratio)
    half = np.searchsorted(np.cumsum(weight[order]), 0.5 * weight.sum())
    return float(ratio[order[half]]) if nonzero.any() else np.inf


def limit_faults(recording: Recording, joint: Joint, smooth: tuple[Column, Column, Column]) -> Iterator[str]:
    """State where low-passed positions and velocities lie beyond the joint's limits.

    Raises BadLog if they lie so far beyond that no motion of this joint is like that.
    """
    beyond, largest = [], 0.0
    names, limits = (("positions", "{position}"), ("velocities", "{position}/s")), (joint.limits.q, joint.limits.dq)
    for (what, unit), x, bounds, usual in zip(names, smooth, limits, USUAL_LIMITS, strict=False):
        reach, limit = float(np.percentile(np.abs(x), 99.0)), max(map(abs, bounds))
        assumed, limit = (", which is assumed as none is stated", usual) if np.isinf(limit) else ("", limit)
        if reach > MAX_BEYOND_LIMITS * limit:
            times = f"{reach / limit:.3g} times the limit of {limit:.3g}"
            beyond.append(joint.unit(f"{what} reach {reach:.3g} {unit}, {times} {unit}{assumed}"))
            largest = max(largest, 0.0 if assumed else reach / limit)
    if beyond:
        units = "degrees" if joint.kind is Kind.REVOLUTE else "mm"
        doubt = f"{recording.log}/{recording.joint}: {', and '.join(beyond)}; are they in {units} or counts?"
        remedy = f'write the unit of the channel in study.toml, as unit = "{units[:3]}", or the gear_ratio of a motor'
        fault = f"{doubt} {remedy}, or correct the limits of the robot; if you pass arrays, convert them"
        if largest > IMPOSSIBLE:
            raise BadLog(fault)
        yield fault


def beyond_limits(recording: Recording, joint: Joint, smooth: tuple[Column, Column, Column]) -> Iterator[Diagnostic]:
    """Note low-passed positions and velocities that exceed the joint's limits by less than a wrong unit would.

    Positions far beyond are warned of: with another zero than the robot's, gravity and forces at the tip are wrong.
    The remedy has the line of study.toml that states limits which hold this motion.
    """
    beyond, severity, wider = [], "note", [*joint.limits.motion]
    for i, (what, unit) in enumerate((("positions", ""), ("velocities", "/s"))):
        x, (least, most) = smooth[i], wider[i]
        low, high = np.percentile(x, (1.0, 99.0))
        slack, largest = OVER_LIMITS * (most - least), max(-least, most)
        exceeds = low < least - slack or high > most + slack
        if exceeds and max(-low, high) <= MAX_BEYOND_LIMITS * largest:
            reach = joint.unit(f"{what} from {low:.3g} to {high:.3g} {{position}}{unit}")
            beyond.append(f"{reach} where the robot states {least:.3g} to {most:.3g}")
            step = 10.0 ** (np.floor(np.log10(most - least)) - 1.0)
            wider[i] = min(least, float(np.floor(low / step) * step)), max(most, float(np.ceil(high / step) * step))
            if what == "positions" and max(least - low, high - most) > FAR_OVER_LIMITS * (most - least):
                severity = "warning"
    if beyond:
        depends = "gravity and the arm's pose depend" if joint.kind is Kind.REVOLUTE else "the arm's pose depends"
        zero = f"the zero of positions (`offset`), on which {depends}"
        other = zero if beyond[0].startswith("positions") else "the `rate`"  # an offset changes no velocity
        pairs = [(name, pair) for name, pair in zip(("q", "dq", "ddq"), wider, strict=True) if pair != ANYWHERE]
        stated = [f"{name} = [{low:.6g}, {high:.6g}]" for name, (low, high) in pairs]
        stated += [f"effort = {joint.limits.effort:.6g}"] * bool(np.isfinite(joint.limits.effort))
        line = f"`limits = {{ {', '.join(stated)} }}` in [robot_overrides.{joint.name}] of study.toml"
        why = "or the limits, by which `excite` designs, if these are wrong"
        remedy = f"correct the units, or {other}, {why}: {line} or the robot's file"
        text = f"{recording.log}/{recording.joint}: {', '.join(beyond)}; {remedy}"
        yield diagnostic("resample", f"{recording.log}.{recording.joint}.limits", severity, text)


def faults(recording: Recording) -> Iterator[str]:
    """State where a position was stuck or jumps, or a drive was at its limit."""
    name, q = f"{recording.log}/{recording.joint}", recording.q
    remedy = "leave that out by `skip` and `until`, or record it again"
    for start, end, jump in find_stuck(recording.t, q):
        stop = f"stands still from {start:.3f} to {end:.3f} s and then jumps by {jump:.3g}"
        yield f"{name}: the position {stop}, as if its sensor was stuck; {remedy}"
    step = np.diff(q)
    jumps = np.flatnonzero(np.abs(step) > max(MIN_JUMP * np.ptp(q), MAX_USUAL * np.quantile(np.abs(step), 0.99)))
    if len(jumps):
        more = f" and {len(jumps) - 1} times more" if len(jumps) > 1 else ""
        leap = f"jumps by {step[jumps[0]]:.3g} within one sample at {recording.t[jumps[0]]:.3f} s{more}"
        yield f"{name}: the position {leap}, as of an angle that wraps or a sensor that fails; {remedy}"
    if not np.ptp(recording.tau):
        yield f"{name}: the effort is {recording.tau[0]:.3g} throughout; check the column of its channel"
    elif samples := count_saturated(recording.tau):
        what = f"the effort is exactly at its largest or smallest value in {samples} samples"
        why = "the drive or its sensor was saturated, so the true effort may be larger than the log says"
        yield f"{name}: {what}: {why}; record with less effort"


def step_of(t: Column) -> float:
    """Mean time [s] between samples."""
    return float((t[-1] - t[0]) / (len(t) - 1))


def as_recorded(recording: Recording, part: slice) -> tuple[Column | Counts, ...]:
    """Time, position, velocity, effort and flags of one segment, in the memory of the recording."""
    return recording.t[part], recording.q[part], recording.dq[part], recording.tau[part], recording.filled[part]


def on_uniform_clock(recording: Recording, part: slice, T_s: float) -> tuple[Column | Counts, ...]:
    """Time, position, velocity, effort and flags of one segment on a uniform clock, to at most its last sample.

    A time that is far from all measured samples is flagged as filled in.
    """
    from scipy.interpolate import make_interp_spline

    t, *columns, filled = as_recorded(recording, part)
    steps = int(np.floor((t[-1] - t[0]) / T_s * (1 + 1e-12)))
    clock = t[0] + T_s * np.arange(steps + 1)
    flags = are_missing(t[filled == 0], clock, T_s) if not filled.all() else np.ones(len(clock), np.int64)
    return clock, *np.ascontiguousarray(make_interp_spline(t, np.column_stack(columns), k=3)(clock).T), flags


def remarks(signal: Signal, recording: Recording, T_s: float, cuts: list[int], samples: int) -> Iterator[Diagnostic]:
    """Note gaps, samples that were left out, another rate, the resampling of an uneven clock, and filled samples."""
    name, notes, t = f"{recording.log}/{recording.joint}", [], recording.t
    if cuts:
        where = ", ".join(f"{t[c - 1]:.3f} s" for c in cuts[:5])
        notes.append(f"{name}: {len(cuts)} gaps, not bridged, after {where}{' ...' if len(cuts) > 5 else ''}")
    if samples < len(recording):
        short = f"segments of fewer than {MIN_SAMPLES_SEGMENT}"
        notes.append(f"{name}: {len(recording) - samples} samples in {short} were left out")
    slow: Booleans = (np.diff(t) > longest_bridge(T_s)) & ~are_gaps(t, T_s)
    for part in runs(slow)[:MAX_LISTED_STRETCHES]:
        span, rate = f"{t[part.start]:.3f} to {t[part.stop]:.3f} s", 1 / step_of(t[part.start : part.stop + 1])
        rates = f"at {rate:.4g} Hz, not at {1 / T_s:.4g} Hz"
        notes.append(f"{name}: from {span} the log is sampled {rates}; its times are kept")
    if signal.method != "as recorded":
        notes.append(f"{name}: the clock is uneven, so the samples were put on a uniform one: {signal.method}")
    if count := int(signal.filled.sum()):
        share = f"{count} of {len(signal)} samples ({count / len(signal):.2g})"
        notes.append(f"{name}: {share} are filled in between measured ones, and neither fitted nor judged")
    if notes:
        yield diagnostic("resample", f"{recording.log}.{recording.joint}", "note", *notes)


def standstill(motion: Motion) -> str:
    """State when a joint stands still, and the consequences for fits and contacts."""
    still: Booleans = motion.standing > 0
    parts = [f"{motion.t[part][0]:.2f} to {motion.t[part][-1]:.2f} s" for part in runs(still)]
    where, more = ", ".join(parts[:MAX_LISTED_STRETCHES]), len(parts) - MAX_LISTED_STRETCHES
    where += f" and {more} times more" if more > 0 else ""
    share = f"{100.0 * float(still.mean()):.2g} % of the log"
    why = "friction takes any value there, so its effort is used neither to fit nor to score a model"
    return f"{motion.log}/{motion.joint}: it stands still from {where}, {share}; {why}"
