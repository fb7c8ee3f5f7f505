"""Where the samples of a TDMS file lie, found in one walk over it, so that any channel is read without another."""

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from davinci_forces.logs.tdms.walk import Column, Region


@dataclass(frozen=True)
class Records:
    """What records of one kind hold: where the samples of each channel lie, and how many there are."""

    columns: dict[str, Column]
    counts: dict[str, int]


@dataclass
class Index:
    """The regions of a file.  A region is four numbers, so that millions of them fit."""

    kinds: list[Records] = field(default_factory=list)
    _holding: dict[str, list[int]] = field(default_factory=dict)  # by path: the kinds that hold samples of it
    _by_kind: list[NDArray[np.intp]] = field(default_factory=list)  # numbers of regions, once all are there
    _numbers: dict[tuple[object, ...], int] = field(default_factory=dict)  # of the kinds
    _regions: tuple["array[int]", ...] = field(default_factory=lambda: tuple(array("q") for _ in range(4)))

    def add(self, region: Region) -> None:
        """Take in a region."""
        self._by_kind = []
        last = self.kinds[self._regions[3][-1]] if self.kinds else None
        if last and last.columns == region.columns and last.counts == region.counts:
            kind = self._regions[3][-1]
        else:
            key = (*region.columns.items(), *region.counts.items())
            kind = self._numbers.setdefault(key, len(self.kinds))
            if kind == len(self.kinds):
                self.kinds.append(Records(region.columns, region.counts))
                for path in (path for path, count in region.counts.items() if count):
                    self._holding.setdefault(path, []).append(kind)
        for numbers, value in zip(self._regions, (region.position, region.records, region.stride, kind), strict=True):
            numbers.append(value)

    def together(self, paths: Sequence[str]) -> list[list[str]]:
        """The channels that can be read in one go: those with as many samples as each other in every record."""
        groups: dict[tuple[tuple[int, int], ...], list[str]] = {}
        for path in paths:
            counts = ((kind, self.kinds[kind].counts[path]) for kind in self._holding.get(path, ()))
            groups.setdefault(tuple(counts), []).append(path)
        return list(groups.values())

    def regions(self, path: str) -> Iterator[Region]:
        """The regions that hold samples of a channel, in order."""
        position, records, stride, _ = self._regions
        for i in self._places(path) if path in self._holding else ():
            of = self.kinds[self._regions[3][i]]
            yield Region(position[i], records[i], stride[i], of.columns, of.counts)

    def _places(self, path: str) -> list[int]:
        """Numbers of the regions that hold samples of a channel, in order."""
        if not self._by_kind and self.kinds:
            kind = np.frombuffer(self._regions[3], np.int64)
            order = np.argsort(kind, kind="stable")
            self._by_kind = np.split(order, np.searchsorted(kind[order], np.arange(1, len(self.kinds))))
        holding = [self._by_kind[kind] for kind in self._holding.get(path, ())]
        places: list[int] = (holding[0] if len(holding) == 1 else np.sort(np.concatenate(holding))).tolist()
        return places

    def largest_chunk(self, paths: Sequence[str]) -> int:
        """Most samples of any of these channels in one record."""
        return max((self.kinds[kind].counts[p] for p in paths for kind in self._holding.get(p, ())), default=0)
