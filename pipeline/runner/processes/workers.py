"""Processes that tasks run in: a pool of this machine's, which ends with its parent and is replaced where it breaks."""

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor
from concurrent.futures import wait as wait_for
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import get_all_start_methods, get_context, parent_process
from multiprocessing.connection import wait
from threading import Thread
from time import perf_counter

from pipeline.logs.isolated import orphans
from pipeline.runner.execution import Outcome
from pipeline.runner.plan import Task
from pipeline.stages import STAGES

Perform = Callable[[Task], Outcome]

ALONE = 2.0  # [s] of work that is done in this process before others are started, which takes as long
BREAKS = 3  # times that others are replaced


def pool(jobs: int) -> Executor:
    """That many processes; what the stages import is imported once where the system can copy a process."""
    method = "forkserver" if "forkserver" in get_all_start_methods() else "spawn"
    context = get_context(method)
    if method == "forkserver":
        context.set_forkserver_preload(["pipeline.runner.processes.preloaded"])
    return ProcessPoolExecutor(jobs, mp_context=context, initializer=end_with_parent)


def end_with_parent() -> None:
    """End this process when the one that started it has ended, however that came, or the one that began the run."""
    orphans.end_with_parent()
    parent = parent_process()
    if parent is not None:
        Thread(target=_await, args=(parent.sentinel,), daemon=True).start()


def _await(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)


def import_stages() -> None:
    """Import what tasks run."""
    for name in STAGES:
        import_module(f"pipeline.stages.{name}")


@dataclass
class Crew:
    """Runs tasks, in this process or in others, and hands out what came of them as each is done.

    `start` starts the others, and is called only once there is work for them; without it there are none.
    """

    start: Callable[[], Executor] | None = None
    breaks: int = 0  # how often the others had to be replaced

    def __post_init__(self) -> None:
        self._waiting: deque[tuple[Perform, Task]] = deque()
        self._running: dict[Future[Outcome], tuple[Perform, Task]] = {}
        self._worked = 0.0  # [s] in this process
        self._others: Executor | None = None
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
        alone = len(self._waiting) == 1 and not self._running  # whom others would have to wait for as well
        if self.start and not alone and (self._others or self._worked > ALONE):
            self._others = self._others or self.start()
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
            self._worked += perf_counter() - start
            yield outcome

    def _hand_over(self) -> None:
        assert self._others is not None
        while self._waiting:
            perform, task = self._waiting[0]
            self._running[self._others.submit(perform, task)] = perform, task
            self._waiting.popleft()

    def _finished(self) -> Iterator[Outcome]:
        done, _ = wait_for(self._running, return_when=FIRST_COMPLETED)
        if any(isinstance(future.exception(), BrokenExecutor) for future in done):
            done, _ = wait_for(self._running)  # all that were handed over end with it
        lost = [self._running.pop(future) for future in done if isinstance(future.exception(), BrokenExecutor)]
        if lost:
            self._waiting.extendleft(reversed(lost))
            self._replace()
        for future in done:
            if self._running.pop(future, None):
                yield future.result()

    def _replace(self) -> None:
        """Start others in place of those of whom one was ended, and have them do what is not done.

        Which task it was that did not survive is not known: all that were handed over fail together.
        """
        assert self.start is not None
        self.breaks += 1
        if self.breaks > BREAKS:
            raise BrokenExecutor
        self.close()
        self._others = self.start()

    def close(self) -> None:
        """Let the others end."""
        if self._others is not None:
            for future in self._running:
                future.cancel()
            self._others.shutdown()
            self._others = None
