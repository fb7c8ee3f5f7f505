"""Sample times of evenly sampled channels from their writes or headers, and the groups sampled together."""

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from decimal import Decimal

import numpy as np

from davinci_forces.logs.log import Block
from davinci_forces.maths.arrays import Array

UNIX_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
ROUNDING = 1.5e-6  # [s] rounding of the difference of two starts written in whole microseconds
SKEW = 0.02  # of a sampling time: channels whose times differ by less were sampled together


def moment(zero: datetime, seconds: int, microseconds: int = 0) -> datetime | None:
    """The date and time so long after `zero`; None beyond the range of dates."""
    try:
        return zero + timedelta(seconds=seconds, microseconds=microseconds)
    except OverflowError:
        return None


@dataclass
class Timeline:
    """Uniform stretches of samples: the first row, start time [s] and sampling time [s] of each."""

    first: list[int] = field(default_factory=list)
    start: list[float] = field(default_factory=list)
    step: list[float] = field(default_factory=list)
    rows: int = 0

    def add(self, rows: int, start: float | None, step: float) -> None:
        """Append samples; without a `start`, or with the time that is due, they continue those before."""
        due = self.due
        follows = bool(self.first) and (start is None or abs(start - due) <= ROUNDING)
        if not follows or step != self.step[-1]:
            self.first.append(self.rows)
            self.start.append(due if follows or start is None else start)
            self.step.append(step)
        self.rows += rows

    @property
    def due(self) -> float:
        """Time at which the next sample is due [s]; 0 before the first."""
        return self.start[-1] + (self.rows - self.first[-1]) * self.step[-1] if self.first else 0.0

    @property
    def is_uniform(self) -> bool:
        """Whether all samples have one sampling time and no gap between them."""
        return len(self.first) == 1

    def times(self, row: int, count: int) -> Array:
        """Compute the times (count,) [s] of the samples from a row on; the last stretch has no end."""
        begin, end = bisect_right(self.first, row) - 1, bisect_right(self.first, row + count - 1)
        first, start, step = (np.array(column[begin:end]) for column in (self.first, self.start, self.step))
        rows = row + np.arange(count)
        if len(first) == 1:
            return np.asarray(start[0] + (rows - first[0]) * step[0])
        stretch = np.searchsorted(first, rows, side="right") - 1
        return np.asarray(start[stretch] + (rows - first[stretch]) * step[stretch])

    def is_like(self, timeline: "Timeline") -> bool:
        """Whether both were sampled together, though one may have more samples."""
        if self.first != timeline.first:
            return False
        # Most unequal clocks are found without arrays: by the drift between their first sampling times.
        difference, least = abs(self.step[0] - timeline.step[0]), min(abs(self.step[0]), abs(timeline.step[0]))
        if difference * (self.first[1] if len(self.first) > 1 else max(self.rows, timeline.rows)) > SKEW * least:
            return False
        mine, theirs = np.array([self.start, self.step]), np.array([timeline.start, timeline.step])
        ends = np.array([*self.first[1:], max(self.rows, timeline.rows)])
        strays = np.abs(mine[0] - theirs[0]) + np.abs(mine[1] - theirs[1]) * (ends - self.first)
        return bool(np.all(strays <= SKEW * np.minimum(np.abs(mine[1]), np.abs(theirs[1]))))


def group_by_clock(timelines: dict[str, Timeline]) -> list[list[str]]:
    """Group the names of channels that were sampled together, in their order."""
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
    """Sort key that puts similar timelines next to each other, without comparing all pairs."""
    return timeline.first, [f"{step:.9g}" for step in timeline.step], timeline.start


@dataclass(frozen=True)
class Sampling:
    """The sampling of one channel as a header states it; `start` [s] counts from the year 1 in local time."""

    start: Decimal | None
    x0: float
    step: float

    def is_like(self, sampling: "Sampling", x_is_written: bool) -> bool:
        """Whether both were sampled together, as far as the header tells."""
        if (self.start is None) != (sampling.start is None) or (self.step != sampling.step and not x_is_written):
            return False
        start, its_start = self.start, sampling.start
        difference = float(start - its_start) if start is not None and its_start is not None else 0.0
        if not x_is_written:
            difference += self.x0 - sampling.x0
        return abs(difference) <= max(SKEW * min(abs(self.step), abs(sampling.step)), ROUNDING)


@dataclass(frozen=True)
class OwnClock:
    """A clock of some channels other than the first clock of the log."""

    time: str  # the derived channel of its times
    channels: tuple[str, ...]  # in the order of the file
    x: str = ""  # the column of x, where one is written for them


def refine_groups(groups: Sequence[list[str]], sampled: dict[str, Sampling], x_is_written: bool) -> list[list[str]]:
    """Split groups of channels sampled together so far, where one more header shows different clocks."""
    split: list[list[str]] = []
    for group in groups:
        parts: list[list[str]] = []
        for name in group:
            _joined(parts, name, sampled, x_is_written)
        split += parts
    for name in [n for n in sampled if not any(n in group for group in groups)]:
        _joined(split, name, sampled, x_is_written)
    return split


def _joined(groups: list[list[str]], name: str, sampled: dict[str, Sampling], x_is_written: bool) -> None:
    """Put a channel into the first group that it may belong to; the header need not name all channels."""
    for group in groups:
        its = next((sampled[member] for member in group if member in sampled), None)
        if its is None or name not in sampled or its.is_like(sampled[name], x_is_written):
            group.append(name)
            return
    groups.append([name])


def equal_columns(names: Sequence[str], blocks: Iterable[Block]) -> list[list[str]]:
    """Group columns with equal values throughout, and with the same cells missing."""
    groups = [[*names]]
    for block in blocks:
        split: list[list[str]] = []
        for group in groups:
            parts: list[list[str]] = []
            for name in group:
                same = (part for part in parts if np.array_equal(block[part[0]], block[name], equal_nan=True))
                if (part := next(same, None)) is None:
                    parts.append(part := [])
                part.append(name)
            split += parts
        groups = split
        if len(groups) == len(names):
            break
    return groups
