"""Missing samples of the channels that a study uses: short runs are filled, the rows of longer ones left out."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from davinci_forces.logs.joined import FILLED_IN, TimedBlock
from davinci_forces.logs.log import Log
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.signals.clock import fill, is_slower
from davinci_forces.records.record import groups_of

MAX_MISSING = 0.2  # of a channel's samples; with more of them missing, the log is refused
REACH_ROWS = 1 << 10  # rows on either side that filling looks at; a longer run of missing samples is a gap


def split_by_rhythm(t: Array, block: dict[str, Array], names: Sequence[str]) -> list[tuple[str, ...]]:
    """Group channels by the rows that hold their samples; empty if none has a slower rhythm, so that samples miss."""
    slower = {name: mask for name in names if is_slower(t, mask := np.isnan(block[name]))}
    rows = ((slower[name].tobytes() if name in slower else b"", name) for name in names) if slower else ()
    return [tuple(group) for group in groups_of(rows).values()]


def without_empty_rows(timed: Iterator[TimedBlock], names: Sequence[str]) -> Iterator[TimedBlock]:
    """Leave out the rows without a sample of any of these channels."""
    for t, block in timed:
        rows = ~np.all([np.isnan(block[name]) for name in names], axis=0)
        yield t[rows], {name: values[rows] for name, values in block.items()}


@dataclass
class Missing:
    """The missing samples of one channel, or the rows left out, and of those the ones after the last whole row."""

    rows: int = 0
    count: int = 0
    at_end: int = 0
    first: int = -1  # row of the first one


@dataclass
class MissingSamples:
    """The missing samples of a log up to a time, by channel, and their rows."""

    until: float = np.inf  # [s] from the first sample
    channels: dict[str, Missing] = field(default_factory=dict)
    filled_rows: int = 0
    left_out: Missing = field(default_factory=Missing)  # rows with longer runs

    def without_missing(self, timed: Iterator[TimedBlock], names: Sequence[str]) -> Iterator[TimedBlock]:
        """Yield the rows in which no sample of these channels is missing; `FILLED_IN` is 1 where one was filled in."""
        self.channels |= {name: Missing() for name in names}
        t, block, done, T_s, end = np.empty(0), dict[str, Array](), 0, 0.0, np.nan
        for new_t, new in timed:
            t = np.concatenate([t, new_t])
            block = {name: np.concatenate([block[name], x]) for name, x in new.items()} if block else new
            if len(t) > 1 and np.isnan(end):
                T_s, end = float(np.median(np.diff(t))), float(t[0]) + self.until
            waits = any(np.isnan(block[name][done:]).any() for name in names)
            ready = max(len(t) - REACH_ROWS, done) if waits else len(t)  # missing samples wait for rows that follow
            yield self._part(t, block, names, slice(done, ready), T_s, end)
            begin = max(ready - REACH_ROWS, 0)
            t, block, done = t[begin:], {name: x[begin:] for name, x in block.items()}, ready - begin
        if done < len(t):
            yield self._part(t, block, names, slice(done, len(t)), T_s, end)

    def _part(
        self, t: Array, block: dict[str, Array], names: Sequence[str], part: slice, T_s: float, end: float
    ) -> TimedBlock:
        """The rows of a part of a block (N,) in which no sample is missing any more."""
        missing = {name: np.isnan(block[name][part]) for name in names}
        filled = {name: fill(t, block[name], T_s)[part] for name, mask in missing.items() if mask.any()}
        flags, rows = np.any([*missing.values()], axis=0), {name: x[part] for name, x in block.items()} | filled
        whole = ~np.any([np.isnan(rows[name]) for name in names], axis=0)
        self._count(missing, whole, ~(t[part] > end))
        rows[FILLED_IN] = flags.astype(np.float64)
        return t[part][whole], {name: x[whole] for name, x in rows.items()}

    def _count(self, missing: dict[str, Booleans], whole: Booleans, counted: Booleans) -> None:
        """Count the missing samples of rows that are used or left out, and the rows."""
        after = int(np.flatnonzero(whole)[-1]) + 1 if whole.any() else 0
        states = [*(self.channels[name] for name in missing), self.left_out]
        for state, lacks in zip(states, (*missing.values(), ~whole), strict=True):
            mask = lacks & counted
            if mask.any() and state.first < 0:
                state.first = state.rows + int(np.argmax(mask))
            state.rows += int(counted.sum())
            state.count += int(mask.sum())
            state.at_end = int(mask[after:].sum()) + (0 if whole.any() else state.at_end)
        self.filled_rows += int((whole & counted & np.any([*missing.values()], axis=0)).sum())

    def require_most(self, log: Log) -> None:
        """Refuse a log if too many samples of a channel are missing; a truncated file may lack its end."""
        for name, channel in self.channels.items():
            end = channel.at_end if log.cut else 0
            if channel.count - end > MAX_MISSING * (channel.rows - end):
                what = "has no sample" if log.nulls.get(name, 0) else "holds nan"
                first = f"channel {name!r} {what} at row {channel.first} (counted from 0)"
                share = f"{channel.count} of its {channel.rows} rows lack a number, more than {MAX_MISSING:.0%}"
                remedy = "record the log again, or leave the channel out"
                raise log.bad(f"{first}, and {share}, in no regular rhythm; {remedy}")
