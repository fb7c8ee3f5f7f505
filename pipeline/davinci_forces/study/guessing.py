"""Guess what the channels of a log hold: by the names of joints, by numbers and labels in names, else by content."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from davinci_forces.logs.log import Log
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.contact.unexplained import smoothed_course
from davinci_forces.maths.periods.repetition import Repetition, repetition
from davinci_forces.maths.signals import columns
from davinci_forces.maths.units import measures, size
from davinci_forces.robots.robot import Robot
from davinci_forces.study.holding import POSITIONS, VELOCITIES, Holding, Meaning
from davinci_forces.study.joint_names import AT_MOTOR, by_joint_names, by_numbers, by_words
from davinci_forces.study.names import is_time, stated_unit, symbol_of, words_of
from davinci_forces.study.timing import MAX_CHANNELS, TimeGuess, has_clock, named_time, samples_of, timing_of

PERIOD_TOLERANCE = 0.05  # periods that the last whole one may lack
MIN_REPEATING_SHARE = 0.5  # share of a recording that must repeat for its motion to count as periodic


def guess(log: Log, robots: Sequence[Robot] = ()) -> Holding:
    """Guess what the channels of a log hold, which may name joints of `robots`; raises BadLog where it is damaged."""
    numbers = [channel for channel in log.channels if channel.kind == "number" and not channel.derived]
    if not 0 < len(numbers) <= MAX_CHANNELS:
        return Holding()
    holdings = [by_joint_names(numbers, robot) for robot in robots]
    holding = max(holdings, key=lambda h: len(h.meanings) if h.is_complete else -1, default=Holding())
    if not holding.is_complete:
        holding = max(by_numbers(numbers), by_words(numbers), key=lambda h: len(h.meanings))
    if holding.is_complete:
        times = [c.name for c in log.channels if c.kind != "text" and not c.derived and is_time(c)]
        used = list(dict.fromkeys([*holding.meanings, *times, *([log.time] if log.time else [])]))
        samples = {name: x for names in log.by_clock(used).values() for name, x in samples_of(log, names).items()}
        return with_motion(log, holding, samples)
    content = _by_content(log, [channel.name for channel in numbers if channel.name != log.time])
    if not any(re.search("[A-Za-z]", channel.name.replace("column", "")) for channel in numbers):
        return content
    named = any(symbol_of(words_of(channel.name)) for channel in numbers)  # not as `Untitled 1`
    if (content.meanings and not named) or any(r.file and len(r.joints) == content.joints for r in robots):
        return content.to_check()
    times = [channel.name for channel in numbers if is_time(channel)]
    samples = {name: samples_of(log, [name])[name] for name in times}
    timing = timing_of(log, samples, [], unnamed=False)  # names whose meaning we do not know
    by_name = timing.missing and times and not has_clock(log)
    return Holding(timing=TimeGuess(times[0], reason="CHECK: in seconds by its name alone") if by_name else timing)


def clock_hint(log: Log) -> str:
    """Propose a channel, or a rate by velocities, as times of a log without any, else ""; raises BadLog at damage."""
    names = [channel.name for channel in log.channels if channel.kind == "number" and not channel.derived]
    if has_clock(log) or named_time(log) or not 0 < len(names) <= MAX_CHANNELS or len(log.by_clock(names)) > 1:
        return ""
    samples = samples_of(log, names)
    first = columns.first_rising_column([samples[name] for name in names])
    timing = guess(log).timing
    if first is not None and not timing.rate:
        t = samples[names[first]]
        rate = (len(t) - 1) / float(t[-1] - t[0])
        return f"time = {names[first]!r}, which increases throughout ({rate:.6g} Hz if it is in seconds)"
    return f"rate = {timing.rate!r}, {timing.reason}" if timing.rate else ""


def _by_content(log: Log, names: Sequence[str]) -> Holding:
    """Assign columns without names: a time, n positions, n velocities, and n efforts or currents."""
    if len(log.by_clock(names)) > 1:
        return Holding()
    samples = samples_of(log, names) | (samples_of(log, [log.time]) if log.time else {})
    first = None if has_clock(log) else columns.first_rising_column([samples[name] for name in names])
    signals = [name for i, name in enumerate(names) if i != first]
    blocks = columns.blocks([samples[name] for name in signals], None if first is None else samples[names[first]])
    if blocks is None:
        return Holding(timing=timing_of(log, samples, [], unnamed=True))
    n, values = blocks.n, [samples[name] for name in signals]
    meanings = {s: Meaning("q", k, f"position {k + 1} of {n}, by its derivative") for k, s in enumerate(signals[:n])}
    derivative = f"derivative of the moving positions (correlation {blocks.correlation:.3f})"
    meanings |= {name: Meaning("dq", k, derivative) for k, name in enumerate(signals[n : 2 * n])}
    others = [values[start : start + n] for start in range(3 * n, len(values) - n + 1, n)]
    is_current = columns.is_current(values[2 * n : 3 * n], others, blocks.moving)
    effort, why = "tau", "effort, as nothing shows that it is a current"
    if is_current:
        effort, why = "i", "current, as later columns are torques proportional to these columns"
    reason = f"CHECK: follows the velocities; {why}"
    meanings |= {name: Meaning(effort, k, reason) for k, name in enumerate(signals[2 * n : 3 * n])}
    return with_motion(log, Holding(meanings, n), samples, unnamed=True)


def with_motion(log: Log, holding: Holding, samples: dict[str, Array], unnamed: bool = False) -> Holding:
    """Add the times, the joints that move, and whether their motion repeats or has constant velocities."""
    units = {c.name: stated_unit(c) for c in log.channels}
    by_symbol: dict[str, dict[int, Array]] = {"q": {}, "dq": {}, "tau": {}}
    for name, meaning in holding.meanings.items():
        unit = units.get(name, "") or meaning.unit
        kind = "q" if meaning.symbol in POSITIONS else "dq" if meaning.symbol in VELOCITIES else "tau"
        if name in samples:
            by_symbol[kind][meaning.joint] = samples[name] * (size(unit) if measures(unit) else 1.0)
    q, dq, tau = by_symbol.values()
    if not q or not all(len(values) for values in q.values()):
        return holding
    pairs = [(q[joint], dq[joint]) for joint in q if joint in dq and len(dq[joint]) == len(q[joint])]
    timing = timing_of(log, samples, pairs, unnamed)
    joints = sorted(q)
    by_motor = {meaning.joint for meaning in holding.meanings.values() if meaning.symbol == "theta_m"}
    sides = [[k for k in joints if (k in by_motor) is side] for side in (False, True)]  # a motor turns farther
    moving = tuple(sorted(side[i] for side in sides for i in columns.moving_positions([q[k] for k in side])))
    again = repetition([q[joint] for joint in moving]) if len({len(q[joint]) for joint in moving}) == 1 else None
    velocity = dq.get(moving[0], np.gradient(q[moving[0]])) if len(moving) == 1 else None
    step = timing.step or 1.0
    courses = {
        joint: smoothed_course(q[joint], dq.get(joint, np.gradient(q[joint]) / step), tau[joint], step)
        for joint in moving
        if joint in tau and len(tau[joint]) == len(q[joint]) == len(dq.get(joint, q[joint]))
    }
    by_slope = {s: unit for symbol, unit in timing.units for s in (symbol, AT_MOTOR[symbol])}
    meanings = {
        name: replace(m, unit=by_slope[m.symbol], reason=f"{m.reason}; unit by velocity over slope")
        if m.symbol in by_slope and not m.unit and not units.get(name) else m
        for name, m in holding.meanings.items()
    }  # fmt: skip
    return replace(
        holding, meanings=meanings, timing=timing, moving=moving, courses=courses, units=units,
        repeating=step * _whole_periods(again, len(q[joints[0]])) if again else 0.0,
        steady=velocity is not None and columns.is_steady(velocity),
        ranges={joint: (float(values.min()), float(values.max())) for joint, values in q.items()},
    )  # fmt: skip


def _whole_periods(repeat: Repetition, N: int) -> float:
    """The samples in whole periods, 0 if the section that repeats is less than half of the N samples of a log."""
    size = repeat.stop - repeat.start
    return int(size / repeat.lag + PERIOD_TOLERANCE) * repeat.lag if size >= MIN_REPEATING_SHARE * N else 0.0
