"""When evenly sampled channels were sampled: stretches of one sampling time each, as their writes say."""

from bisect import bisect_right
from dataclasses import dataclass, field

import numpy as np

from davinci_forces.maths.arrays import Array

ROUNDING = 1.5e-6  # [s] two starts written in whole microseconds may be off by so much
SKEW = 0.02  # of a sampling time: channels that stray less than this from each other were sampled together


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
