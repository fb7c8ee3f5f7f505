"""Which channels of a LabVIEW measurement file share a clock: a header says start and interval of each, cells x."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from davinci_forces.logs.log import Block
from davinci_forces.logs.timeline import ROUNDING, SKEW


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
