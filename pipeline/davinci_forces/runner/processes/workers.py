"""Processes that tasks run in: a pool of this machine's, which ends with its parent and is replaced where it breaks."""

import os
import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from concurrent.futures import wait as wait_for
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import get_all_start_methods, get_context, parent_process
from multiprocessing.connection import wait
from queue import SimpleQueue
from threading import Thread
from time import perf_counter
from typing import Any

from davinci_forces.logs.isolated import process
from davinci_forces.maths import compiled
from davinci_forces.runner.execution import Outcome
from davinci_forces.runner.plan import Task
from davinci_forces.stages import STAGES, module

Perform = Callable[[Task], Outcome]
Share = list[tuple[Perform, Task]]
Made = dict[str, Any]  # an outcome's fields but for its task

ALONE = 2.0  # [s] of work that is done in this process before others are started, which takes as long to prepare
BREAKS = 3  # times that others are replaced
HANDED = 0.2  # [s] of work that is handed over at once, where tasks are short: handing over takes milliseconds
SHARES = 4  # that are left for each of the others at least, so that all end at about the same time
AHEAD = 3  # shares that each of the others is handed before it needs them; what waits here makes larger ones
METHOD = "forkserver" if "forkserver" in get_all_start_methods() else "spawn"


def prepare() -> None:
    """Have a process import what the stages import, where the system can copy it then, and do not wait for that."""
    compiled.home()  # a temporary one is shared with processes that start from now on
    if METHOD == "forkserver":
        from multiprocessing import forkserver, resource_tracker

        forkserver.set_forkserver_preload(["davinci_forces.runner.processes.preloaded"])
        resource_tracker.ensure_running()  # which would let Ctrl-C through again
        with process.uninterrupted():
            forkserver.ensure_running()


def pool(jobs: int) -> Executor:
    """That many processes."""
    prepare()
    return ProcessPoolExecutor(jobs, mp_context=get_context(METHOD), initializer=end_with_parent)


def end_with_parent() -> None:
    """End this process when the one that started it has ended, however that came, or the one that began the run."""
    process.end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where the system cannot start processes that ignore it
    parent = parent_process()
    if parent is not None:
        Thread(target=_await, args=(parent.sentinel,), daemon=True).start()


def _await(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)


def import_stages() -> None:
    """Import what tasks run."""
    for name in STAGES:
        import_module(module(name))


def perform_all(share: Sequence[tuple[Perform, Task]]) -> list[Made]:
    """Run tasks, one after the other; what came of each, without the task, which whoever handed it over has."""
    outcomes = [perform(task) for perform, task in share]
    return [{name: value for name, value in vars(outcome).items() if name != "task"} for outcome in outcomes]


@dataclass(frozen=True)
class Others:
    """Processes that tasks can be handed to: how they are started, how many they are, and what takes time before."""

    start: Callable[[], Executor]
    hands: int = 2
    prepare: Callable[[], None] = lambda: None


