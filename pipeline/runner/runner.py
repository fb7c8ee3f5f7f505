"""Runs stages on a study: what is current is skipped, and the rest is spread over processes."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from functools import partial
from multiprocessing import get_context
from time import perf_counter

from pipeline.errors import BadRequest, PipelineError
from pipeline.records import KINDS, store
from pipeline.report import REPORT
from pipeline.runner import STEPS, reporting
from pipeline.runner.console import Console
from pipeline.runner.execution import Outcome, perform
from pipeline.runner.ledger import Entry, Folders, Ledger, file_name
from pipeline.runner.lock import locked
from pipeline.runner.plan import Plan, Task
from pipeline.runner.reuse import reused
from pipeline.runner.signature import Declaration, declaration
from pipeline.stages import STAGES
from pipeline.study import Study

Perform = Callable[[Task], Outcome]


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
        self.seconds: dict[str, float] = {}  # that each step took
        self._pool: ProcessPoolExecutor | None = None
        self.writable = True

    def run(self, names: Iterable[str]) -> bool:
        """Run these stages, and the report, in order; whether every task of theirs succeeded.

        Raises
        ------
        PipelineError
            If another run is working on the study, or a stage has nothing to work on.
        """
        names = list(names)
        # One pool for all stages: a process of its own takes seconds to import what the stages need.
        with ExitStack() as stack:
            self._stack = stack
            self.writable = stack.enter_context(locked(self.folders.processed))
            if self.writable:
                for leftover in [*store.leftovers(self.folders.processed), *store.leftovers(self.folders.reports)]:
                    leftover.unlink()
                self._remove_obsolete()
            for name in names:
                start = perf_counter()
                if name == REPORT:
                    self._bring_up_to_date(name, [reporting.task(self.plan)], partial(reporting.perform, self.ledger))
                else:
                    self._stage(name, alone=len(names) == 1)
                self.seconds[name] = perf_counter() - start
        return self.failures == 0

    def preview(self, names: Iterable[str]) -> Iterator[str]:
        """What a run of these stages would do and why, as far as that is known before it: it changes nothing."""
        before: list[str] = []
        for name in names:
            tasks = [reporting.task(self.plan)] if name == REPORT else list(self.plan.tasks(declaration(name)))
            by_reason: dict[str, list[str]] = {}
            for task in tasks:
                entry = self.ledger.entry(name, task.name)
                if reasons := ["--force"] if self.force else self.ledger.reasons(entry, task.fingerprint):
                    by_reason.setdefault(_brief(reasons), []).append(task.name)
            yield from (f"{_listed(name, due)}: would run: {reason}" for reason, due in by_reason.items())
            if before and not by_reason:
                yield f"{name}: waits for what {before[-1]} makes"
            elif len(tasks) > (due := sum(map(len, by_reason.values()))):
                yield f"{name}: {len(tasks) - due} of {len(tasks)} current"
            before += [name] if by_reason else []

    def _remove_obsolete(self) -> None:
        """Remove what an earlier version made under the names of stages and records that there are no more."""
        folders = {kind.folder() for kind in KINDS.values()}
        obsolete = [
            entry
            for entry in list(self.ledger.entries())
            if entry.stage not in STEPS or not {_folder(name) for name in entry.outputs} - {""} <= folders
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
            if awaited := self._awaits(asks):
                kinds = " or ".join(k.__name__ for k in asks.reads)
                raise PipelineError(f"{name} has nothing to work on: there are no {kinds} records; run {awaited} first")
            self.console.say(f"{name}: the study holds nothing for it")
        self._bring_up_to_date(name, tasks, partial(perform, self.folders))

    def _awaits(self, asks: Declaration) -> str:
        """The first stage that has not been run and that this one needs, by way of others or itself; "" for none."""
        for name in STAGES[: STAGES.index(asks.name)]:
            maker = declaration(name)
            if {*maker.makes} & {*asks.reads}:
                if awaited := self._awaits(maker):
                    return awaited
                if any(self.ledger.entry(name, task.name) is None for task in self.plan.tasks(maker)):
                    return name
        return ""

    def _bring_up_to_date(self, name: str, tasks: list[Task], perform: Perform) -> None:
        """Perform what is not current of all the tasks there are, and forget those that are no more."""
        self._require_writable(name, tasks)
        planned = {file_name(task.name) for task in tasks}
        for obsolete in [entry for entry in self.ledger.entries(name) if file_name(entry.task) not in planned]:
            self.ledger.remove(obsolete)
        due: list[Task] = []
        tasks_by_reason: dict[str, list[str]] = {}
        copied = 0
        for task in tasks:
            entry = self.ledger.entry(name, task.name)
            reasons = ["--force"] if self.force else self.ledger.reasons(entry, task.fingerprint)
            if reasons and not self.force and (other := reused(self.ledger, task)):
                self.console.say(f"{name}: copied from {other}, which has the same robot and settings")
                self.ran += 1
                copied += 1
            elif reasons:
                due.append(task)
                tasks_by_reason.setdefault(_brief(reasons), []).append(task.name)
        for reason, names in tasks_by_reason.items():
            self.console.say(f"{_listed(name, names)}: {reason}")
        for done, outcome in enumerate(self._outcomes(due, perform), start=1):
            self._record(outcome)
            self.console.progress(name, done, len(due))
        if current := len(tasks) - len(due) - copied:
            self.console.say(f"{name}: {current} of {len(tasks)} current")

    def _require_writable(self, name: str, tasks: list[Task]) -> None:
        """Refuse to begin what could not be kept."""
        for task in tasks:
            if not self.writable and (
                reasons := self.ledger.reasons(self.ledger.entry(name, task.name), task.fingerprint)
            ):
                raise BadRequest(
                    f"{self.folders.processed} cannot be written to, and {name} has to run: {_brief(reasons)}; allow "
                    "writing, or name other folders with --processed and --reports"
                )

    def _record(self, outcome: Outcome) -> None:
        """Remember what a task made, and remove what it made before and does no more."""
        task = outcome.task
        before = self.ledger.entry(task.stage, task.name)
        for stale in set(before.outputs if before else ()) - set(outcome.outputs):
            self.folders.file(stale).unlink(missing_ok=True)
        hashes = {made: self.ledger.digest(made, fresh=True) for made in outcome.outputs}
        self.ledger.write(Entry(task.stage, task.name, asdict(task.fingerprint), hashes, outcome.failed))
        self.ran += 1
        self.failures += bool(outcome.failed)
        for line in outcome.messages:
            self.console.warn(f"{task.stage}: {line}")

    def _outcomes(self, due: list[Task], perform: Perform) -> Iterator[Outcome]:
        if self.jobs == 1 or len(due) == 1:
            yield from map(perform, due)
            return
        if self._pool is None:
            self._pool = self._stack.enter_context(ProcessPoolExecutor(self.jobs, mp_context=get_context("spawn")))
        futures: list[Future[Outcome]] = [self._pool.submit(perform, task) for task in due]
        for future in as_completed(futures):
            yield future.result()


def _folder(name: str) -> str:
    """The folder of records that a file is in; "" for one that is not a record."""
    root, _, place = name.partition("/")
    return place.partition("/")[0] if root == "processed" else ""


def _brief(reasons: list[str]) -> str:
    return "; ".join(reasons[:2]) + (f"; and {len(reasons) - 2} more" if len(reasons) > 2 else "")


def _listed(stage: str, tasks: list[str]) -> str:
    """A stage and its tasks; one that is called once is not named twice."""
    if tasks == [stage]:
        return stage
    return f"{stage}: " + ", ".join(tasks[:3]) + (f" and {len(tasks) - 3} more" if len(tasks) > 3 else "")
