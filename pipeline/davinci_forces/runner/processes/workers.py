"""Run tasks in a pool of processes on this machine, which ends with its parent and is replaced if it breaks."""

import os
import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from concurrent.futures import wait as wait_for
from dataclasses import dataclass
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

Perform = Callable[[Task], Outcome]
Share = list[tuple[Perform, Task]]
Fields = dict[str, Any]  # fields of an outcome, without its task

SECONDS_ALONE = 2.0  # [s] of work in this process before other processes are started; starting them takes about as long
MAX_RESTARTS = 3  # restarts of the pool
SECONDS_PER_SHARE = 0.2  # [s] of work in one handover, since each handover takes milliseconds
MIN_SHARES_LEFT = 4  # per process, so that all processes end at about the same time
MAX_QUEUED_SHARES = 3  # per process; tasks that are not queued yet can still be put into larger shares
METHOD = "forkserver" if "forkserver" in get_all_start_methods() else "spawn"


def prepare() -> None:
    """Start a process that imports the stages, if the system can fork others from it, and do not wait for it."""
    compiled.home()  # sets a temporary one before the other processes start, so that they share it
    if METHOD == "forkserver":
        from multiprocessing import forkserver, resource_tracker

        forkserver.set_forkserver_preload(["davinci_forces.runner.processes.preloaded"])
        resource_tracker.ensure_running()  # starting it later would unblock Ctrl-C
        with process.block_interrupts():
            forkserver.ensure_running()


def pool(jobs: int) -> Executor:
    """A pool of this number of processes."""
    prepare()
    return ProcessPoolExecutor(jobs, mp_context=get_context(METHOD), initializer=end_with_parent)


def end_with_parent() -> None:
    """Make this process end when the process that started it, or the one that began the run, has ended."""
    process.end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # not inherited on every system
    parent = parent_process()
    if parent is not None:
        Thread(target=_await, args=(parent.sentinel,), daemon=True).start()


def _await(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)


def perform_all(share: Sequence[tuple[Perform, Task]]) -> list[Fields]:
    """Run tasks one after the other; return the fields of their outcomes without the tasks, which the caller knows."""
    outcomes = [perform(task) for perform, task in share]
    return [{name: value for name, value in vars(outcome).items() if name != "task"} for outcome in outcomes]


@dataclass(frozen=True)
class WorkerPool:
    """Other processes for tasks: how to start them, their number, and a preparation that takes time."""

    start: Callable[[], Executor]
    hands: int = 2
    prepare: Callable[[], None] = lambda: None


@dataclass
class TaskQueue:
    """Runs tasks here, or in other processes once there is work enough for them; yields each outcome as it comes."""

    others: WorkerPool | None = None
    restarts: int = 0  # of the others

    def __post_init__(self) -> None:
        self._waiting: deque[tuple[Perform, Task]] = deque()
        self._running: dict[Future[list[Fields]], Share] = {}
        self._ended: SimpleQueue[Future[list[Fields]]] = SimpleQueue()
        self._durations: dict[str, float] = {}  # [s] of a task, by step
        self._worked = 0.0  # [s] in this process
        self._prepared = False
        self._started: Executor | None = None
        self.counts = (0, 0)  # tasks that are done, and all tasks

    def submit(self, perform: Perform, task: Task) -> None:
        """Add a task."""
        self._waiting.append((perform, task))
        self.counts = self.counts[0], self.counts[1] + 1

    @property
    def idle(self) -> bool:
        """Whether nothing is waiting or running."""
        return not self._waiting and not self._running

    def outcomes(self) -> Iterator[Outcome]:
        """Wait for the next outcomes: of one task that runs here, or of tasks that other processes have finished.

        Raises BrokenExecutor if other processes were killed too often.
        """
        if self._is_work_for_others():
            assert self.others is not None
            self._started = self._started or self.others.start()
            try:
                self._hand_over(self._started, self.others.hands)
            except BrokenExecutor:  # one was killed while it was idle
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
        """Whether other processes are started or worth starting; prepare them once enough work is expected."""
        if self._started or self.others is None:
            return self._started is not None
        ahead = sum(self._durations.get(task.step, 0.0) for _, task in self._waiting)
        if not self._prepared and self._worked + ahead > SECONDS_ALONE:
            self.others.prepare()
            self._prepared = True
        return self._worked > SECONDS_ALONE and len(self._waiting) > 1  # a single task runs here

    def _learn(self, task: Task, seconds: float) -> None:
        """Count a task as done, and update the duration of a task of its step."""
        self.counts = self.counts[0] + 1, self.counts[1]
        self._durations[task.step] = (self._durations.get(task.step, seconds) + seconds) / 2

    def _hand_over(self, executor: Executor, hands: int) -> None:
        while self._waiting and len(self._running) < MAX_QUEUED_SHARES * hands:
            share = self._next_share(hands)
            try:  # it may start a process, and `close` must know every one
                with process.block_interrupts(signal.SIGTERM):
                    future = executor.submit(perform_all, share)
                    self._running[future] = share
            except BrokenExecutor:
                self._waiting.extendleft(reversed(share))
                raise
            future.add_done_callback(self._ended.put)

    def _next_share(self, hands: int) -> Share:
        """Take the first waiting task, and further tasks as long as they are known to be short."""
        unfinished = len(self._waiting) + sum(map(len, self._running.values()))
        share, seconds = [self._waiting.popleft()], 0.0
        while True:
            seconds += self._durations.get(share[-1][1].step, SECONDS_PER_SHARE)
            is_large = seconds >= SECONDS_PER_SHARE or len(share) * MIN_SHARES_LEFT * hands >= unfinished
            if is_large or not self._waiting:
                return share
            share.append(self._waiting.popleft())

    def _finished(self) -> Iterator[Outcome]:
        ended = [self._ended.get()]
        while not self._ended.empty():
            ended.append(self._ended.get())
        done = [future for future in ended if future in self._running]  # a broken pool leaves other futures
        if any(isinstance(future.exception(), BrokenExecutor) for future in done):
            done = list(wait_for(self._running).done)  # all of the pool have ended
        lost = [self._running.pop(future) for future in done if isinstance(future.exception(), BrokenExecutor)]
        if lost:
            self._waiting.extendleft(reversed([item for share in lost for item in share]))
            self._replace()
        for future in done:
            share = self._running.pop(future, None)
            if share is not None:  # it was not lost
                for (_, task), fields in zip(share, future.result(), strict=True):
                    outcome = Outcome(task, **fields)
                    self._learn(task, outcome.seconds)
                    yield outcome

    def _replace(self) -> None:
        """Replace the pool, whose tasks all fail together if one process is killed: nobody knows which one was lost."""
        self.restarts += 1
        if self.restarts > MAX_RESTARTS:
            raise BrokenExecutor
        self.close()
        assert self.others is not None
        self._started = self.others.start()

    def close(self) -> None:
        """End the other processes, and kill those that still work, since nobody reads their results any more."""
        if self._started is not None:
            pool = getattr(self._started, "_processes", None) if self._running else None
            workers = list((pool or {}).values())
            for worker in workers:
                worker.kill()
            for worker in workers:
                worker.join()
            for future in () if workers else self._running:  # a broken pool cannot report that to a cancelled future
                future.cancel()
            self._started.shutdown(wait=not self._running)
            self._started = None