@dataclass
class Crew:
    """Runs tasks, in this process or in others, and hands out what came of them as each is done.

    Others are started only once there is work for them; they are prepared as soon as that much is in sight.
    """

    others: Others | None = None
    breaks: int = 0  # how often the others had to be replaced

    def __post_init__(self) -> None:
        self._waiting: deque[tuple[Perform, Task]] = deque()
        self._running: dict[Future[list[Made]], Share] = {}
        self._ended: SimpleQueue[Future[list[Made]]] = SimpleQueue()
        self._usual: dict[str, float] = {}  # [s] that a task of a step takes
        self._worked = 0.0  # [s] in this process
        self._prepared = False
        self._started: Executor | None = None
        self.counts = (0, 0)  # tasks that are done, and all that were taken on

    def submit(self, perform: Perform, task: Task) -> None:
        """Take a task on."""
        self._waiting.append((perform, task))
        self.counts = self.counts[0], self.counts[1] + 1

    @property
    def idle(self) -> bool:
        """Whether nothing is waiting or running."""
        return not self._waiting and not self._running

    def outcomes(self) -> Iterator[Outcome]:
        """What came of the tasks that are done first: one that ran here, or all that others finished meanwhile."""
        for outcome in self._outcomes():
            self.counts = self.counts[0] + 1, self.counts[1]
            yield outcome

    def _outcomes(self) -> Iterator[Outcome]:
        """The same, not counted.

        Raises
        ------
        BrokenExecutor
            If the others were ended from outside too often.
        """
        if self._is_work_for_others():
            self._started = self._started or self._start()
            try:
                self._hand_over()
            except BrokenExecutor:  # one was ended while it had nothing to do
                if not self._running:
                    self._replace()
            if self._running:
                yield from self._finished()
        else:
            perform, task = self._waiting.popleft()
            start = perf_counter()
            outcome = perform(task)
            seconds = perf_counter() - start
            self._worked += seconds
            self._learn(task, seconds)
            yield outcome

    def _is_work_for_others(self) -> bool:
        """Whether others are there, or worth starting; they are prepared as soon as the work in sight is enough."""
        if self._started or self.others is None:
            return self._started is not None
        ahead = sum(self._usual.get(task.step, 0.0) for _, task in self._waiting)
        if not self._prepared and self._worked + ahead > ALONE:
            self.others.prepare()
            self._prepared = True
        return self._worked > ALONE and len(self._waiting) > 1  # who is alone would have others wait

    def _learn(self, task: Task, seconds: float) -> None:
        """Remember how long tasks of a step take."""
        self._usual[task.step] = (self._usual.get(task.step, seconds) + seconds) / 2

    def _hand_over(self) -> None:
        assert self._started is not None
        assert self.others is not None
        while self._waiting and len(self._running) < AHEAD * self.others.hands:
            share = self._next_share(self.others.hands)
            try:
                future = self._started.submit(perform_all, share)
            except BrokenExecutor:
                self._waiting.extendleft(reversed(share))
                raise
            self._running[future] = share
            future.add_done_callback(self._ended.put)

    def _next_share(self, hands: int) -> Share:
        """Of the tasks that wait, the first, and with it others, as long as all of them are known to be short."""
        left = len(self._waiting) + sum(map(len, self._running.values()))
        share, seconds = [self._waiting.popleft()], 0.0
        while True:
            seconds += self._usual.get(share[-1][1].step, HANDED)
            if not self._waiting or seconds >= HANDED or len(share) * SHARES * hands >= left:
                return share
            share.append(self._waiting.popleft())

    def _finished(self) -> Iterator[Outcome]:
        ended = [self._ended.get()]
        while not self._ended.empty():
            ended.append(self._ended.get())
        done = [future for future in ended if future in self._running]  # others may have been of a pool that broke
        if any(isinstance(future.exception(), BrokenExecutor) for future in done):
            done = list(wait_for(self._running).done)  # all that were handed over end with it
        lost = [self._running.pop(future) for future in done if isinstance(future.exception(), BrokenExecutor)]
        if lost:
            self._waiting.extendleft(reversed([each for share in lost for each in share]))
            self._replace()
        for future in done:
            share = self._running.pop(future, None)
            if share is not None:  # which was not lost
                yield from self._of_share(share, future.result())

    def _of_share(self, share: Share, made: Sequence[Made]) -> Iterator[Outcome]:
        """What came of the tasks of a share, and from it how long such tasks take."""
        for (_, task), fields in zip(share, made, strict=True):
            outcome = Outcome(task, **fields)
            self._learn(task, outcome.seconds)
            yield outcome

    def _replace(self) -> None:
        """Start others in place of those of whom one was ended, and have them do what is not done.

        Which task it was that did not survive is not known: all that were handed over fail together.
        """
        self.breaks += 1
        if self.breaks > BREAKS:
            raise BrokenExecutor
        self.close()
        self._started = self._start()

    def _start(self) -> Executor:
        assert self.others is not None
        return self.others.start()

    def close(self) -> None:
        """Let the others end; at once where the run ends before their tasks do, which nobody takes any more."""
        if self._started is not None:
            pool = getattr(self._started, "_processes", None) if self._running else None
            others = list((pool or {}).values())
            for other in others:
                other.kill()
            for other in others:
                other.join()
            for future in () if others else self._running:  # a pool cannot tell a cancelled one that it has broken
                future.cancel()
            self._started.shutdown(wait=not self._running)
            self._started = None
