"""When evenly sampled channels were sampled, as their writes or headers say, and which were sampled together."""

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from decimal import Decimal

import numpy as np

from davinci_forces.logs.log import Block
from davinci_forces.maths.arrays import Array

ROUNDING = 1.5e-6  # [s] two starts written in whole microseconds may be off by so much
SKEW = 0.02  # of a sampling time: channels that stray less than this from each other were sampled together


def moment(zero: datetime, seconds: int, microseconds: int = 0) -> datetime | None:
    """The moment so long after `zero`; None for one that no calendar holds."""
    try:
        return zero + timedelta(seconds=seconds, microseconds=microseconds)
    except OverflowError:
        return None


@dataclass
class Timeline:
    """Stretches of samples: each begins at a row, at a time [s], and goes on by a sampling time [s]."""

    first: list[int] = field(default_factory=list)
    start: list[float] = field(default_factory=list)
    step: list[float] = field(default_factory=list)
    rows: int = 0

    def add(self, rows: int, start: float | None, step: float) -> None:
        """Samples that follow; they go on from those before where no `start` is said, or one that is next in turn."""
        due = self.due
        follows = bool(self.first) and (start is None or abs(start - due) <= ROUNDING)
        if not follows or step != self.step[-1]:
            self.first.append(self.rows)
            self.start.append(due if follows or start is None else start)
            self.step.append(step)
        self.rows += rows

    @property
    def due(self) -> float:
        """When the next sample is due [s]; 0 before the first."""
        return self.start[-1] + (self.rows - self.first[-1]) * self.step[-1] if self.first else 0.0

    @property
    def is_uniform(self) -> bool:
        """Whether all samples have one sampling time and no gap between them."""
        return len(self.first) == 1

    def at(self, row: int, count: int) -> Array:
        """The times (count,) [s] of the samples from a row on; the last stretch has no end."""
        begin, end = bisect_right(self.first, row) - 1, bisect_right(self.first, row + count - 1)
        first, start, step = (np.array(each[begin:end]) for each in (self.first, self.start, self.step))
        rows = row + np.arange(count)
        if len(first) == 1:
            return np.asarray(start[0] + (rows - first[0]) * step[0])
        of = np.searchsorted(first, rows, side="right") - 1
        return np.asarray(start[of] + (rows - first[of]) * step[of])

    def is_like(self, other: "Timeline") -> bool:
        """Whether samples of both were taken together, though one may have more of them."""
        if self.first != other.first:
            return False
        # What tells most clocks apart, without arrays: by how much their first sampling times differ by the end.
        apart, least = abs(self.step[0] - other.step[0]), min(abs(self.step[0]), abs(other.step[0]))
        if apart * (self.first[1] if len(self.first) > 1 else max(self.rows, other.rows)) > SKEW * least:
            return False
        own, its = np.array([self.start, self.step]), np.array([other.start, other.step])
        ends = np.array([*self.first[1:], max(self.rows, other.rows)])
        strays = np.abs(own[0] - its[0]) + np.abs(own[1] - its[1]) * (ends - self.first)
        return bool(np.all(strays <= SKEW * np.minimum(np.abs(own[1]), np.abs(its[1]))))


def together(timelines: dict[str, Timeline]) -> list[list[str]]:
    """Names of channels that were sampled together, in their order."""
    order = {name: i for i, name in enumerate(timelines)}
    ranked = sorted(timelines, key=lambda name: (*_rank(timelines[name]), order[name]))
    groups: list[list[str]] = []
    for name in ranked:
        if groups and timelines[groups[-1][0]].is_like(timelines[name]):
            groups[-1].append(name)
        else:
            groups.append([name])
    return sorted((sorted(group, key=order.__getitem__) for group in groups), key=lambda group: order[group[0]])


def _rank(one: Timeline) -> tuple[list[int], list[str], list[float]]:
    """What brings timelines that are alike next to each other, without comparing all pairs."""
    return one.first, [f"{step:.9g}" for step in one.step], one.start


@dataclass(frozen=True)
class Sampling:
    """What a header says of when one channel was sampled: `start` [s] since the year 1 in local time."""

    start: Decimal | None
    x0: float
    step: float

    def is_like(self, other: "Sampling", x_is_written: bool) -> bool:
        """Whether both were sampled together, as far as the header knows."""
        if (self.start is None) != (other.start is None) or (self.step != other.step and not x_is_written):
            return False
        apart = float(self.start - other.start) if self.start is not None and other.start is not None else 0.0
        if not x_is_written:
            apart += self.x0 - other.x0
        return abs(apart) <= max(SKEW * min(abs(self.step), abs(other.step)), ROUNDING)


@dataclass(frozen=True)
class OwnClock:
    """A clock of some channels that is not the log's first."""

    time: str  # the derived channel of its times
    channels: tuple[str, ...]  # in the order of the file
    x: str = ""  # the column of x, where one is written for them


def refined(groups: Sequence[list[str]], sampled: dict[str, Sampling], x_is_written: bool) -> list[list[str]]:
    """Groups of channels that were sampled together up to here, split where one more header tells them apart."""
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
    """Put a channel into the first group that it may belong to; the header need not have all of them."""
    for group in groups:
        its = next((sampled[other] for other in group if other in sampled), None)
        if its is None or name not in sampled or its.is_like(sampled[name], x_is_written):
            group.append(name)
            return
    groups.append([name])


def equal_columns(names: Sequence[str], blocks: Iterable[Block]) -> list[list[str]]:
    """The columns that hold the same throughout, missing cells at the same places included."""
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
