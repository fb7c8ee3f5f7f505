"""What waits for what: the calls of a stage about one log need what was made of that log, and only a stage that reads
all logs waits for all of them.
"""

from collections.abc import Iterable, Sequence
from functools import cache
from heapq import heappop, heappush
from typing import NamedTuple

from davinci_forces.report import REPORT
from davinci_forces.runner.places import is_about_log
from davinci_forces.runner.signature import Declaration, declaration
from davinci_forces.stages import STAGES

WHOLE = ""  # in place of a log: all that a stage has to do


class Part(NamedTuple):
    """What a stage has to do about one log; or the whole of it, which where it goes log by log is when all are done."""

    stage: str
    log: str


class Graph:
    """The parts of a run in the order in which they may begin: of those that are ready, the earliest stage first."""

    def __init__(self, names: Sequence[str], logs: Sequence[str]) -> None:
        self.parts = [part for name in names for part in _parts(name, logs)]
        self._rank = {part: i for i, part in enumerate(self.parts)}
        self._waits: dict[Part, int] = {}
        self._followers: dict[Part, list[Part]] = {}
        self._ready: list[tuple[int, Part]] = []
        for part in self.parts:
            awaited = [other for other in dict.fromkeys(_awaited(part, names, logs)) if other in self._rank]
            self._waits[part] = len(awaited)
            for other in awaited:
                self._followers.setdefault(other, []).append(part)
            if not awaited:
                heappush(self._ready, (self._rank[part], part))

    def next(self) -> list[Part]:
        """The parts of one stage that may begin and have not; none where all have, or wait for one that is not done."""
        batch: list[Part] = []
        while self._ready and (not batch or self._ready[0][1].stage == batch[0].stage):
            batch.append(heappop(self._ready)[1])
        return batch

    def done(self, part: Part) -> None:
        """Let what waited for a part begin."""
        for follower in self._followers.get(part, ()):
            self._waits[follower] -= 1
            if not self._waits[follower]:
                heappush(self._ready, (self._rank[follower], follower))


def goes_by_log(asks: Declaration) -> bool:
    """Whether every call of a stage is about one log."""
    kinds = [kind for kinds in asks.each.values() for kind in kinds]
    return bool("log" in asks.given.values() or asks.per_log or (kinds and all(map(is_about_log, kinds))))


def _parts(name: str, logs: Sequence[str]) -> list[Part]:
    by_log = name != REPORT and goes_by_log(declaration(name))
    return [*(Part(name, log) for log in logs if by_log), Part(name, WHOLE)]


def _awaited(part: Part, names: Iterable[str], logs: Sequence[str]) -> list[Part]:
    """The parts that make what this one reads, as far as one of these stages makes it at all."""
    if part.stage == REPORT:
        return [Part(name, WHOLE) for name in names if name != REPORT]
    if part.log == WHOLE and goes_by_log(declaration(part.stage)):
        return [Part(part.stage, log) for log in logs]
    return [Part(name, part.log if own else WHOLE) for name, own in _makers(part.stage)]


@cache
def _makers(stage: str) -> tuple[tuple[str, bool], ...]:
    """The stages that make what this one reads, each with whether what they made of a log is enough for that log."""
    asks = declaration(stage)
    return tuple(
        (name, goes_by_log(asks) and goes_by_log(declaration(name)) and is_about_log(kind))
        for name in STAGES[: STAGES.index(stage)]
        for kind in {*declaration(name).makes} & {*asks.reads}
    )
