"""Which calls of a stage a study and its records give, and everything that each of them depends on."""

import importlib.metadata
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from pipeline.records import KINDS
from pipeline.runner.ledger import Fingerprint, Ledger, code, hash_of
from pipeline.runner.signature import Declaration, Kinds
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
class Plan:
    """What there is to do on one study, as its records stand."""

    study: Study
    ledger: Ledger

    def tasks(self, asks: Declaration) -> Iterator[Task]:
        """Every call of a stage that the study and the records that are there give."""
        every = {p: self.places(kinds) for p, kinds in asks.every.items()}
        if asks.name == "report":
            yield Task("report", "report", {"records": self.places(tuple(KINDS.values()))})
        elif asks.each:
            [(parameter, kinds)] = asks.each.items()
            optional = {p: self.places(k) for p, k in asks.optional.items()}
            for kind, place in self.places(kinds):
                log, joint = _about(place)
                same = {p: tuple(x for x in places if _about(x[1]) == (log, joint)) for p, places in optional.items()}
                records = {parameter: ((kind, place),), **same, **every}
                yield Task(asks.name, _task_name(kind, place, len(kinds)), records, log, joint)
        elif asks.per_log:
            per_log = {p: self.places(k) for p, k in asks.per_log.items()}
            for entry in self.study.logs:
                own = {p: tuple(x for x in places if _about(x[1])[0] == entry.name) for p, places in per_log.items()}
                if any(own.values()):
                    yield Task(asks.name, entry.name, {**own, **every}, entry.name)
        elif "log" in asks.given.values():
            yield from (Task(asks.name, entry.name, log=entry.name) for entry in self.study.logs)
        elif any(every.values()) or not asks.reads:
            yield Task(asks.name, asks.name, every)

    def places(self, kinds: Kinds) -> Places:
        """Files of these kinds that the stages made, in the order of the study's logs and the robot's joints."""
        kind_names = {kind.folder(): kind.__name__ for kind in kinds}
        located = []
        for stage in STAGES:
            for entry in self.ledger.entries(stage):
                for name in entry.outputs:
                    root, _, path = name.partition("/")
                    folder = path.partition("/")[0]
                    if root == "processed" and folder in kind_names:
                        located.append((kind_names[folder], Path(path)))
        return tuple(sorted(located, key=self._order))

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

    def fingerprint(self, asks: Declaration, task: Task) -> Fingerprint:
        """Everything that the outputs of a task depend on, as it is now."""
        inputs = {f"processed/{place.as_posix()}" for places in task.records.values() for _, place in places}
        if "log" in asks.given.values():
            inputs |= {f"raw/{file}" for file in self.study.log(task.log).files}
        if asks.name == "report":
            inputs |= {f"raw/{file}" for file in study_files(self.study)}
        given_ = {what: hash_of(given(what, self.study, task)) for what in asks.given.values() if what != "log"}
        settings = asdict(self.study.settings)
        chosen = settings if "study" in asks.given.values() else {name: settings[name] for name in asks.settings}
        hashes = {name: self.ledger.digest(name) for name in sorted(inputs)}
        # The store reads and writes for every stage, and the readers open the log, without being imported by any.
        at_work = ("pipeline.records.store", *(("pipeline.logs",) if "log" in asks.given.values() else ()))
        return Fingerprint(hashes, given_, chosen, code(f"pipeline.stages.{asks.name}", *at_work), VERSION)


def study_files(study: Study) -> tuple[str, ...]:
    """The files of a study besides its logs."""
    return tuple(file for file in ("study.toml", study.robot_file, "truth.toml" if study.truth else "") if file)


def given(what: str, study: Study, task: Task) -> Any:
    """What a task is handed besides records and the log."""
    if what == "entry":
        return study.log(task.log)
    if what == "joint":
        return study.robot.joint(task.joint)
    return study.robot if what == "robot" else replace(study, folder=Path(study.name))


def _about(place: Path) -> tuple[str, str]:
    """The log and the joint that a file is about: `track/<log>/<joint>.parquet`."""
    return (place.parts[1], place.stem.partition(".")[0]) if len(place.parts) > 2 else (place.stem, "")


def _task_name(kind: str, place: Path, kinds: int) -> str:
    name = "/".join(place.with_suffix("").parts[1:])
    return f"{KINDS[kind].folder()}/{name}" if kinds > 1 else name
