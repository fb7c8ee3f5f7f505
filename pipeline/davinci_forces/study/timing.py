"""Guess the times of a log: by its format, by names, by values; and check them against positions and velocities."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from davinci_forces.logs.log import Block, Channel, Log, concatenate, row_count
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.signals import columns
from davinci_forces.maths.signals.clock import interruptions
from davinci_forces.maths.units import measures, since_1970, size
from davinci_forces.study.names import is_time, words_of

MAX_SAMPLES = 200_000  # samples of a log that are read
MAX_CHANNELS = 400  # channels of a log whose samples are read
MIN_CORRELATION = 0.9  # of a velocity with the slope of its position, to judge times by them
TOLERANCE_RATE = 0.05  # relative; beyond it, and beyond the noise of the velocities, two rates disagree
MIN_RISING_SHARE = 0.9  # of the steps of a time; recorders repeat some stamps
MIN_RATE, MAX_RATE = 5.0, 20e3  # [Hz] of a robot's recorder, by which a time without a unit is judged
SIZES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # [s]
RATIOS = {("dq", "deg/s"): 180 / math.pi, ("q", "deg"): math.pi / 180}  # velocity over slope where one is in degrees


class VelocityRatio(NamedTuple):
    """Velocity over the slope of the position, as the median of the joints that move, and their correlation."""

    correlation: float
    ratio: float  # [Hz] where the slope is per sample

    def agrees(self, ratio: float) -> bool:
        """Whether the ratio is within the noise: the slopes of the two regressions bracket the true one."""
        low, high = self.ratio * self.correlation, self.ratio / max(self.correlation, 1e-9)
        return low * (1 - TOLERANCE_RATE) <= ratio <= high * (1 + TOLERANCE_RATE)


@dataclass(frozen=True)
class TimeGuess:
    """The time channel of a log or its rate, with the reason; `missing` says why neither is known."""

    time: str = ""
    size: float = 1.0  # [s] of a unit of the channel, where the log does not state it
    reason: str = ""
    rate: float = 0.0  # [Hz] to be stated; 0 where the log has a clock, a time or nothing
    missing: str = ""
    remark: str = ""  # what a reviewer has to look at
    units: tuple[tuple[str, str], ...] = ()  # of symbols, by the ratio of velocity to slope
    step: float = 0.0  # [s] mean sampling time


def samples_of(log: Log, names: Sequence[str]) -> dict[str, Array]:
    """Read the first samples of channels of one clock, up to the last complete row; raises BadLog at damage."""
    blocks: list[Block] = []
    rows = 0
    for block in log.blocks(list(names)):
        blocks.append(block)
        rows += row_count(block)
        if rows >= MAX_SAMPLES:
            break
    samples = concatenate(blocks or [{name: np.zeros(0) for name in names}])
    complete = np.flatnonzero(np.all([np.isfinite(values) for values in samples.values()], axis=0))
    return {name: values[: complete[-1] + 1 if len(complete) else 0] for name, values in samples.items()}


def has_clock(log: Log) -> bool:
    """Whether the format gives the time of every sample: by a clock, by a channel of times, or by one for each."""
    return bool(log.clock or log.time or all(channel.time for channel in log.channels if channel.kind == "number"))


def named_time(log: Log) -> str:
    """The channel of times: the format's own, else one named as a time, unless the format has a clock."""
    if log.time or has_clock(log):
        return log.time
    return next((channel.name for channel in log.channels if channel.kind == "number" and is_time(channel)), "")


def slope_of(pairs: Sequence[tuple[Array, Array]], t: Array | None = None) -> VelocityRatio | None:
    """Compare velocities (N,) with the slopes of positions (N,), per sample or per second of `t`; None if unrelated."""
    moves = columns.moving_positions([q for q, _ in pairs]) if pairs and len(pairs[0][0]) else ()
    both = [columns.derivative(*pairs[i], t) for i in moves]
    alike = [VelocityRatio(*pair) for pair in both if pair[0] >= MIN_CORRELATION]
    return VelocityRatio(*np.median(alike, axis=0).tolist()) if alike else None


def timing_of(log: Log, samples: Mapping[str, Array], pairs: Sequence[tuple[Array, Array]], unnamed: bool) -> TimeGuess:
    """Guess the times of a log by its samples, their velocities and, if `unnamed`, by the first channel that rises."""
    per_sample = slope_of(pairs)
    if has_clock(log):
        return _timing_of_format(log, samples, per_sample)
    numbers = [c for c in log.channels if c.kind == "number" and not c.derived and c.name in samples]
    times = [channel for channel in numbers if is_time(channel) and _rises(samples[channel.name])]
    times.sort(key=lambda channel: "header" not in words_of(channel.name))  # when it was measured, not received
    if unnamed and not times:
        first = columns.first_rising_column([samples[channel.name] for channel in numbers])
        times = [numbers[first]] if first is not None else []
    if known := [guess for one in times if (guess := _timing_by(one, samples[one.name], pairs, unnamed))]:
        return next((timing for timing in known if timing.time), known[0])
    if per_sample is not None:
        rate = columns.round_rate(per_sample.ratio)
        reason = "at which the velocities match the derivatives of the positions"
        return TimeGuess(rate=rate, reason=reason, step=1 / rate)
    return TimeGuess(missing="no channel is a time, and no velocity tells the rate")


