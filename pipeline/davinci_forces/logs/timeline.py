"""Compute sample times of evenly sampled channels from headers of files or blocks, and group channels by clock."""

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from decimal import Decimal

import numpy as np

from davinci_forces.logs.log import Block
from davinci_forces.maths.arrays import Array

UNIX_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
ROUNDING = 1.5e-6  # [s] largest rounding error of the difference of two start times in whole microseconds
SKEW = 0.02  # channels whose times differ by less than this share of a sampling time were sampled together


def moment(zero: datetime, seconds: int, microseconds: int = 0) -> datetime | None:
    """The date and time after `zero` by these seconds and microseconds; None beyond the range of dates."""
    try:
        return zero + timedelta(seconds=seconds, microseconds=microseconds)
    except OverflowError:
        return None


@dataclass
class Timeline:
    """Parts of a log with uniform sampling: the first row, start time [s] and sampling time [s] of each part."""

    first: list[int] = field(default_factory=list)
    start: list[float] = field(default_factory=list)
    step: list[float] = field(default_factory=list)
    rows: int = 0

    def add(self, rows: int, start: float | None, step: float) -> None:
        """Append samples from `start` [s] on (None: after the last), as a new part unless these continue the last."""
        due = self.start[-1] + (self.rows - self.first[-1]) * self.step[-1] if self.first else 0.0
        continues = bool(self.first) and (start is None or abs(start - due) <= ROUNDING)
        if not continues or step != self.step[-1]:
            self.first.append(self.rows)
            self.start.append(due if continues or start is None else start)
            self.step.append(step)
        self.rows += rows

    def times(self, row: int, count: int) -> Array:
        """Compute the times (count,) [s] of the samples from a row on; times after the last sample are extrapolated."""
        begin, end = bisect_right(self.first, row) - 1, bisect_right(self.first, row + count - 1)
        first, start, step = (np.array(column[begin:end]) for column in (self.first, self.start, self.step))
        rows = row + np.arange(count)
        part = np.searchsorted(first, rows, side="right") - 1
        return np.asarray(start[part] + (rows - first[part]) * step[part])

    def is_like(self, timeline: "Timeline") -> bool:
        """Whether both were sampled together; one may have more samples than the other."""
        if self.first != timeline.first:
            return False
        ends = (*self.first[1:], max(self.rows, timeline.rows))
        parts = zip(self.first, ends, self.start, timeline.start, self.step, timeline.step, strict=True)
        drifts = ((abs(x - y) + abs(T - S) * (end - begin), min(abs(T), abs(S))) for begin, end, x, y, T, S in parts)
        return all(drift <= SKEW * step for drift, step in drifts)


def group_by_clock(timelines: dict[str, Timeline]) -> list[list[str]]:
    """Group the names of channels that were sampled together, in the order of `timelines`."""
    order = {name: i for i, name in enumerate(timelines)}
    ranked = sorted(timelines, key=lambda name: (*_rank(timelines[name]), order[name]))
    groups: list[list[str]] = []
    for name in ranked:
        if groups and timelines[groups[-1][0]].is_like(timelines[name]):
            groups[-1].append(name)
        else:
            groups.append([name])
    return sorted((sorted(group, key=order.__getitem__) for group in groups), key=lambda group: order[group[0]])


def _rank(timeline: Timeline) -> tuple[list[int], list[str], list[float]]:
    """Sort key that puts similar timelines next to each other, so that not all pairs need a comparison."""
    return timeline.first, [f"{step:.9g}" for step in timeline.step], timeline.start


@dataclass(frozen=True)
class Sampling:
    """The sampling of one channel as a header states it."""

    start: Decimal | None  # [s] since the year 1, in local time
    x0: float  # [s] time since `start` (X in LabVIEW) at the first sample
    step: float  # [s] sampling time

    def is_like(self, sampling: "Sampling", has_x_columns: bool) -> bool:
        """Whether the header says that both were sampled together; X0 and step are ignored if it has X columns."""
        if (self.start is None) != (sampling.start is None) or (self.step != sampling.step and not has_x_columns):
            return False
        start, other_start = self.start, sampling.start
        difference = float(start - other_start) if start is not None and other_start is not None else 0.0
        if not has_x_columns:
            difference += self.x0 - sampling.x0
        return abs(difference) <= max(SKEW * min(abs(self.step), abs(sampling.step)), ROUNDING)


@dataclass(frozen=True)
class OwnClock:
    """The own clock of some channels of a log, in addition to the clock of the log."""

    time: str  # name of a channel that holds the times of this clock, and is added to the log
    channels: tuple[str, ...]  # in the order of the file
    x: str = ""  # name of the column with the times X of these channels; "" if the file has none


def refine_groups(groups: Sequence[list[str]], sampled: dict[str, Sampling], has_x_columns: bool) -> list[list[str]]:
    """Split groups in which a second header states different clocks for the channels; add channels without a group."""

    def is_like(group: list[str], name: str) -> bool:  # a channel that the header omits may have any clock
        member_sampling = next((sampled[member] for member in group if member in sampled), None)
        return not (member_sampling and name in sampled) or member_sampling.is_like(sampled[name], has_x_columns)

    split: list[list[str]] = []
    new = [name for name in sampled if not any(name in group for group in groups)]
    for names in (*groups, new):
        first = 0 if names is new else len(split)  # only new channels may join the parts of another group
        for name in names:
            part = next((part for part in split[first:] if is_like(part, name)), None)
            if part is None:
                split.append(part := [])
            part.append(name)
    return split


def equal_columns(names: Sequence[str], blocks: Iterable[Block]) -> dict[str, int]:
    """Number columns alike that are equal in all rows, as the times of one clock; missing values count as equal."""
    numbers = dict.fromkeys(names, 0)
    for block in blocks:
        met: dict[tuple[int, bytes], int] = {}
        numbers = {name: met.setdefault((numbers[name], block[name].tobytes()), len(met)) for name in names}
        if len(met) == len(names):
            break
    return numbers
