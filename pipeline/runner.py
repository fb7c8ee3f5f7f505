"""Runs stages on a study: reads what their signatures ask for, writes what they promise, skips what is current."""

import importlib.metadata
import os
import traceback
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from pipeline import store
from pipeline.errors import PipelineError
from pipeline.ledger import Entry, Fingerprint, Folders, Ledger, code, hash_of_text
from pipeline.library import Library, Provenance
from pipeline.logs.log import Options
from pipeline.logs.parts import open_parts
from pipeline.records import KINDS, Note, Record, note
from pipeline.robots.robot import Kind
from pipeline.signature import Declaration, Kinds, declaration
from pipeline.stages import STAGES
from pipeline.study import Study

VERSION = importlib.metadata.version("davinci-forces")
Places = tuple[tuple[str, Path], ...]  # kind of record, file below the processed folder


@dataclass(frozen=True)
class Task:
    """One call of a stage."""

    stage: str
    name: str  # "slide-1/hand_roll"
    records: dict[str, Places] = field(default_factory=dict)  # parameter -> records
    log: str = ""
    joint: str = ""


@dataclass(frozen=True)
class Outcome:
    """What a task made, or why it could not, and what it wants said."""

    task: Task
    outputs: tuple[str, ...]
    failed: str = ""
    said: tuple[str, ...] = ()


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
        self.failures = 0
        self.ran = 0
        self._pool: ProcessPoolExecutor | None = None

    def run(self, names: Iterable[str]) -> bool:
        """Run these stages in order; whether every task of theirs succeeded.

        Raises
        ------
        PipelineError
            If files of the study are not there, or a stage has nothing to work on.
        """
        for half in list(store.leftovers(self.folders.processed)) + list(store.leftovers(self.folders.reports)):
            half.unlink()
        names = list(names)
        # One pool for all stages: a process of its own takes seconds to import what the stages need.
        with ExitStack() as stack:
            self._stack = stack
            for name in names:
                self._stage(name, alone=len(names) == 1)
        return self.failures == 0

    def _stage(self, name: str, alone: bool) -> None:
        asks = declaration(name)
        tasks = list(self._plan(asks))
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
        why: dict[str, list[str]] = {}
        for task in tasks:
            now = self._fingerprint(asks, task)
            reasons = ["--force"] if self.force else self.ledger.reasons(self.ledger.entry(name, task.name), now)
            if reasons:
                due[task.name] = task, now
                why.setdefault(_brief(reasons), []).append(task.name)
        for reason, which in why.items():
            self.console.say(f"{name}: {_listed(which)}: {reason}")
        self._perform(name, due)
        current = len(tasks) - len(due)
        if current:
            self.console.say(f"{name}: {current} of {len(tasks)} current")

    def _perform(self, name: str, due: dict[str, tuple[Task, Fingerprint]]) -> None:
        for done, outcome in enumerate(self._outcomes([task for task, _ in due.values()], due), start=1):
            task, fingerprint = due[outcome.task.name]
            before = self.ledger.entry(name, task.name)
            for stale in set(before.outputs if before else ()) - set(outcome.outputs):
                self.folders.file(stale).unlink(missing_ok=True)
            hashes = {made: self.ledger.digest(made, fresh=True) for made in outcome.outputs}
            self.ledger.write(Entry(name, task.name, asdict(fingerprint), hashes, outcome.failed))
            self.ran += 1
            self.failures += bool(outcome.failed)
            for line in outcome.said:
                self.console.warn(f"{name}: {line}")
            self.console.progress(name, done, len(due))

    def _outcomes(self, tasks: list[Task], due: dict[str, tuple[Task, Fingerprint]]) -> Iterator[Outcome]:
        calls = [(self.study, self.folders, task, asdict(due[task.name][1])) for task in tasks]
        if self.jobs == 1 or len(calls) == 1:
            for call in calls:
                yield perform(*call)
            return
        if self._pool is None:
            self._pool = self._stack.enter_context(ProcessPoolExecutor(self.jobs, mp_context=get_context("spawn")))
        futures: list[Future[Outcome]] = [self._pool.submit(perform, *call) for call in calls]
        for future in as_completed(futures):
            yield future.result()

    def _plan(self, asks: Declaration) -> Iterator[Task]:
        """Every call of a stage that the study and the records that are there give."""
        every = {p: self._places(kinds) for p, kinds in asks.every.items()}
        if asks.name == "report":
            yield Task("report", "report", {"records": self._places(tuple(KINDS.values()))})
        elif asks.each:
            [(parameter, kinds)] = asks.each.items()
            for kind, place in self._places(kinds):
                log, joint = _about(place)
                beside = {
                    p: tuple(x for x in self._places(k) if _about(x[1]) == (log, joint)) for p, k in asks.beside.items()
                }
                records = {parameter: ((kind, place),), **beside, **every}
                yield Task(asks.name, _task_name(kind, place, len(kinds)), records, log, joint)
        elif asks.per_log:
            for entry in self.study.logs:
                own = {
                    p: tuple(x for x in self._places(k) if _about(x[1])[0] == entry.name)
                    for p, k in asks.per_log.items()
                }
                if any(own.values()):
                    yield Task(asks.name, entry.name, {**own, **every}, entry.name)
        elif "log" in asks.given.values():
            yield from (Task(asks.name, entry.name, log=entry.name) for entry in self.study.logs)
        elif any(every.values()) or not asks.reads:
            yield Task(asks.name, asks.name, every)

    def _places(self, kinds: Kinds) -> Places:
        """Files of these kinds that the stages made, in the order of the study's logs and the robot's joints."""
        wanted = {kind.__name__.lower(): kind.__name__ for kind in kinds}
        found = []
        for stage in STAGES:
            for entry in self.ledger.entries(stage):
                for name in entry.outputs:
                    root, _, rest = name.partition("/")
                    if root == "processed" and rest.partition("/")[0] in wanted:
                        found.append((wanted[rest.partition("/")[0]], Path(rest)))
        return tuple(sorted(found, key=self._order))

    def _order(self, item: tuple[str, Path]) -> tuple[Any, ...]:
        kind, place = item
        logs_ = [entry.name for entry in self.study.logs]
        joints = [joint.name for joint in self.study.robot.joints]
        log, joint = _about(place)
        joint = log if log in joints else joint  # a Fit is about a joint alone
        rank = (
            (logs_.index(log) if log in logs_ else len(logs_)),
            (joints.index(joint) if joint in joints else len(joints)),
        )
        return list(KINDS).index(kind), *rank, place.as_posix()

    def _fingerprint(self, asks: Declaration, task: Task) -> Fingerprint:
        inputs = {f"processed/{place.as_posix()}" for places in task.records.values() for _, place in places}
        if "log" in asks.given.values():
            inputs |= {f"raw/{file}" for file in self.study.log(task.log).files}
        if asks.name == "report":
            beside = ("study.toml", self.study.robot_file, "truth.toml" if self.study.truth else "")
            inputs |= {f"raw/{file}" for file in beside if file}
        given = {
            what: hash_of_text(repr(_given(what, self.study, task))) for what in asks.given.values() if what != "log"
        }
        settings = asdict(self.study.settings)
        chosen = settings if "study" in asks.given.values() else {name: settings[name] for name in asks.settings}
        hashes = {name: self.ledger.digest(name) for name in sorted(inputs)}
        return Fingerprint(hashes, given, chosen, code(f"pipeline.stages.{asks.name}"), VERSION)


