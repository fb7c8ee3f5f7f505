"""Runs stages on a study: what is current is skipped, and the rest is spread over processes."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from multiprocessing import get_context

from pipeline.errors import PipelineError
from pipeline.records import KINDS, store
from pipeline.runner.execution import Outcome, perform
from pipeline.runner.ledger import Entry, Fingerprint, Folders, Ledger
from pipeline.runner.lock import locked
from pipeline.runner.plan import Plan, Task
from pipeline.runner.reuse import reused
from pipeline.runner.signature import declaration
from pipeline.stages import STAGES
from pipeline.study import Study


@dataclass
class Console:
    """How a run speaks: a line at a time, and how far it is."""

    say: Callable[[str], None]
    warn: Callable[[str], None]
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None


@dataclass
class Runner:
    """Runs stages of one study."""

    study: Study
    folders: Folders
    console: Console
    force: bool = False
    jobs: int = 1

    def __post_init__(self) -> None:
        self.ledger = Ledger(self.folders)
        self.plan = Plan(self.study, self.ledger)
        self.failures = 0
        self.ran = 0
        self._pool: ProcessPoolExecutor | None = None

    def run(self, names: Iterable[str]) -> bool:
        """Run these stages in order; whether every task of theirs succeeded.

        Raises
        ------
        PipelineError
            If another run is working on the study, or a stage has nothing to work on.
        """
        names = list(names)
        # One pool for all stages: a process of its own takes seconds to import what the stages need.
        with ExitStack() as stack:
            self._stack = stack
            stack.enter_context(locked(self.folders.processed))
            for leftover in [*store.leftovers(self.folders.processed), *store.leftovers(self.folders.reports)]:
                leftover.unlink()
            self._remove_obsolete()
            for name in names:
                self._stage(name, alone=len(names) == 1)
        return self.failures == 0

    def _remove_obsolete(self) -> None:
        """Remove what an earlier version made under the names of stages and records that there are no more."""
        folders = {kind.folder() for kind in KINDS.values()}
        obsolete = [
            entry
            for entry in list(self.ledger.entries())
            if entry.stage not in STAGES or not {_folder(name) for name in entry.outputs} - {""} <= folders
        ]
        for entry in obsolete:
            self.ledger.remove(entry)
        if obsolete:
            stages = ", ".join(dict.fromkeys(entry.stage for entry in obsolete))
            files = sum(len(entry.outputs) for entry in obsolete)
            self.console.say(f"removed {files} files of {stages} under names that an earlier version used")

    def _stage(self, name: str, alone: bool) -> None:
        asks = declaration(name)
        tasks = list(self.plan.tasks(asks))
        if not tasks and alone:
            kinds = " or ".join(k.__name__ for k in asks.reads)
            raise PipelineError(
                f"{name} has nothing to work on: there are no {kinds} records; run {_before(name)} first"
            )
        planned = {task.name.replace("/", ".") for task in tasks}
        for entry in list(self.ledger.entries(name)):
            if entry.task.replace("/", ".") not in planned:
                self.ledger.remove(entry)
        due: dict[str, tuple[Task, Fingerprint]] = {}
        tasks_by_reason: dict[str, list[str]] = {}
        copied = 0
        for task in tasks:
            now = self.plan.fingerprint(asks, task)
            reasons = ["--force"] if self.force else self.ledger.reasons(self.ledger.entry(name, task.name), now)
            if reasons and not self.force and (other := reused(self.ledger, task, now)):
                self.console.say(f"{name}: copied from {other}, which has the same robot and settings")
                self.ran += 1
                copied += 1
            elif reasons:
                due[task.name] = task, now
                tasks_by_reason.setdefault(_brief(reasons), []).append(task.name)
        for reason, names in tasks_by_reason.items():
            self.console.say(f"{name}: {_listed(names)}: {reason}")
        self._perform(name, due)
        current = len(tasks) - len(due) - copied
        if current:
            self.console.say(f"{name}: {current} of {len(tasks)} current")

    def _perform(self, name: str, due: dict[str, tuple[Task, Fingerprint]]) -> None:
        for done, outcome in enumerate(self._outcomes(due), start=1):
            task, fingerprint = due[outcome.task.name]
            before = self.ledger.entry(name, task.name)
            for stale in set(before.outputs if before else ()) - set(outcome.outputs):
                self.folders.file(stale).unlink(missing_ok=True)
            hashes = {made: self.ledger.digest(made, fresh=True) for made in outcome.outputs}
            self.ledger.write(Entry(name, task.name, asdict(fingerprint), hashes, outcome.failed))
            self.ran += 1
            self.failures += bool(outcome.failed)
            for line in outcome.messages:
                self.console.warn(f"{name}: {line}")
            self.console.progress(name, done, len(due))

    def _outcomes(self, due: dict[str, tuple[Task, Fingerprint]]) -> Iterator[Outcome]:
        calls = [(self.study, self.folders, task, asdict(fingerprint)) for task, fingerprint in due.values()]
        if self.jobs == 1 or len(calls) == 1:
            for call in calls:
                yield perform(*call)
            return
        if self._pool is None:
            self._pool = self._stack.enter_context(ProcessPoolExecutor(self.jobs, mp_context=get_context("spawn")))
        futures: list[Future[Outcome]] = [self._pool.submit(perform, *call) for call in calls]
        for future in as_completed(futures):
            yield future.result()


def _folder(name: str) -> str:
    """The folder of records that a file is in; "" for one that is not a record."""
    root, _, place = name.partition("/")
    return place.partition("/")[0] if root == "processed" else ""


def _brief(reasons: list[str]) -> str:
    return "; ".join(reasons[:2]) + (f"; and {len(reasons) - 2} more" if len(reasons) > 2 else "")


def _listed(tasks: list[str]) -> str:
    return ", ".join(tasks[:3]) + (f" and {len(tasks) - 3} more" if len(tasks) > 3 else "")


def _before(stage: str) -> str:
    index = STAGES.index(stage)
    return STAGES[index - 1] if index else STAGES[0]
