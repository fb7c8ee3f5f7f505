"""When the samples of TDMS channels were taken, as the waveform properties of each of their file segments say."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from math import isfinite
from typing import Any, NamedTuple

from davinci_forces.logs.tdms.metadata import EPOCH
from davinci_forces.logs.tdms.walk import Region
from davinci_forces.logs.timeline import Timeline


class Words(NamedTuple):
    """What a file segment says of a channel's clock."""

    step: float  # [s] wf_increment
    offset: float  # [s] wf_start_offset: of the first sample from the start
    start: datetime | None  # wf_start_time, in UTC


@dataclass
class Waveforms:
    """The samples of each channel, and what was said of their clock when they were written."""

    writes: dict[str, list[tuple[int, Words | None]]] = field(default_factory=dict)

    def add(self, region: Region, properties: Mapping[str, Mapping[str, Any]]) -> None:
        """Take in a region, and the properties as they stand there."""
        for path, count in region.counts.items():
            writes = self.writes.setdefault(path, [])
            words = _words(properties.get(path, {}))
            if writes and writes[-1][1] == words:
                writes[-1] = writes[-1][0] + count * region.records, words
            else:
                writes.append((count * region.records, words))

    @property
    def started(self) -> datetime | None:
        """When the first channel started that says so."""
        every = (words.start for writes in self.writes.values() for _, words in writes if words and words.start)
        return next(every, None)

    def timelines(self, zero: datetime | None, properties: Mapping[str, Mapping[str, Any]]) -> dict[str, Timeline]:
        """By path, counted from `zero`; channels that nothing is said of have none.

        Properties may be written behind all samples; those before any was written have the first ones.
        """
        made = {}
        for path, writes in self.writes.items():
            first = next((words for _, words in writes if words), None) or _words(properties.get(path, {}))
            if first:
                made[path] = _timeline([(rows, words or first) for rows, words in writes], zero)
        return made


def _words(properties: Mapping[str, Any]) -> Words | None:
    step, offset, start = (properties.get(f"wf_{word}") for word in ("increment", "start_offset", "start_time"))
    if not isinstance(step, int | float) or not isfinite(step) or step <= 0:
        return None
    offset = offset if isinstance(offset, int | float) and isfinite(offset) else 0.0
    # LabVIEW writes the year 1904 where nobody said when.
    known = isinstance(start, datetime) and start != EPOCH
    return Words(float(step), float(offset), start if known else None)


def _timeline(writes: list[tuple[int, Words]], zero: datetime | None) -> Timeline:
    made, last = Timeline(), None
    for rows, words in writes:
        # The same start with another interval goes on from where the samples are.
        goes_on = last is not None and (last.start, last.offset) == (words.start, words.offset)
        since = (words.start - zero).total_seconds() if words.start and zero else 0.0
        made.add(rows, None if goes_on else since + words.offset, words.step)
        last = words
    return made
