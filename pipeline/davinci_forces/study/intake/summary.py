"""Summarise a log after reading it, with remarks on its clock and rows."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.files import visible
from davinci_forces.logs.log import UNSET_START
from davinci_forces.maths.signals import clock as clocks
from davinci_forces.records import LogSummary
from davinci_forces.study.intake import Intake


def summary(intake: Intake) -> LogSummary:
    """Summarise a log that was read to its end; raises BadLog if nothing is left to analyse."""
    clock, log, entry = intake.clock, intake.log, intake.entry
    missing = intake.clocks.missing
    missing.require_most(log)
    if clock.samples < 2 or clock.last - clock.first <= entry.skip:
        until = f" and those after {entry.until:g} s left out" if intake.ended else ""
        why = f"{clock.samples} samples are too few, with {entry.skip:g} s skipped at the start{until}"
        raise log.bad(f"{why}; record more, or take the log out of study.toml")
    feeds = [(c.name, quantity) for quantity, c in intake.channels.items()]  # channels, and quantities that they feed
    feeds += [(group.time, "time") for group in intake.clocks.groups]
    names = [channel.name for channel in log.channels]
    facts = {**log.facts, **({"comments": "; ".join(log.comments)} if log.comments else {})}
    times = (clock.rate, clock.last - clock.first, clock.jitter, clock.longest_gap)
    rate, duration, jitter, longest_gap = times if intake.clocks.all_timed else (float("nan"),) * 4
    return LogSummary.like(
        clock, log=entry.name, role=entry.role, format=log.format, files=entry.files,
        started="" if log.started.startswith(UNSET_START) else log.started, zone=log.zone,
        rows=clock.samples, rate=rate, duration=duration, jitter=jitter, longest_gap=longest_gap,
        dropped=log.dropped + missing.left_out.count,
        facts=tuple(visible(f"{key}: {value}") for key, value in facts.items()),
        warnings=tuple(map(visible, log.warnings)),
        channel=np.array([*map(visible, names)], object),
        unit=np.array([visible(channel.unit) for channel in log.channels], object),
        feeds=np.array([", ".join(dict.fromkeys(q for c, q in feeds if c == name)) for name in names], object),
        nulls=np.array([log.nulls.get(name, 0) for name in names]),
        nans=np.array([log.nans.get(name, 0) for name in names]),
    )  # fmt: skip


def remarks(intake: Intake) -> Iterator[str]:
    """Remarks for a reviewer on the clock and the rows."""
    clock, entry = intake.clock, intake.entry
    duration = clock.last - clock.first
    if intake.jumps:
        when = ", ".join(f"{jump:.6g} s after {t - clock.first:.3f} s" for t, jump in intake.jumps[:5])
        jumps = f"by {when} ..." if len(intake.jumps) > 5 else f"by {when}"
        remedy = "The later times are moved by the jump; find out why the recorder's clock jumps"
        yield f"the clock jumps while the motion continues, {jumps}. {remedy}"
    for name, (start, end) in (*(("contact", of) for of in entry.contact), *(("free", of) for of in entry.free)):
        if start >= duration or end <= entry.skip:
            span = f"the log, which goes from {entry.skip:g} to {duration:g} s from its first sample on"
            yield f"the {name} window {start:g} to {end:g} s lies outside {span}; correct `{name}` in study.toml"
    if entry.until is not None and not intake.ended and duration < entry.until - clocks.GAP / clock.rate:
        why = f"because the log ends after {duration:g} s; both count from its first sample"
        yield f"until = {entry.until:g} s leaves nothing out, {why}"
    missing = intake.clocks.missing
    left_out = missing.left_out.count
    if end := missing.left_out.at_end if intake.log.cut else 0:
        yield f"the file is truncated: its last {end} rows lack some channels and are left out"
    if missing.filled_rows or left_out > end:
        lacking = ", ".join(f"{name!r} {c.count}" for name, c in missing.channels.items() if c.count > c.at_end)
        runs = f"rows with up to {1e3 * clocks.FILLED:g} ms or one sample missing"
        rows = f"{missing.filled_rows} {runs} are filled by cubics, and neither fitted nor judged"
        yield f"samples are missing ({lacking}): {rows}; {left_out - end} rows are gaps"
    yield from clocks.remarks(clock, clock.rate)
