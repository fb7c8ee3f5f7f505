"""Which calls of a step a study and its records give, and everything that each of them depends on."""

import importlib.metadata
import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field, replace
from hashlib import sha256
from typing import Any

from davinci_forces.files import read_bytes, write_bytes
from davinci_forces.records import KINDS
from davinci_forces.robots.robot import Kind
from davinci_forces.runner.fingerprints.code import code
from davinci_forces.runner.fingerprints.fingerprint import Fingerprint, hash_of, schemas
from davinci_forces.runner.ledger import Entry, Folders, Ledger
from davinci_forces.runner.places import ANY, Located, Places, about, is_about_log
from davinci_forces.runner.signature import Declaration, stage_of
from davinci_forces.stages import module
from davinci_forces.study import Study

VERSION = importlib.metadata.version("davinci-forces")
# What makes, checks and stores every record; the others of its folder declare records, and count as `schemas`.
RECORDS = tuple(f"davinci_forces.records.{name}" for name in ("record", "store"))


@dataclass(frozen=True)
class Task:
    """One call of a step: where its records are, what else it is handed, and all that its outputs depend on."""

    step: str
    name: str  # "slide-1/hand_roll"
    fingerprint: Fingerprint
    records: dict[str, tuple[Located, ...]] = field(default_factory=dict)  # by parameter
    given: dict[str, Any] = field(default_factory=dict)  # by parameter; for a log, its entry
    settings: dict[str, Any] = field(default_factory=dict)
    joints: dict[str, tuple[Kind, str]] = field(default_factory=dict)  # whose units its records are in

    @property
    def subject(self) -> str:
        """What it is about, by a name that no other task of its stage has."""
        function = self.step.partition(".")[2]
        return self.name if function in ("", self.name) else f"{function}.{self.name}"


class Plan:
    """What there is to do on one study, as its records stand."""

    def __init__(self, study: Study, ledger: Ledger) -> None:
        self.study, self.ledger = study, ledger
        self._entries = {entry.name: entry for entry in study.logs}
        self._joints = {joint.name: (joint.kind, joint.effort) for joint in study.robot.joints}
        self._hashes: dict[tuple[str, str], str] = {}
        self._places = Places(study, ledger.entries())
        self._seen = len(ledger.changes)

    def places(self) -> Places:
        """Where the records are that there are now."""
        for gone, come in self.ledger.changes[self._seen :]:
            self._places.remove(gone)
            self._places.add(come)
        self._seen = len(self.ledger.changes)
        return self._places

    def tasks(self, asks: Declaration, log: str = "") -> Iterator[Task]:
        """Every call of a step that the study and the records that are there give, or those about one log."""
        if "weighings" in asks.given.values() and not self.study.weighings.each:
            return
        places = self.places()
        logs = (log,) if log else tuple(self._entries)
        if asks.each:
            yield from self._each_record(asks, places, log)
        elif asks.per_log:
            yield from self._each_log(asks, places, logs)
        elif "log" in asks.given.values():
            yield from (self._task(asks, name, {}, name) for name in logs)
        else:
            records = {p: places.of(kinds, role=asks.roles.get(p, ANY)) for p, kinds in asks.every.items()}
            if any(records.values()) or not asks.reads:
                yield self._task(asks, asks.name.rpartition(".")[2], records)

    def _each_record(self, asks: Declaration, places: Places, of_log: str) -> Iterator[Task]:
        [(parameter, kinds)] = asks.each.items()
        for kind, place in places.of(kinds, of_log):
            log, joint = about(KINDS[kind], place)
            others = {p: places.of(k, log, joint) for p, k in (asks.optional | asks.every).items()}
            name = _task_name(kind, place, len(kinds))
            yield self._task(asks, name, {parameter: ((kind, place),), **others}, log, joint)

    def _each_log(self, asks: Declaration, places: Places, logs: Iterable[str]) -> Iterator[Task]:
        for log in logs:
            own = {p: places.of(kinds, log) for p, kinds in asks.per_log.items()}
            if any(own.values()):
                others = {p: places.of(kinds, log) for p, kinds in asks.every.items()}
                yield self._task(asks, log, {**own, **others}, log)

    def _task(
        self, asks: Declaration, name: str, records: dict[str, tuple[Located, ...]], log: str = "", joint: str = ""
    ) -> Task:
        given = {p: self._given(what, log, joint) for p, what in asks.given.items()}
        settings = {name: getattr(self.study.settings, name) for name in asks.settings}
        inputs = {f"processed/{place}" for located in records.values() for _, place in located}
        if "log" in asks.given.values():
            inputs |= {name for file in self._entries[log].files for name in self.ledger.folders.inside(f"raw/{file}")}
        hashes = {
            what: self._hash(what, {"entry": log, "joint": joint}.get(what, ""), given[p])
            for p, what in asks.given.items()
            if what != "log"
        }
        digests = {name: self.ledger.digest(name) for name in sorted(inputs)}
        fingerprint = Fingerprint(digests, hashes, settings, schemas(asks.name), code_of(asks), VERSION)
        return Task(asks.name, name, fingerprint, records, given, settings, self._joints)

    def _given(self, what: str, log: str, joint: str) -> Any:
        """What a task is handed besides records; of a log, what says how to open it."""
        if what in ("log", "entry"):
            return self._entries[log]
        if what in ("weighings", "haptics"):
            return getattr(self.study, what)
        return self.study.robot.joint(joint) if what == "joint" else self.study.robot

    def _hash(self, what: str, name: str, value: Any) -> str:
        """The hash of what many tasks are handed, worked out once."""
        if (what, name) not in self._hashes:
            self._hashes[what, name] = hash_of(value)
        return self._hashes[what, name]


