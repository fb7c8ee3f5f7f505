"""Run stages on a study: skip tasks that are up to date, and run each other task as soon as its inputs are there."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import groupby

from davinci_forces.errors import BadRequest
from davinci_forces.files import leftovers
from davinci_forces.records import KINDS
from davinci_forces.records.record import groups_of
from davinci_forces.report import REPORT
from davinci_forces.runner import reporting
from davinci_forces.runner.console import Console, shorten
from davinci_forces.runner.execution import Outcome, perform
from davinci_forces.runner.graph import ALL_LOGS, Graph, Part, every_step, goes_by_log, required_steps, stages_of
from davinci_forces.runner.ledger import INDEX, Entry, Folders, Ledger, file_name
from davinci_forces.runner.lock import hold_lock
from davinci_forces.runner.plan import Plan, Task, log_of, reuse
from davinci_forces.runner.processes.workers import TaskQueue, WorkerPool
from davinci_forces.runner.signature import declaration, stage_of
from davinci_forces.study import Study

MAX_REASONS = 1  # of the tasks of a step that are printed one by one


@dataclass
class Progress:
    """Progress of a step."""

    unplanned: int = 0  # number of parts without planned tasks
    tasks: int = 0
    current: int = 0  # number of tasks that are up to date
    reasons: dict[str, list[str]] = field(default_factory=dict)  # reason to run -> tasks, until it is printed


@dataclass
class Runner:
    """Runs stages of one study, in this process or in the processes `others`."""

    study: Study
    folders: Folders
    console: Console
    force: bool = False
    others: WorkerPool | None = None
    perform: Callable[[Folders, Task], Outcome] | None = None  # runs a task in a worker of a cluster

    def __post_init__(self) -> None:
        self.ledger = Ledger(self.folders)
        self.failures = 0
        self.warnings: list[str] = []
        self.ran = 0
        self.seconds: dict[str, float] = {}  # total time of the tasks, by stage
        self.writable = True

    @cached_property
    def plan(self) -> Plan:
        """The plan of the study, made once the study is locked."""
        return Plan(self.study, self.ledger)

    def run(self, names: Iterable[str]) -> bool:
        """Run these stages, groups or the report after the stages that they need; return whether all tasks succeeded.

        Raises PipelineError if another run is working on the study.
        """
        steps = self._steps(names)
        self.seconds = dict.fromkeys(map(stage_of, steps), 0.0)
        with (
            hold_lock(self.folders.processed) as self.writable,
            self._clean_up(),
            closing(TaskQueue(self.others)) as self._crew,
        ):
            if self.writable:
                self._remove_leftovers()
                self.ledger.home.joinpath(INDEX).unlink(missing_ok=True)
                for file, reason in self.ledger.invalid_files().items():
                    self.console.warn(f"{file} is ignored, and the files it names are kept: {reason}")
                self._remove_obsolete(steps)
            self._run(Graph(steps, [entry.name for entry in self.study.logs]))
        return self.failures == 0

    def preview(self, names: Iterable[str]) -> Iterator[str]:
        """List what a run of these stages would do and why, as far as that is known before it; change nothing."""
        before = ""
        for stage, steps in groupby(self._steps(names), stage_of):
            tasks = [task for step in steps for task in self._tasks(step)]
            by_reason = groups_of((_brief(reasons), task.name) for task in tasks if (reasons := self._reasons(task)))
            yield from (f"{_listed(stage, due)}: would run: {reason}" for reason, due in by_reason.items())
            if before and not by_reason:
                yield f"{stage}: waits for the results of {before}"
            elif stage in self._named and len(tasks) > (due := sum(map(len, by_reason.values()))):
                yield f"{stage}: {len(tasks) - due} of {len(tasks)} up to date"
            before = stage if by_reason else before

    def _steps(self, names: Iterable[str]) -> list[str]:
        """The steps that a run of these names takes; the named stages print also how much is up to date."""
        self._named = stages_of(names)
        return required_steps(self._named)

    def _tasks(self, step: str, log: str = ALL_LOGS) -> list[Task]:
        return [reporting.task(self.plan)] if step == REPORT else list(self.plan.tasks(declaration(step), log))

    @contextmanager
    def _clean_up(self) -> Iterator[None]:
        """Remove half-written files after a run that was stopped, or that had other processes."""
        needs_removal = self.perform is None  # workers of a cluster continue to write
        try:
            yield
            needs_removal = self.others is not None  # a process may have been killed unnoticed
        finally:
            if needs_removal and self.writable:
                self._remove_leftovers()

    def _remove_leftovers(self) -> None:
        for leftover in [*leftovers(self.folders.processed), *leftovers(self.folders.reports)]:
            leftover.unlink(missing_ok=True)

    def _remove_obsolete(self, steps: Sequence[str]) -> None:
        """Remove the outputs of former steps and kinds of record, and those that these steps made from former logs."""
        folders = {kind.folder() for kind in KINDS.values()}
        all_steps = {*every_step(), REPORT}
        obsolete = [
            entry
            for entry in self.ledger.entries()
            if entry.stage not in all_steps
            or not {name.split("/")[1] for name in entry.outputs if name.startswith("processed/")} <= folders
        ]
        for entry in obsolete:
            self.ledger.remove(entry)
        if obsolete:
            stages = ", ".join(dict.fromkeys(stage_of(entry.stage) for entry in obsolete))
            files = sum(len(entry.outputs) for entry in obsolete)
            self.console.say(f"removed {files} files of {stages}, which an earlier version made")
        logs = {entry.name for entry in self.study.logs} | {ALL_LOGS}
        for entry in list(self.ledger.entries()):
            if entry.stage in steps and _part(entry.stage, entry.task).log not in logs:
                self.ledger.remove(entry)

    def _run(self, graph: Graph) -> None:
        """Plan the parts that are ready and run their tasks, until all parts are done."""
        self._before = groups_of((_part(entry.stage, entry.task), entry) for entry in self.ledger.entries())
        self._progress = {part.step: Progress() for part in graph.parts}
        for part in graph.parts:
            self._progress[part.step].unplanned += _has_tasks(part)
        self._due: dict[Part, int] = {}  # number of tasks that are not done
        while True:
            for batch in iter(graph.next, []):
                self._begin(graph, batch)
            if self._crew.idle:
                break
            for outcome in self._crew.outcomes():
                self._record(outcome)
                self._count_done(graph, _part(outcome.task.step, outcome.task.name))
        if self.ran or len(self._named) == 1:  # else `nothing to do` says it in one line
            for line in self._unchanged():
                self.console.say(line)

    def _begin(self, graph: Graph, batch: Sequence[Part]) -> None:
        """Plan parts of a step, and submit their tasks that are not up to date."""
        step = batch[0].step
        due = {part: self._plan_part(part) if _has_tasks(part) else [] for part in batch}
        progress = self._progress[step]
        if not progress.unplanned:
            for reason, names in _grouped(progress.reasons).items():
                self.console.say(f"{_listed(stage_of(step), names)}: {reason}")
            progress.reasons.clear()
        function = partial(self.perform or perform, self.folders)
        if step == REPORT:
            function = partial(reporting.perform, self.ledger)
        for part, tasks in due.items():
            self._due[part] = len(tasks) + 1
            for task in tasks:
                self._crew.submit(function, task)
            self._count_done(graph, part)

    def _count_done(self, graph: Graph, part: Part) -> None:
        """Count a task of a part as done; after its last task, the part is done too."""
        self._due[part] -= 1
        if not self._due[part]:
            graph.finish(part)

    def _unchanged(self) -> Iterator[str]:
        """How many tasks of each named stage were up to date."""
        for stage, steps in groupby(self._progress, stage_of):
            counts = [(self._progress[step].current, self._progress[step].tasks) for step in steps]
            current, tasks = map(sum, zip(*counts, strict=True))
            if current and stage in self._named:
                yield f"{stage}: {current} of {tasks} up to date"
            if not tasks and {stage} == self._named:  # a study need not have data for all stages
                yield f"{stage}: the study has no data for it"

    def _plan_part(self, part: Part) -> list[Task]:
        """The tasks of a part that have to run; outputs of its former tasks are removed."""
        progress, tasks = self._progress[part.step], self._tasks(*part)
        planned = {file_name(task.name) for task in tasks}
        for entry in self._before.get(part, ()):
            if file_name(entry.task) not in planned:
                self.ledger.remove(entry)
        due: list[Task] = []
        for task in tasks:
            reasons = self._reasons(task)
            if reasons and not self.writable:
                why = f"{stage_of(task.step)} has to run: {_brief(reasons)}"
                remedy = "allow writing, or name other folders with --processed and --reports"
                raise BadRequest(f"{self.folders.processed} cannot be written to, and {why}; {remedy}")
            if reasons and not self._is_forced(task) and (source := reuse(self.ledger, task)):
                self.console.say(f"{stage_of(part.step)}: copied from {source}, which has the same robot and settings")
                self.ran += 1
            elif reasons:
                due.append(task)
                progress.reasons.setdefault(_brief(reasons), []).append(task.name)
            else:
                progress.current += 1
        progress.unplanned -= 1
        progress.tasks += len(tasks)
        return due

    def _reasons(self, task: Task) -> list[str]:
        if self._is_forced(task):
            return ["--force"]
        return self.ledger.reasons(self.ledger.entry(task.step, task.name), task.fingerprint)

    def _is_forced(self, task: Task) -> bool:
        """Whether a task runs even if it is up to date: with --force, the tasks of the named stages do."""
        return self.force and stage_of(task.step) in self._named

    def _record(self, outcome: Outcome) -> None:
        task, stage = outcome.task, stage_of(outcome.task.step)
        if self.console.is_verbose:
            self.console.say(f"{stage}: {task.name}: took {outcome.seconds:.2f} s")
        fingerprint, environment = dict(vars(task.fingerprint)), reporting.environment()
        self.ledger.write(Entry(task.step, task.name, fingerprint, outcome.outputs, outcome.failed, environment))
        self.ran += 1
        self.failures += bool(outcome.failed)
        self.seconds[stage] += outcome.seconds
        for line in outcome.messages:
            self.warnings.append(f"{stage}: {line}")
            self.console.warn(self.warnings[-1])
        self.console.progress(stage, *self._crew.counts)


def _has_tasks(part: Part) -> bool:
    """Whether a part has tasks; the part of all logs has none if its step runs log by log."""
    return part.log != ALL_LOGS or part.step == REPORT or not goes_by_log(declaration(part.step))


def _part(step: str, task: str) -> Part:
    return Part(step, ALL_LOGS if step == REPORT else log_of(declaration(step), task))


def _brief(reasons: list[str]) -> str:
    return "; ".join(reasons[:2]) + (f"; and {len(reasons) - 2} more" if len(reasons) > 2 else "")


def _grouped(reasons: dict[str, list[str]]) -> dict[str, list[str]]:
    """Reasons with their tasks; many become one, which states the first that is not what an earlier stage made."""
    if len(reasons) <= MAX_REASONS:
        return reasons
    every = [name for names in reasons.values() for name in names]
    first = min(reasons, key=lambda reason: reason.startswith("processed/"))
    return {f"{first}; more such reasons: {len(reasons) - 1}": every}


def _listed(stage: str, tasks: list[str]) -> str:
    """A stage with the first names of its tasks; a task named like its stage is not repeated."""
    return stage if tasks == [stage] else f"{stage}: {shorten(tasks)}"
