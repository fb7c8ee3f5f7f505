"""What waits for what: the calls of a step about one log need what was made of that log, and only a step that reads
all logs waits for all of them.
"""

from collections.abc import Iterable, Sequence
from functools import cache
from heapq import heappop, heappush
from itertools import takewhile
from typing import NamedTuple

from davinci_forces.report import REPORT
from davinci_forces.runner.places import is_about_log
from davinci_forces.runner.signature import Declaration, declaration, stage_of, steps
from davinci_forces.stages import GROUPS, STAGES

WHOLE = ""  # in place of a log: all that a step has to do


class Part(NamedTuple):
    """What a step has to do about one log; or the whole of it, which where it goes log by log is when all are done."""

    step: str
    log: str


class Graph:
    """The parts of a run in the order in which they may begin: of those that are ready, the earliest step first."""

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
        """The parts of one step that may begin and have not; none where all have, or wait for one that is not done."""
        batch: list[Part] = []
        while self._ready and (not batch or self._ready[0][1].step == batch[0].step):
            batch.append(heappop(self._ready)[1])
        return batch

    def done(self, part: Part) -> None:
        """Let what waited for a part begin."""
        for follower in self._followers.get(part, ()):
            self._waits[follower] -= 1
            if not self._waits[follower]:
                heappush(self._ready, (self._rank[follower], follower))


def stages_of(names: Iterable[str]) -> set[str]:
    """The stages that names stand for, of which some are those of groups; the report stands for itself."""
    return {stage for name in names for stage in GROUPS.get(name, (name,))}


def needed(names: Iterable[str]) -> list[str]:
    """The steps of these stages and groups and, before them, those that make what they read, in their order."""
    named = stages_of(names)
    everything = REPORT in named  # which it reads
    last = max((i for i, stage in enumerate(STAGES) if everything or stage in named), default=-1)
    read: set[type] = set()
    wanted = [REPORT] * everything
    for step in reversed(every_step(last)):
        asks = declaration(step)
        if everything or stage_of(step) in named or read & {*asks.makes}:
            wanted.append(step)
            read |= {*asks.reads}
    return wanted[::-1]


@cache
def every_step(last: int = len(STAGES) - 1) -> tuple[str, ...]:
    """The steps of all stages, or of those up to one by its number, in their order."""
    return tuple(step for stage in STAGES[: last + 1] for step in steps(stage))


def goes_by_log(asks: Declaration) -> bool:
    """Whether every call of a step is about one log."""
    kinds = [kind for kinds in asks.each.values() for kind in kinds]
    return bool("log" in asks.given.values() or asks.per_log or (kinds and all(map(is_about_log, kinds))))


def _parts(step: str, logs: Sequence[str]) -> list[Part]:
    by_log = step != REPORT and goes_by_log(declaration(step))
    return [*(Part(step, log) for log in logs if by_log), Part(step, WHOLE)]


def _awaited(part: Part, names: Iterable[str], logs: Sequence[str]) -> list[Part]:
    """The parts that make what this one reads, as far as one of these steps makes it at all."""
    if part.step == REPORT:
        return [Part(name, WHOLE) for name in names if name != REPORT]
    if part.log == WHOLE and goes_by_log(declaration(part.step)):
        return [Part(part.step, log) for log in logs]
    return [Part(name, part.log if own else WHOLE) for name, own in _makers(part.step)]


@cache
def _makers(step: str) -> tuple[tuple[str, bool], ...]:
    """The steps that make what this one reads, each with whether what they made of a log is enough for that log."""
    asks = declaration(step)
    earlier = takewhile(lambda name: name != step, every_step(STAGES.index(stage_of(step))))
    return tuple(
        (name, goes_by_log(asks) and goes_by_log(declaration(name)) and is_about_log(kind))
        for name in earlier
        for kind in {*declaration(name).makes} & {*asks.reads}
    )
