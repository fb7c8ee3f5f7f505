"""Runs stages on a study: what is current is skipped, and each other task runs as soon as what it reads is there."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import cached_property, partial

from davinci_forces.errors import BadRequest, PipelineError
from davinci_forces.records import KINDS, store
from davinci_forces.report import REPORT
from davinci_forces.runner import STEPS, reporting
from davinci_forces.runner.console import Console
from davinci_forces.runner.execution import Outcome, perform
from davinci_forces.runner.graph import WHOLE, Graph, Part, goes_by_log
from davinci_forces.runner.ledger import Entry, Folders, Ledger, file_name
from davinci_forces.runner.lock import locked
from davinci_forces.runner.plan import Plan, Task, log_of
from davinci_forces.runner.processes.workers import Crew, Others
from davinci_forces.runner.reuse import reused
from davinci_forces.runner.signature import Declaration, declaration
from davinci_forces.stages import STAGES
from davinci_forces.study import Study


@dataclass
class Progress:
    """How far a stage is."""

    awaited: int = 0  # parts that are not planned yet
    tasks: int = 0
    current: int = 0
    reasons: dict[str, list[str]] = field(default_factory=dict)  # tasks by why they run, until that is said


@dataclass
class Runner:
    """Runs stages of one study; tasks are handed to `others`, and without them run in this process."""

    study: Study
    folders: Folders
    console: Console
    force: bool = False
    others: Others | None = None
    perform: Callable[[Folders, Task], Outcome] | None = None  # how they do it

    def __post_init__(self) -> None:
        self.ledger = Ledger(self.folders)
        self.failures = 0
        self.ran = 0
        self.seconds: dict[str, float] = {}  # that the tasks of each step took together
        self.writable = True

    @cached_property
    def plan(self) -> Plan:
        """What there is to do, read once the study is locked."""
        return Plan(self.study, self.ledger)

    def run(self, names: Iterable[str]) -> bool:
        """Run these stages, and the report; whether every task succeeded.

        Raises
        ------
        PipelineError
            If another run is working on the study, or a stage has nothing to work on.
        """
        names = list(names)
        self.seconds = dict.fromkeys(names, 0.0)
        with (
            locked(self.folders.processed) as self.writable,
            closing(Crew(self.others)) as self._crew,
        ):
            if self.writable:
                self._remove_leftovers()
                self._remove_obsolete(names)
            self._run(Graph(names, [entry.name for entry in self.study.logs]), alone=len(names) == 1)
            if self.writable:
                if self.others:  # of whom one may have been ended, which of a cluster's is not even known
                    self._remove_leftovers()
                self.ledger.write_index()
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

    def _remove_leftovers(self) -> None:
        """Remove what an interrupted run, or a process that was ended, left half written."""
        for leftover in [*store.leftovers(self.folders.processed), *store.leftovers(self.folders.reports)]:
            leftover.unlink(missing_ok=True)

    def _remove_obsolete(self, names: Sequence[str]) -> None:
        """Remove what an earlier version made under the names of stages and records that there are no more, and what
        these stages made of logs that have left the study.
        """
        folders = {kind.folder() for kind in KINDS.values()}
        obsolete = [
            entry
            for entry in self.ledger.entries()
            if entry.stage not in STEPS or not {_folder(name) for name in entry.outputs} - {""} <= folders
        ]
        for entry in obsolete:
            self.ledger.remove(entry)
        if obsolete:
            stages = ", ".join(dict.fromkeys(entry.stage for entry in obsolete))
            files = sum(len(entry.outputs) for entry in obsolete)
            self.console.say(f"removed {files} files of {stages} under names that an earlier version used")
        logs = {entry.name for entry in self.study.logs} | {WHOLE}
        for entry in list(self.ledger.entries()):
            if entry.stage in names and _part(entry).log not in logs:
                self.ledger.remove(entry)

    def _run(self, graph: Graph, alone: bool) -> None:
        """Plan what may begin, run it, and let begin what waited for it, until nothing is left."""
        self._alone = alone
        self._before: dict[Part, list[Entry]] = {}
        for entry in self.ledger.entries():
            self._before.setdefault(_part(entry), []).append(entry)
        self._progress = {part.stage: Progress() for part in graph.parts}
        for part in graph.parts:
            self._progress[part.stage].awaited += _plans(part)
        self._due: dict[Part, int] = {}  # tasks that are not done
        while True:
            for batch in iter(graph.next, []):
                self._begin(graph, batch)
            if self._crew.idle:
                return
            for outcome in self._crew.outcomes():
                self._record(outcome)
                self._done(graph, _part(outcome.task))

    def _begin(self, graph: Graph, batch: Sequence[Part]) -> None:
        """Plan parts of a stage, and take on what of them is not current."""
        name = batch[0].stage
        due = {part: self._plan_part(part) if _plans(part) else [] for part in batch}
        progress = self._progress[name]
        if not progress.awaited:  # all that it does is known
            for reason, named in progress.reasons.items():
                self.console.say(f"{_listed(name, named)}: {reason}")
            progress.reasons.clear()
        how = (
            partial(reporting.perform, self.ledger)
            if name == REPORT
            else partial(self.perform or perform, self.folders)
        )
        for part, tasks in due.items():
            self._due[part] = len(tasks) + 1
            for task in tasks:
                self._crew.submit(how, task)
            self._done(graph, part)

    def _done(self, graph: Graph, part: Part) -> None:
        """Count what of a part is done; with the last of it, let begin what waited for it."""
        self._due[part] -= 1
        if not self._due[part]:
            graph.done(part)
            if part.log == WHOLE:
                self._conclude(part.stage)

    def _conclude(self, name: str) -> None:
        """Say what there was nothing to do for."""
        progress = self._progress[name]
        if progress.current:
            self.console.say(f"{name}: {progress.current} of {progress.tasks} current")
        if progress.tasks:
            return
        if self._alone and (awaited := self._awaits(declaration(name))):
            kinds = " or ".join(k.__name__ for k in declaration(name).reads)
            raise PipelineError(f"{name} has nothing to work on: there are no {kinds} records; run {awaited} first")
        self.console.say(f"{name}: the study holds nothing for it")

    def _plan_part(self, part: Part) -> list[Task]:
        """The tasks of a part that have to run; what was made by those that are no more is removed."""
        name, progress = part.stage, self._progress[part.stage]
        asks = None if name == REPORT else declaration(name)
        tasks = list(self.plan.tasks(asks, part.log)) if asks else [reporting.task(self.plan)]
        planned = {file_name(task.name) for task in tasks}
        for entry in self._before.get(part, ()):
            if file_name(entry.task) not in planned:
                self.ledger.remove(entry)
        due: list[Task] = []
        for task in tasks:
            reasons = self._reasons(task)
            if reasons and not self.force and (other := reused(self.ledger, task)):
                self.console.say(f"{name}: copied from {other}, which has the same robot and settings")
                self.ran += 1
            elif reasons:
                due.append(task)
                progress.reasons.setdefault(_brief(reasons), []).append(task.name)
            else:
                progress.current += 1
        progress.awaited -= 1
        progress.tasks += len(tasks)
        return due

    def _reasons(self, task: Task) -> list[str]:
        """Why a task has to run; nothing when it is current."""
        reasons = (
            ["--force"]
            if self.force
            else self.ledger.reasons(self.ledger.entry(task.stage, task.name), task.fingerprint)
        )
        if reasons and not self.writable:
            raise BadRequest(
                f"{self.folders.processed} cannot be written to, and {task.stage} has to run: {_brief(reasons)}; allow "
                "writing, or name other folders with --processed and --reports"
            )
        return reasons

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

    def _record(self, outcome: Outcome) -> None:
        """Remember what a task made, and remove what it made before and does no more."""
        task = outcome.task
        before = self.ledger.entry(task.stage, task.name)
        for stale in set(before.outputs if before else ()) - set(outcome.outputs):
            self.folders.file(stale).unlink(missing_ok=True)
        self.ledger.made(outcome.outputs)
        self.ledger.write(Entry(task.stage, task.name, dict(vars(task.fingerprint)), outcome.outputs, outcome.failed))
        self.ran += 1
        self.failures += bool(outcome.failed)
        self.seconds[task.stage] += outcome.seconds
        for line in outcome.messages:
            self.console.warn(f"{task.stage}: {line}")
        self.console.progress(task.stage, *self._crew.counts)


def _plans(part: Part) -> bool:
    """Whether a part has tasks: the whole of a stage that goes log by log is only when all of them are done."""
    return part.log != WHOLE or part.stage == REPORT or not goes_by_log(declaration(part.stage))


def _part(task: Task | Entry) -> Part:
    """The part of its stage that a task belongs to; an entry of one, too."""
    name = task.task if isinstance(task, Entry) else task.name
    return Part(task.stage, WHOLE if task.stage == REPORT else log_of(declaration(task.stage), name))


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
