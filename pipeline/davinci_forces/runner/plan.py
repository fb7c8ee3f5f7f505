"""The tasks of a step, one per call of its function, with the places of their records and all that they depend on."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

from davinci_forces import __version__
from davinci_forces.files import read_bytes, write_bytes
from davinci_forces.records import KINDS, Record
from davinci_forces.robots.robot import Kind
from davinci_forces.runner.fingerprint import Fingerprint, code, hash_of, schemas
from davinci_forces.runner.ledger import Entry, Ledger
from davinci_forces.runner.signature import Declaration, Kinds, stage_of
from davinci_forces.stages import module
from davinci_forces.study import Study

# The code that makes, checks and stores every record; other modules of the folder declare records, see `schemas`.
RECORDS = tuple(f"davinci_forces.records.{name}" for name in ("record", "store"))
Located = tuple[str, str]  # kind of record, file below the processed folder; a Path would take ten times as long
ANY = ""  # log, joint or role
ORDER = {kind: i for i, kind in enumerate(KINDS.values())}


class Places:
    """The record files of a study, in the order of its logs and of the robot's joints."""

    def __init__(self, study: Study, entries: Iterable[Entry]) -> None:
        self._logs = {entry.name: i for i, entry in enumerate(study.logs)}
        self._roles = {entry.name: entry.role for entry in study.logs}
        self._joints = {joint.name: i for i, joint in enumerate(study.robot.joints)}
        self._kinds = {kind.folder(): kind for kind in KINDS.values()}
        self._names: dict[str, dict[str, dict[str, str]]] = {}  # by folder and log, with the joint
        self._all: dict[str, dict[str, list[Located]]] = {}  # by kind and joint, the files of all logs, in order
        for entry in entries:
            self.add(entry.outputs)

    def add(self, outputs: Iterable[str]) -> None:
        """Add the outputs of a task."""
        for kind, path, log, joint in self._changed_records(outputs):
            self._names.setdefault(kind.folder(), {}).setdefault(log, {})[path] = joint

    def remove(self, outputs: Iterable[str]) -> None:
        """Remove the outputs of a task."""
        for kind, path, log, _ in self._changed_records(outputs):
            self._names.get(kind.folder(), {}).get(log, {}).pop(path, None)

    def _changed_records(self, outputs: Iterable[str]) -> Iterator[tuple[type[Record], str, str, str]]:
        """The records among a task's outputs, of logs in the study; the order of their kinds is computed again."""
        for name in outputs:
            root, _, path = name.partition("/")
            kind = self._kinds.get(path.partition("/")[0]) if root == "processed" else None
            if kind:
                log, joint = log_and_joint(kind, path)
                if log == ANY or log in self._logs:
                    self._all.pop(kind.__name__, None)
                    yield kind, path, log, joint

    def find(self, kinds: Kinds, log: str = ANY, joint: str = ANY, role: str = ANY) -> tuple[Located, ...]:
        """Files of these kinds about a log, a joint and logs of a role; a kind without log or joint is about all."""
        located: tuple[Located, ...] = ()
        for kind in sorted(kinds, key=ORDER.__getitem__) if len(kinds) > 1 else kinds:
            of_joint = joint if {"joint", "group"} & {*kind.KEY} else ANY
            of_log = log and is_about_log(kind)
            located += tuple(self._sorted(kind, [log], of_joint) if of_log else self._of_all(kind, of_joint))
        if role == ANY:
            return located
        return tuple((k, path) for k, path in located if self._roles.get(log_and_joint(KINDS[k], path)[0]) == role)

    def _of_all(self, kind: type[Record], joint: str) -> list[Located]:
        """The files of a kind about a joint, of all logs; sorted once, since many calls read them."""
        by_joint = self._all.setdefault(kind.__name__, {})
        if joint not in by_joint:
            by_joint[joint] = self._sorted(kind, list(self._names.get(kind.folder(), ())), joint)
        return by_joint[joint]

    def _sorted(self, kind: type[Record], logs: Iterable[str], joint: str) -> list[Located]:
        by_log = self._names.get(kind.folder(), {})
        ranked = sorted(
            (self._logs.get(log, -1), self._joints.get(of, len(self._joints)), path)
            for log in logs
            for path, of in by_log.get(log, {}).items()
            if joint in (ANY, of)
        )
        return [(kind.__name__, path) for *_, path in ranked]


def log_and_joint(kind: type[Record], name: str) -> tuple[str, str]:
    """The log and the joint of a file, as in `track/<log>/<joint>.parquet`; "" for none."""
    first, *folders = name.removesuffix(".parquet").split("/")[1:]
    key = dict(zip(kind.KEY, (first, *(part for folder in folders for part in folder.split("."))), strict=False))
    return key.get("log", ANY), key.get("joint", key.get("group", ANY))


def is_about_log(kind: type[Record]) -> bool:
    """Whether every record of a kind is about one log."""
    return "log" in kind.KEY