def code_of(asks: Declaration) -> dict[str, str]:
    """The code that is at work in a step, by hash."""
    opens = ("davinci_forces.logs",) if "log" in asks.given.values() else ()  # imported by none
    return code(module(stage_of(asks.name)), *RECORDS, *opens, without="davinci_forces.records")


def log_of(asks: Declaration, task: str) -> str:
    """The log that a call of a step is about, told by its name; "" for one that is about no single log."""
    if asks.each:
        [kinds] = asks.each.values()
        names = task.split("/")[len(kinds) > 1 :]
        return names[0] if all(map(is_about_log, kinds)) else ""
    return task if asks.per_log or "log" in asks.given.values() else ""


def _task_name(kind: str, place: str, kinds: int) -> str:
    name = place.removesuffix(".parquet").partition("/")[2]
    return f"{KINDS[kind].folder()}/{name}" if kinds > 1 else name


def reused(ledger: Ledger, task: Task) -> str:
    """Copy the files of this task from a study beside this one that made them of the same; its name, or ""."""
    processed = ledger.folders.processed
    if task.fingerprint.inputs:
        return ""
    now = json.loads(json.dumps(asdict(task.fingerprint)))
    for other in sorted(processed.parent.iterdir()):
        there = replace(ledger.folders, processed=other)
        entry = None if other == processed else Ledger(there).read(task.step, task.name)
        same = entry and not entry.failed and entry.fingerprint == now
        if entry and same and (contents := _contents(there, entry)):
            for name, content in contents.items():
                write_bytes(ledger.folders.file(name), content)
            ledger.write(entry)
            return other.name
    return ""


def _contents(there: Folders, entry: Entry) -> dict[str, bytes]:
    """The files of an entry, or none where one of them is not what the entry says."""
    if not all(there.file(name).is_file() for name in entry.outputs):
        return {}
    contents = {name: read_bytes(there.file(name)) for name in entry.outputs}
    whole = all(sha256(contents[name]).hexdigest() == sha for name, sha in entry.outputs.items())
    return contents if whole else {}