def _rises(t: Array) -> bool:
    steps = np.diff(t[np.isfinite(t)])
    return len(steps) > 1 and bool((steps >= 0).all()) and float((steps > 0).mean()) >= MIN_RISING_SHARE


def _step(t: Array) -> float:
    """Mean sampling time, without the steps that go back and the gaps."""
    count, seconds = interruptions(t)
    usual = len(t) - 1 - count
    return (float(t[-1] - t[0]) - seconds) / usual if usual else float(t[-1] - t[0]) / (len(t) - 1)


def _timing_by(channel: Channel, t: Array, pairs: Sequence[tuple[Array, Array]], unnamed: bool) -> TimeGuess | None:
    """The times of a channel in the unit that it states or that its values tell; None where it only counts samples."""
    known = size(channel.unit) if measures(channel.unit) == "time" else 0.0
    strict = np.concatenate([[True], np.diff(t) > 0])
    slope = slope_of([(q[strict], dq[strict]) for q, dq in pairs if len(q) == len(t)], t[strict])
    shape = "increases throughout" if strict.all() else "increases"
    if np.allclose(np.diff(t), 1.0, rtol=0, atol=1e-9 * abs(t[-1])) and not known and not (slope and slope.agrees(1.0)):
        return None  # a counter of samples
    since = since_1970(t[0])
    sizes = [known] if known else [SIZES[since]] if since else []
    if not sizes and slope:
        sizes = [s for s in SIZES.values() if slope.agrees(1 / s)]
    if not sizes:
        sizes = [s for s in SIZES.values() if MIN_RATE <= 1 / (_step(t) * s) <= MAX_RATE]
        if not (1.0 in sizes or len(sizes) == 1) or (sizes[0] != 1.0 and not slope):
            unit_list = " or ".join(f"{name} ({1 / (_step(t) * s):.4g} Hz)" for name, s in SIZES.items() if s in sizes)
            return TimeGuess(missing=f"channel {channel.name!r} is a time of unknown unit: {unit_list or 'none fits'}")
    seconds = sizes[0]
    rate = 1 / (_step(t) * seconds)
    how = "" if known else " by its size since 1970" if since else " by the velocities" if seconds != 1.0 else ""
    name = next((name for name, s in SIZES.items() if s == seconds), "")
    what = f"{shape} ({rate:.6g} Hz if it is in seconds)" if unnamed and not how else f"{shape}, {rate:.6g} Hz"
    timing = TimeGuess(channel.name, seconds, what + (f"; in {name}{how}" if how else ""), step=_step(t) * seconds)
    units, fitted = _compared(slope and slope._replace(ratio=slope.ratio * seconds), rate)
    if not fitted:
        return replace(timing, units=units)
    clash = f"by {channel.name!r} the rate is {rate:.6g} Hz, but the velocities fit the positions at {fitted:g} Hz"
    return TimeGuess(missing=f"{clash}: write rate = {fitted:g}, or time = {channel.name!r}", step=timing.step)


def _compared(slope: VelocityRatio | None, rate: float) -> tuple[tuple[tuple[str, str], ...], float]:
    """The units in degrees that explain a ratio other than 1, or, if none does, the rate [Hz] by the velocities."""
    if slope is None or slope.agrees(1.0):
        return (), 0.0
    units = tuple(key for key, ratio in RATIOS.items() if slope.agrees(ratio))
    return units, 0.0 if units else columns.round_rate(slope.ratio * rate)


def _timing_of_format(log: Log, samples: Mapping[str, Array], slope: VelocityRatio | None) -> TimeGuess:
    """The clock of a format, with a remark where the velocities tell another rate."""
    t = samples.get(log.time, np.zeros(0)) if log.time else np.zeros(0)
    step = log.clock.step if log.clock else _step(t) if len(t) > 1 else 0.0
    if not step:
        return TimeGuess()
    units, fitted = _compared(slope and slope._replace(ratio=slope.ratio * step), 1 / step)
    remark = f"the clock is at {1 / step:.6g} Hz, but the velocities fit the positions at {fitted:g} Hz"
    return TimeGuess(step=step, units=units, remark=remark if fitted else "")
