"""An index of a study's record files by kind, log and joint."""

from collections.abc import Iterable, Iterator

from davinci_forces.records import KINDS, Record
from davinci_forces.runner.ledger import Entry
from davinci_forces.runner.signature import Kinds
from davinci_forces.study import Study

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
        """The records among a task's outputs, without those of logs that left the study; the order of their kinds
        is computed again.
        """
        for name in outputs:
            root, _, path = name.partition("/")
            kind = self._kinds.get(path.partition("/")[0]) if root == "processed" else None
            if kind:
                log, joint = log_and_joint(kind, path)
                if log == ANY or log in self._logs:
                    self._all.pop(kind.__name__, None)
                    yield kind, path, log, joint

    def find(self, kinds: Kinds, log: str = ANY, joint: str = ANY, role: str = ANY) -> tuple[Located, ...]:
        """Files of these kinds about a log, a joint and logs of a role.

        A record of a kind without a log applies to every log, and one without a joint to every joint.
        """
        located: tuple[Located, ...] = ()
        for kind in sorted(kinds, key=ORDER.__getitem__) if len(kinds) > 1 else kinds:
            of_joint = joint if {"joint", "group"} & {*kind.KEY} else ANY
            located += tuple(
                self._sorted(kind, [log], of_joint) if log and is_about_log(kind) else self._of_all(kind, of_joint)
            )
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
