"""Studies of many logs, as they stand when all stages have run, as far as their ledger knows; no file is there."""

from pathlib import Path

from davinci_forces.records import Diagnostic, Record
from davinci_forces.robots import dvrk_psm
from davinci_forces.runner.fingerprint import Fingerprint
from davinci_forces.runner.graph import every_step
from davinci_forces.runner.ledger import Entry, Folders, Ledger
from davinci_forces.runner.plan import Plan, is_about_log
from davinci_forces.runner.signature import declaration
from davinci_forces.study import LogEntry, Settings, Study

JOINTS = tuple(joint.name for joint in dvrk_psm.ROBOT.joints[:2])
CODE = {f"module_{i}.py": "0" * 64 for i in range(40)}  # about as many as a stage has


def study(home: Path, logs: int) -> tuple[Study, Folders]:
    """So many logs of two joints, each with its own entry of every stage that works on logs."""
    folders = Folders(home / "raw" / "lab", home / "processed" / "lab", home / "reports" / "lab")
    entries = tuple(LogEntry(f"log-{i}", (f"{i}.csv",), "identification", ()) for i in range(logs))
    ledger = Ledger(folders)
    for step in every_step():
        kinds = [kind for kind in declaration(step).makes if kind is not Diagnostic]
        for log in ["", *(entry.name for entry in entries)]:
            places = [place for kind in kinds if is_about_log(kind) == bool(log) for place in places_of(kind, log)]
            if places:
                outputs = {f"processed/{place}": "0" * 64 for place in places}
                ledger.write(
                    Entry(step, log or step.rpartition(".")[2], vars(Fingerprint({}, {}, {}, {}, CODE, "")), outputs)
                )
    return Study(folders.raw, "Many logs", dvrk_psm.ROBOT, False, Settings(), entries), folders


def places_of(kind: type[Record], log: str) -> list[str]:
    """Where the records of a kind about a log are, of each joint where they are about any."""
    places = []
    for joint in JOINTS:
        first, *others = (log if key == "log" else joint if key in ("joint", "group") else "a" for key in kind.KEY)
        places.append("/".join([kind.folder(), first, *([".".join(others)] if others else [])]) + ".parquet")
    return list(dict.fromkeys(places))


def planned(lab: Study, folders: Folders) -> int:
    """Plan every step and ask why each of its tasks has to run; how many there are."""
    plan, tasks = Plan(lab, Ledger(folders)), 0
    for step in every_step():
        for task in plan.tasks(declaration(step)):
            plan.ledger.reasons(plan.ledger.entry(step, task.name), task.fingerprint)
            tasks += 1
    return tasks