def perform(study: Study, folders: Folders, task: Task, made_from: dict[str, Any]) -> Outcome:
    """Run one task: read its records, call the stage, write what it makes.  Called in this process or another."""
    asks = declaration(task.stage)
    said: list[str] = []
    try:
        arguments = {p: _argument(asks, folders, task, p) for p in task.records if p != "records"}
        arguments |= {p: _given(what, study, task) for p, what in asks.given.items()}
        arguments |= {name: getattr(study.settings, name) for name in asks.settings}
        run = import_module(f"pipeline.stages.{task.stage}").run
        if task.stage == "report":
            return Outcome(task, _report(run, study, folders, task))
        with _writer(study, folders, made_from) as writer:
            for record in run(**arguments):
                writer.write(record)
                said += _lines(record)
        return Outcome(task, tuple(f"processed/{place.as_posix()}" for place in writer.places), said=tuple(said))
    except PipelineError as error:
        return _failed(study, folders, task, made_from, str(error))
    except Exception as error:
        # A fault of ours must not cost the other logs; where it happened is all that a report of it needs.
        frame = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(frame.filename).name}:{frame.lineno} in {frame.name}"
        fault = f"{type(error).__name__}: {error} ({place})"
        message = f"{fault}: a fault of davinci-forces, not of the data; please report it"
        return _failed(study, folders, task, made_from, message)