@dataclass(frozen=True)
class Task:
    """One call of a step: the places of its records, its other arguments, and all that its outputs depend on."""

    step: str
    name: str  # "slide-1/hand_roll"
    fingerprint: Fingerprint
    records: dict[str, tuple[Located, ...]] = field(default_factory=dict)  # by parameter
    given: dict[str, Any] = field(default_factory=dict)  # by parameter; for a log, its entry
    joints: dict[str, tuple[Kind, str, bool]] = field(default_factory=dict)  # by joint, for the units of its records

    @property
    def subject(self) -> str:
        """A name that is unique among the tasks of its stage."""
        function = self.step.partition(".")[2]
        return self.name if function in ("", self.name) else f"{function}.{self.name}"


class Plan:
    """The tasks of one study, given the records that exist now."""

    def __init__(self, study: Study, ledger: Ledger) -> None:
        self.study, self.ledger = study, ledger
        self._entries = {entry.name: entry for entry in study.logs}
        self._joints = {joint.name: joint.for_units for joint in study.robot.joints}
        self._hash = cache(lambda what, name: hash_of(self._given(what, name)))  # many tasks share an argument
        self._places = Places(study, ledger.entries())
        self._seen = len(ledger.changes)

    def places(self) -> Places:
        """The places of the records that exist now."""
        for removed, added in self.ledger.changes[self._seen :]:
            self._places.remove(removed)
            self._places.add(added)
        self._seen = len(self.ledger.changes)
        return self._places

    def tasks(self, asks: Declaration, log: str = "") -> Iterator[Task]:
        """The tasks of a step, given the study and its records; with `log`, only the tasks about that log."""
        if "weighings" in asks.given.values() and not self.study.weighings.each:
            return
        places = self.places()
        logs = (log,) if log else tuple(self._entries)
        if asks.each:
            [(parameter, kinds)] = asks.each.items()
            for kind, place in places.find(kinds, log):
                of_log, joint = log_and_joint(KINDS[kind], place)
                others = {p: places.find(k, of_log, joint) for p, k in (asks.optional | asks.every).items()}
                name = place.removesuffix(".parquet").partition("/")[2]
                name = f"{KINDS[kind].folder()}/{name}" if len(kinds) > 1 else name
                yield self._task(asks, name, {parameter: ((kind, place),), **others}, of_log, joint)
        elif asks.per_log:
            for name in logs:
                own, others = ({p: places.find(k, name) for p, k in of.items()} for of in (asks.per_log, asks.every))
                if any(own.values()):
                    yield self._task(asks, name, own | others, name)
        elif "log" in asks.given.values():
            yield from (self._task(asks, name, {}, name) for name in logs)
        else:
            records = {p: places.find(kinds, role=asks.roles.get(p, ANY)) for p, kinds in asks.every.items()}
            if any(records.values()) or not asks.reads:
                yield self._task(asks, asks.name.rpartition(".")[2], records)

    def _task(
        self, asks: Declaration, name: str, records: dict[str, tuple[Located, ...]], log: str = "", joint: str = ""
    ) -> Task:
        names = {"log": log, "entry": log, "joint": joint}
        values = {p: self._given(what, names.get(what, "")) for p, what in asks.given.items()}
        settings = {name: getattr(self.study.settings, name) for name in asks.settings}
        inputs = {f"processed/{place}" for located in records.values() for _, place in located}
        if "log" in asks.given.values():
            inputs |= {name for file in self._entries[log].files for name in self.ledger.folders.expand(f"raw/{file}")}
        hashes = {what: self._hash(what, names.get(what, "")) for what in asks.given.values() if what != "log"}
        digests = {name: self.ledger.digest(name) for name in sorted(inputs)}
        readers = ("davinci_forces.logs",) if "log" in asks.given.values() else ()  # no stage imports them
        run = code(module(stage_of(asks.name)), *RECORDS, *readers, without="davinci_forces.records")
        fingerprint = Fingerprint(digests, hashes, settings, schemas(asks.name), run, __version__)
        return Task(asks.name, name, fingerprint, records, values, self._joints)

    def _given(self, what: str, name: str) -> Any:
        """An argument of a task other than its records, by the name of a joint or log; for a log, its entry."""
        if what in ("log", "entry"):
            return self._entries[name]
        if what in ("weighings", "haptics"):
            return getattr(self.study, what)
        return self.study.robot.joint(name) if what == "joint" else self.study.robot


def log_of(asks: Declaration, task: str) -> str:
    """The log of the task of this name; "" for a task that is not about one log."""
    if asks.each:
        [kinds] = asks.each.values()
        names = task.split("/")[len(kinds) > 1 :]
        return names[0] if all(map(is_about_log, kinds)) else ""
    return task if asks.per_log or "log" in asks.given.values() else ""


def reuse(ledger: Ledger, task: Task) -> str:
    """Copy a task's outputs from a neighbouring study in which it is up to date, and return its name, or ""."""
    processed = ledger.folders.processed
    if task.fingerprint.inputs:
        return ""
    for neighbour in sorted(processed.parent.iterdir()):
        source = Ledger(replace(ledger.folders, processed=neighbour))
        entry = None if neighbour == processed else source.read(task.step, task.name)
        if entry and not source.reasons(entry, task.fingerprint):
            for name in entry.outputs:
                write_bytes(ledger.folders.file(name), read_bytes(source.folders.file(name)))
            ledger.write(entry)
            return neighbour.name
    return ""
