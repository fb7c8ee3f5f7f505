"""Runs stages on a study: what is current is skipped, and each other task runs as soon as what it reads is there."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import groupby

from davinci_forces.errors import BadRequest
from davinci_forces.records import KINDS, store
from davinci_forces.report import REPORT
from davinci_forces.runner import reporting
from davinci_forces.runner.console import Console
from davinci_forces.runner.execution import Outcome, perform
from davinci_forces.runner.graph import WHOLE, Graph, Part, every_step, goes_by_log, needed, stages_of
from davinci_forces.runner.ledger import Entry, Folders, Ledger, file_name
from davinci_forces.runner.lock import locked
from davinci_forces.runner.plan import Plan, Task, log_of, reused
from davinci_forces.runner.processes.workers import Crew, Others
from davinci_forces.runner.signature import declaration, stage_of
from davinci_forces.study import Study


@dataclass
class Progress:
    """How far a step is."""

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
        self.seconds: dict[str, float] = {}  # that the tasks of each stage took together
        self.writable = True

    @cached_property
    def plan(self) -> Plan:
        """What there is to do, read once the study is locked."""
        return Plan(self.study, self.ledger)

    def run(self, names: Iterable[str]) -> bool:
        """Run these stages and groups, or the report, and before them what they need; whether every task succeeded.

        Raises
        ------
        PipelineError
            If another run is working on the study.
        """
        steps = self._needed(names)
        self.seconds = dict.fromkeys(map(stage_of, steps), 0.0)
        with (
            locked(self.folders.processed) as self.writable,
            self._tidied(),
            closing(Crew(self.others)) as self._crew,
        ):
            if self.writable:
                self._remove_leftovers()
                for file, reason in self.ledger.void().items():
                    self.console.warn(f"{file} does not count, and nothing it names is removed: {reason}")
                self._remove_obsolete(steps)
            self._run(Graph(steps, [entry.name for entry in self.study.logs]))
            if self.writable:
                self.ledger.write_index()
        return self.failures == 0

    def preview(self, names: Iterable[str]) -> Iterator[str]:
        """What a run of these stages would do and why, as far as that is known before it: it changes nothing."""
        before = ""
        for stage, steps in groupby(self._needed(names), stage_of):
            tasks = [task for step in steps for task in self._tasks(step)]
            by_reason: dict[str, list[str]] = {}
            for task in tasks:
                if reasons := self._reasons(task):
                    by_reason.setdefault(_brief(reasons), []).append(task.name)
            yield from (f"{_listed(stage, due)}: would run: {reason}" for reason, due in by_reason.items())
            if before and not by_reason:
                yield f"{stage}: waits for what {before} makes"
            elif stage in self._named and len(tasks) > (due := sum(map(len, by_reason.values()))):
                yield f"{stage}: {len(tasks) - due} of {len(tasks)} current"
            before = stage if by_reason else before

    def _needed(self, names: Iterable[str]) -> list[str]:
        """The steps that a run of these names takes; of stages that are not named, only what is not current is told."""
        self._named = stages_of(names)
        return needed(self._named)

    def _tasks(self, step: str, log: str = WHOLE) -> list[Task]:
        return [reporting.task(self.plan)] if step == REPORT else list(self.plan.tasks(declaration(step), log))

    @contextmanager
    def _tidied(self) -> Iterator[None]:
        """Remove what is left half written where a run is stopped, and by others that may have been ended unseen."""
        tidy = self.perform is None  # workers of a cluster go on with what they are at
        try:
            yield
            tidy = self.others is not None
        finally:
            if tidy and self.writable:
                self._remove_leftovers()

    def _remove_leftovers(self) -> None:
        """Remove what an interrupted run, or a process that was ended, left half written."""
        for leftover in [*store.leftovers(self.folders.processed), *store.leftovers(self.folders.reports)]:
            leftover.unlink(missing_ok=True)

    def _remove_obsolete(self, steps: Sequence[str]) -> None:
        """Remove what an earlier version made under the names of steps and records that there are no more, and what
        these steps made of logs that have left the study.
        """
        folders = {"", *(kind.folder() for kind in KINDS.values())}
        known = {*every_step(), REPORT}
        obsolete = [
            entry
            for entry in self.ledger.entries()
            if entry.stage not in known or not {_folder(name) for name in entry.outputs} <= folders
        ]
        for entry in obsolete:
            self.ledger.remove(entry)
        if obsolete:
            stages = ", ".join(dict.fromkeys(stage_of(entry.stage) for entry in obsolete))
            files = sum(len(entry.outputs) for entry in obsolete)
            self.console.say(f"removed {files} files of {stages} under names that an earlier version used")
        logs = {entry.name for entry in self.study.logs} | {WHOLE}
        for entry in list(self.ledger.entries()):
            if entry.stage in steps and _part(entry.stage, entry.task).log not in logs:
                self.ledger.remove(entry)

    def _run(self, graph: Graph) -> None:
        """Plan what may begin, run it, and let begin what waited for it, until nothing is left."""
        self._before: dict[Part, list[Entry]] = {}
        for entry in self.ledger.entries():
            self._before.setdefault(_part(entry.stage, entry.task), []).append(entry)
        self._progress = {part.step: Progress() for part in graph.parts}
        self._open = Counter(map(stage_of, self._progress))  # steps of each stage that are not done
        for part in graph.parts:
            self._progress[part.step].awaited += _plans(part)
        self._due: dict[Part, int] = {}  # tasks that are not done
        while True:
            for batch in iter(graph.next, []):
                self._begin(graph, batch)
            if self._crew.idle:
                return
            for outcome in self._crew.outcomes():
                self._record(outcome)
                self._done(graph, _part(outcome.task.step, outcome.task.name))

    def _begin(self, graph: Graph, batch: Sequence[Part]) -> None:
        """Plan parts of a step, and take on what of them is not current."""
        step = batch[0].step
        due = {part: self._plan_part(part) if _plans(part) else [] for part in batch}
        progress = self._progress[step]
        if not progress.awaited:  # all that it does is known
            for reason, tasks_of in progress.reasons.items():
                self.console.say(f"{_listed(stage_of(step), tasks_of)}: {reason}")
            progress.reasons.clear()
        how = (
            partial(reporting.perform, self.ledger)
            if step == REPORT
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
                self._conclude(stage_of(part.step))

    def _conclude(self, stage: str) -> None:
        """Say what there was nothing to do for, where a stage that was named is done with its last step."""
        self._open[stage] -= 1
        if self._open[stage] or stage not in self._named:
            return
        of_steps = [progress for step, progress in self._progress.items() if stage_of(step) == stage]
        current, tasks = (sum(getattr(each, what) for each in of_steps) for what in ("current", "tasks"))
        if current:
            self.console.say(f"{stage}: {current} of {tasks} current")
        if not tasks:
            self.console.say(f"{stage}: the study holds nothing for it")

    def _plan_part(self, part: Part) -> list[Task]:
        """The tasks of a part that have to run; what was made by those that are no more is removed."""
        progress, tasks = self._progress[part.step], self._tasks(*part)
        planned = {file_name(task.name) for task in tasks}
        for entry in self._before.get(part, ()):
            if file_name(entry.task) not in planned:
                self.ledger.remove(entry)
        due: list[Task] = []
        for task in tasks:
            reasons = self._reasons(task)
            if reasons and not self.writable:
                raise BadRequest(
                    f"{self.folders.processed} cannot be written to, and {stage_of(task.step)} has to run: "
                    f"{_brief(reasons)}; allow writing, or name other folders with --processed and --reports"
                )
            if reasons and not self._forced(task) and (other := reused(self.ledger, task)):
                self.console.say(f"{stage_of(part.step)}: copied from {other}, which has the same robot and settings")
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
        if self._forced(task):
            return ["--force"]
        return self.ledger.reasons(self.ledger.entry(task.step, task.name), task.fingerprint)

    def _forced(self, task: Task) -> bool:
        """Whether a task runs though it may be current: one of the stages that were named."""
        return self.force and stage_of(task.step) in self._named

    def _record(self, outcome: Outcome) -> None:
        """Remember what a task made."""
        task, stage = outcome.task, stage_of(outcome.task.step)
        fingerprint, environment = dict(vars(task.fingerprint)), reporting.environment()
        self.ledger.write(Entry(task.step, task.name, fingerprint, outcome.outputs, outcome.failed, environment))
        self.ran += 1
        self.failures += bool(outcome.failed)
        self.seconds[stage] += outcome.seconds
        for line in outcome.messages:
            self.console.warn(f"{stage}: {line}")
        self.console.progress(stage, *self._crew.counts)


def _plans(part: Part) -> bool:
    """Whether a part has tasks: the whole of a step that goes log by log is only when all of them are done."""
    return part.log != WHOLE or part.step == REPORT or not goes_by_log(declaration(part.step))


def _part(step: str, task: str) -> Part:
    """The part of its step that a task of this name belongs to."""
    return Part(step, WHOLE if step == REPORT else log_of(declaration(step), task))


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