def _failed(study: Study, folders: Folders, task: Task, made_from: dict[str, Any], message: str) -> Outcome:
    """The outcome of a task that could not be done: a note of why, for the report."""
    kept = _anywhere(message, study, folders)
    with _writer(study, folders, made_from) as writer:
        writer.write(note(task.stage, task.name.replace("/", "."), "error", kept))
    places = tuple(f"processed/{place.as_posix()}" for place in writer.places)
    return Outcome(task, places, failed=kept, said=(f"error: {message}",))


def _anywhere(message: str, study: Study, folders: Folders) -> str:
    """A message without the folders of this machine, as what is kept of it has to be the same on every one."""
    for folder in (folders.processed, folders.reports, study.folder):
        message = message.replace(f"{folder}{os.sep}", "")
    return message


@contextmanager
def _writer(study: Study, folders: Folders, made_from: dict[str, Any]) -> Iterator[store.Writer]:
    def unit(record: Record) -> store.Unit:
        name = getattr(record, "joint", getattr(record, "group", ""))
        joints = {joint.name: joint for joint in study.robot.joints}
        return joints[name].unit if name in joints else Kind.REVOLUTE.unit

    with store.Writer(folders.processed, unit, made_from) as writer:
        yield writer


def _report(run: Callable[..., dict[str, bytes]], study: Study, folders: Folders, task: Task) -> tuple[str, ...]:
    """Call the report with every record there is, and write the files that it returns."""
    places = task.records["records"]

    def read(kind: type[Record]) -> list[Record]:
        return [store.read(kind, folders.processed, place) for name, place in places if name == kind.__name__]

    files = run(Library(read), study, _provenance(study, folders, places))
    for name, content in files.items():
        store.write_bytes(folders.reports / name, content)
    return tuple(f"reports/{name}" for name in files)


def _provenance(study: Study, folders: Folders, places: Places) -> Provenance:
    packages = ("numpy", "scipy", "pandas", "pyarrow", "statsmodels", "numba", "matplotlib", "bokeh", "typst", "npTDMS")
    ledger = Ledger(folders)
    raw = {f"raw/{study.name}/{file}": ledger.digest(f"raw/{file}") for entry in study.logs for file in entry.files}
    beside = ("study.toml", study.robot_file, "truth.toml" if study.truth else "")
    raw = {f"raw/{study.name}/{file}": ledger.digest(f"raw/{file}") for file in beside if file} | raw
    processed = {place.as_posix(): ledger.digest(f"processed/{place.as_posix()}") for _, place in places}
    failures = {f"{e.stage} {e.task}": e.failed for e in ledger.entries() if e.failed and e.stage != "report"}
    return Provenance(VERSION, {p: importlib.metadata.version(p) for p in packages}, raw, processed, failures)


def _argument(asks: Declaration, folders: Folders, task: Task, parameter: str) -> Any:
    read = [store.read(KINDS[kind], folders.processed, place) for kind, place in task.records[parameter]]
    if parameter in asks.each:
        return read[0]
    if parameter in asks.beside:
        return read[0] if read else None
    return read


def _given(what: str, study: Study, task: Task) -> Any:
    if what == "log":
        entry = study.log(task.log)
        options = Options(entry.delimiter, entry.decimal, entry.header, entry.encoding)
        return open_parts([study.folder / file for file in entry.files], options)
    if what == "entry":
        return study.log(task.log)
    if what == "joint":
        return study.robot.joint(task.joint)
    return study.robot if what == "robot" else replace(study, folder=Path(study.name))


def _lines(record: Record) -> list[str]:
    if not isinstance(record, Note):
        return []
    return [f"{s}: {t}" for s, t in zip(record.severity, record.text, strict=True) if s in ("warning", "error")]


def _about(place: Path) -> tuple[str, str]:
    """The log and the joint that a file is about: `track/<log>/<joint>.parquet`."""
    return (place.parts[1], place.stem.partition(".")[0]) if len(place.parts) > 2 else (place.stem, "")


def _task_name(kind: str, place: Path, kinds: int) -> str:
    name = "/".join(place.with_suffix("").parts[1:])
    return f"{kind.lower()}/{name}" if kinds > 1 else name


def _brief(reasons: list[str]) -> str:
    return "; ".join(reasons[:2]) + (f"; and {len(reasons) - 2} more" if len(reasons) > 2 else "")


def _listed(tasks: list[str]) -> str:
    return ", ".join(tasks[:3]) + (f" and {len(tasks) - 3} more" if len(tasks) > 3 else "")


def _before(stage: str) -> str:
    index = STAGES.index(stage)
    return STAGES[index - 1] if index else STAGES[0]
