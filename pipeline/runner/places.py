"""Where the records of a study are: an index of their files by kind, and by the log and joint that they are about."""

from collections.abc import Iterable

from pipeline.records import KINDS, Record
from pipeline.runner.ledger import Entry
from pipeline.runner.signature import Kinds
from pipeline.study import Study

Located = tuple[str, str]  # kind of record, file below the processed folder: a Path costs ten times what a name does
ANY = ""  # log or joint
ORDER = {kind: i for i, kind in enumerate(KINDS.values())}


class Places:
    """The files that stages made, in the order of the study's logs and the robot's joints."""

    def __init__(self, study: Study, entries: Iterable[Entry]) -> None:
        self._logs = {entry.name: i for i, entry in enumerate(study.logs)}
        self._joints = {joint.name: i for i, joint in enumerate(study.robot.joints)}
        self._names: dict[str, list[str]] = {}
        for entry in entries:
            for name in entry.outputs:
                root, _, path = name.partition("/")
                if root == "processed":
                    self._names.setdefault(path.partition("/")[0], []).append(path)
        self._indices: dict[tuple[str, bool, bool], dict[tuple[str, str], list[Located]]] = {}
        self._ranked: dict[str, list[tuple[str, str, Located]]] = {}

    def of(self, kinds: Kinds, log: str = ANY, joint: str = ANY) -> tuple[Located, ...]:
        """Files of these kinds about a log and a joint; a kind that is about no log or joint is about every one."""
        located: tuple[Located, ...] = ()
        for kind in sorted(kinds, key=ORDER.__getitem__) if len(kinds) > 1 else kinds:
            by_log, by_joint = bool(log) and is_about_log(kind), bool(joint) and is_about_joint(kind)
            index = self._index(kind, by_log, by_joint)
            located += tuple(index.get((log if by_log else ANY, joint if by_joint else ANY), ()))
        return located

    def _index(self, kind: type[Record], by_log: bool, by_joint: bool) -> dict[tuple[str, str], list[Located]]:
        """All files of a kind, by the log and by the joint that they are about, or by either, or in one."""
        which = (kind.__name__, by_log, by_joint)
        if which not in self._indices:
            index = self._indices[which] = {}
            for log, joint, located in self._sorted(kind):
                index.setdefault((log if by_log else ANY, joint if by_joint else ANY), []).append(located)
        return self._indices[which]

    def _sorted(self, kind: type[Record]) -> list[tuple[str, str, Located]]:
        """The files of a kind with what they are about, without those about a log that has left the study."""
        if kind.__name__ not in self._ranked:
            ranked = []
            for name in self._names.get(kind.folder(), []):
                log, joint = about(kind, name)
                if log == ANY or log in self._logs:
                    ranks = self._logs.get(log, len(self._logs)), self._joints.get(joint, len(self._joints))
                    ranked.append((*ranks, name, log, joint))
            self._ranked[kind.__name__] = [
                (log, joint, (kind.__name__, name)) for *_, name, log, joint in sorted(ranked)
            ]
        return self._ranked[kind.__name__]


def about(kind: type[Record], name: str) -> tuple[str, str]:
    """The log and the joint that a file is about: `track/<log>/<joint>.parquet`; "" where it is about none."""
    first, *others = name.removesuffix(".parquet").split("/")[1:]
    key = dict(zip(kind.KEY, (first, *(part for other in others for part in other.split("."))), strict=False))
    return key.get("log", ANY), key.get("joint", key.get("group", ANY))


def is_about_log(kind: type[Record]) -> bool:
    """Whether every record of a kind is about one log."""
    return "log" in kind.KEY


def is_about_joint(kind: type[Record]) -> bool:
    """Whether every record of a kind is about one joint, or about the joint that a model is of."""
    return "joint" in kind.KEY or "group" in kind.KEY
