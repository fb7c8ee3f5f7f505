"""Which channels say when the channels that a study uses were sampled, and their times in seconds."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.logs.joined import Alignment, Follower, Timed, aligned
from davinci_forces.logs.log import COUNTED, Block, Log
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.signals.clock import GAP
from davinci_forces.study import LogEntry, Source

ALIGNED = ""  # under this name a block holds the times of channels that were put on one clock [s]


@dataclass(frozen=True)
class Together:
    """Channels of one clock, and the channel of their times; "" where samples are counted."""

    names: tuple[str, ...]
    time: str
    is_stated: bool  # the study names this channel


@dataclass
class UsedClocks:
    """The clocks of the channels that a study uses; `scale` is what one unit of its time is in SI."""

    log: Log
    entry: LogEntry
    scale: float
    used: Sequence[str]  # channels of quantities
    reference: str  # of them, the one whose clock all others are put on
    done: Alignment = field(default_factory=Alignment)

    def __post_init__(self) -> None:
        groups = [part for own, names in self.log.by_clock(self.used).items() for part in self._split(own, names)]
        if self.stated and not any(group.is_stated for group in groups):
            raise BadLog(
                f"{self.log.path}: time = {self.stated.channel!r} was not sampled with any channel that is used; the "
                "log says when these were: leave time out of [log.channels]"
            )
        self.groups = sorted(groups, key=lambda group: self.reference not in group.names)

    @property
    def stated(self) -> Source | None:
        """What the study says of the time."""
        return next((source for source in self.entry.channels if source.quantity == "time"), None)

    @property
    def are_several(self) -> bool:
        """Whether channels have to be put on one clock."""
        return len(self.groups) > 1

    @property
    def known(self) -> bool:
        """Whether every clock says seconds."""
        return all(map(self._is_known, self.groups))

    @property
    def time(self) -> str:
        """The channel of the times of all, or ""."""
        return self.groups[0].time if not self.are_several else ""

    @property
    def times_used(self) -> list[str]:
        """The channels of times of all clocks."""
        return [group.time for group in self.groups if group.time]

    def _is_known(self, group: Together) -> bool:
        own = next(iter(self.log.by_clock(group.names)))
        if group.time and not group.is_stated and self.log.find(group.time).unit == COUNTED:
            return False
        return bool(group.time or self.entry.rate or (self.log.clock and not own))

    def _split(self, own: str, names: Sequence[str]) -> Iterator[Together]:
        """Channels of one clock of the log, by the times that the study names among them."""
        meant = self.log.times_called(self.stated.channel) if self.stated else []
        stated = [channel.name for channel in meant if own in self.log.by_clock([channel.name])]
        if not stated:
            yield Together(tuple(names), "" if self.entry.rate else own or self.log.time, is_stated=False)
            return
        near: dict[str, list[str]] = {}
        for name in names:
            same_group = (time for time in stated if time.rpartition("/")[0] == name.rpartition("/")[0])
            near.setdefault(next(same_group, stated[0]), []).append(name)
        for time, of in near.items():
            yield Together(tuple(of), time, is_stated=True)

    def blocks(self) -> Iterator[Block]:
        """The samples of all channels, on one clock where there are several."""
        if not self.are_several:
            names = (*self.groups[0].names, *([self.time] if self.time else []))
            yield from self.log.blocks(list(dict.fromkeys(names)))
            return
        if not self.known:
            without = next(group for group in self.groups if not self._is_known(group))
            raise BadLog(
                f"{self.log.path}: nothing says when channel {without.names[0]!r} was sampled, and other channels that "
                "are used have clocks of their own; name its time in [log.channels], say rate = ... [Hz] for all, or "
                "leave it out"
            )
        logs = [self.log.apart() for _ in self.groups]
        first, *others = (self._timed(log, group) for log, group in zip(logs, self.groups, strict=True))
        followers = {_listed(group.names): each for group, each in zip(self.groups[1:], others, strict=True)}
        try:
            for t, block in aligned(first, followers, self.done, lambda why: BadLog(f"{self.log.path}: {why}")):
                yield block | {ALIGNED: t}
        finally:
            self._noticed(logs)

    def _timed(self, log: Log, group: Together) -> Iterator[Timed]:
        rows = 0
        for block in log.blocks(list(dict.fromkeys((*group.names, *([group.time] if group.time else []))))):
            count = len(next(iter(block.values())))
            yield self.times(block, rows, count, group), {name: block[name] for name in group.names}
            rows += count

    def _noticed(self, logs: Sequence[Log]) -> None:
        """Put together what the passes noticed."""
        for log in logs:
            self.log.warnings += [warning for warning in log.warnings if warning not in self.log.warnings]
            self.log.comments += [comment for comment in log.comments if comment not in self.log.comments]
            self.log.nulls, self.log.nans = self.log.nulls | log.nulls, self.log.nans | log.nans
            self.log.dropped = max(self.log.dropped, log.dropped)

    def times(self, block: Block, rows: int, count: int, group: Together | None = None) -> Array:
        """Times of `count` rows of a block [s] that follow `rows` others; their numbers where nothing says more."""
        if ALIGNED in block:
            return block[ALIGNED]
        group = group or self.groups[0]
        number = rows + np.arange(count)
        if group.is_stated and self.stated:
            return (block[group.time] + self.stated.offset) * (self.stated.sign * self.scale)
        if self.entry.rate:
            return number / self.entry.rate
        if group.time:
            return block[group.time]
        if self.log.clock is None:
            return number.astype(np.float64)
        return np.asarray(self.log.clock.start + number * self.log.clock.step, dtype=np.float64)

    def note(self) -> Iterator[str]:
        """What was done to put channels on one clock."""
        done, name = self.done, self.entry.name
        if not done.changed:
            return
        how = "; ".join(_how(each, other) for each, other in done.others.items())
        yield (
            f"{name}: channels with clocks of their own were put on that of {_listed(self.groups[0].names)} "
            f"({1 / done.period:.6g} Hz): {how}"
        )
        if done.left_out:
            yield (
                f"{name}: {done.left_out} of {done.kept + done.left_out} rows are left out, where another clock has "
                f"no sample on either side within {GAP:g} of its sampling times"
            )


def _how(name: str, other: Follower) -> str:
    """What was done to the channels of one clock."""
    rate = f"{name} ({1 / other.period:.6g} Hz)" if other.period else name
    if not other.interpolated:
        return f"{rate} at the same times"
    mean = f"means of {other.many} samples, and " if other.many > 1 else ""
    return f"{rate} by {mean}cubics between neighbours, across no gap"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(repr(name) for name in names[:4]) + (" ..." if len(names) > 4 else "")
