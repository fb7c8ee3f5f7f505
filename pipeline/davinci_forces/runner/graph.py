"""The order of a run: a call about a log waits for that log's results, a step that reads all logs for those of all."""

from collections.abc import Iterable, Sequence
from functools import cache
from graphlib import TopologicalSorter
from heapq import heappop, heappush
from itertools import takewhile
from typing import NamedTuple

from davinci_forces.report import REPORT
from davinci_forces.runner.plan import is_about_log
from davinci_forces.runner.signature import Declaration, declaration, stage_of, steps
from davinci_forces.stages import GROUPS, STAGES

ALL_LOGS = ""  # the log of a part that is about all logs


class Part(NamedTuple):
    """The calls of a step about one log.

    The part of `ALL_LOGS` is the whole step; if a step runs log by log, this part only marks that all logs are done.
    """

    step: str
    log: str


class Graph:
    """The parts of a run, given out as soon as they are ready, the earliest step first."""

    def __init__(self, names: Sequence[str], logs: Sequence[str]) -> None:
        self.parts = [part for name in names for part in _parts(name, logs)]
        self._rank = {part: i for i, part in enumerate(self.parts)}
        of_run = self._rank.keys()
        self._order = TopologicalSorter({part: of_run & _sources(part, names, logs) for part in self.parts})
        self._order.prepare()
        self._ready: list[int] = []

    def next(self) -> list[Part]:
        """Take the ready parts of one step; none if all parts have begun or wait for other parts."""
        for part in self._order.get_ready():
            heappush(self._ready, self._rank[part])
        batch: list[Part] = []
        while self._ready and (not batch or self.parts[self._ready[0]].step == batch[0].step):
            batch.append(self.parts[heappop(self._ready)])
        return batch

    def finish(self, part: Part) -> None:
        """Mark a part as done; parts that waited only for this part become ready."""
        self._order.done(part)


def stages_of(names: Iterable[str]) -> set[str]:
    """The stages of these names: a group stands for its stages, any other name for itself."""
    return {stage for name in names for stage in GROUPS.get(name, (name,))}


def required_steps(names: Iterable[str]) -> list[str]:
    """The steps of these stages and groups, and the steps that make their inputs, in the order of a run."""
    named = stages_of(names)
    everything = REPORT in named  # the report reads the records of all stages
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
    """The steps of all stages, or of those up to the stage of a number, in order."""
    return tuple(step for stage in STAGES[: last + 1] for step in steps(stage))


def goes_by_log(asks: Declaration) -> bool:
    """Whether every call of a step is about one log."""
    kinds = [kind for kinds in asks.each.values() for kind in kinds]
    return bool("log" in asks.given.values() or asks.per_log or (kinds and all(map(is_about_log, kinds))))


def _parts(step: str, logs: Sequence[str]) -> list[Part]:
    by_log = step != REPORT and goes_by_log(declaration(step))
    return [*(Part(step, log) for log in logs if by_log), Part(step, ALL_LOGS)]


def _sources(part: Part, names: Iterable[str], logs: Sequence[str]) -> list[Part]:
    """The parts that make the records that this part reads."""
    if part.step == REPORT:
        return [Part(name, ALL_LOGS) for name in names if name != REPORT]
    if part.log == ALL_LOGS and goes_by_log(declaration(part.step)):
        return [Part(part.step, log) for log in logs]
    return [Part(name, part.log if same_log else ALL_LOGS) for name, same_log in _makers(part.step)]


@cache
def _makers(step: str) -> tuple[tuple[str, bool], ...]:
    """The steps that make a step's inputs, and whether a part of the step reads only their records of its own log."""
    asks = declaration(step)
    earlier = takewhile(lambda name: name != step, every_step(STAGES.index(stage_of(step))))
    return tuple(
        (name, goes_by_log(asks) and goes_by_log(declaration(name)) and is_about_log(kind))
        for name in earlier
        for kind in {*declaration(name).makes} & {*asks.reads}
    )
