"""Whether a study's files and numbers are those of a run on its logs, and its report the one that they give."""

import json
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from davinci_forces.errors import NotReproduced
from davinci_forces.files import read_bytes
from davinci_forces.report import REPORT
from davinci_forces.report.results import MANIFEST, identity
from davinci_forces.runner import reporting
from davinci_forces.runner.execution import said_of
from davinci_forces.runner.graph import every_step
from davinci_forces.runner.ledger import INDEX, Folders, Ledger, file_name
from davinci_forces.runner.plan import Plan, Task
from davinci_forces.runner.signature import declaration, stage_of
from davinci_forces.study import Study, review

MOST = 5  # files or tasks that are named of many that differ alike
PAGES = ".html", ".pdf"
ENTRY = re.compile(r"processed/tasks/[^./][^/]*/[^./][^/]*\.json")  # what a ledger reads
# Files that systems leave in any folder, the lock of a run, and the mark by which workers of a cluster know a folder.
BESIDES = re.compile(
    r"(.*/)?(\.DS_Store|Thumbs\.db|desktop\.ini|\._[^/]*)|processed/\.(lock(-[0-9a-f]+)?(/.*)?|run-[0-9a-f]{12})"
)


@dataclass(frozen=True)
class Verified:
    """How much was compared, and what the report is called."""

    raw: int
    processed: int
    reports: int
    numbers: int
    identity: str
    unrelated: tuple[str, ...]  # files beside these that are no results


def verify(study: Study, folders: Folders, wanted: str = "", pages: bool = True) -> Verified:
    """Hash every file that a run reads and makes, compare what was run with what there is to run, and make the report
    anew; `wanted` is the report ID that it has to have, "" for any.  Without `pages` only its numbers are compared.

    Raises
    ------
    NotReproduced
        With everything that is not what it was, or what it would be, one a line.
    """
    ledger = Ledger(folders, one_by_one=True)
    recorded = known_files(ledger)
    problems = [f"{file} was altered: {reason}" for file, reason in ledger.void().items()]
    if not recorded and not problems:
        raise NotReproduced(f"{folders.processed} holds no results; run `davinci-forces all {folders.raw}` first")
    strays, unrelated = unknown_files(folders, recorded)
    problems += [*altered_index(ledger), *altered_files(folders, ledger, recorded), *strays]
    plan = Plan(study, ledger)
    report = reporting.task(plan)
    problems += differences_from_plan(plan, report)
    made, numbers = {}, 0
    try:
        made = reporting.written(ledger, report)
        numbers = len(json.loads(made["results.json"]))
    except Exception as error:  # whatever becomes of a report that lacks what was altered
        problems.append(f"the report cannot be made anew: {said_of(error)}")
    compared = [name for name in made if pages or not name.endswith(PAGES)]
    problems += [problem for name in compared for problem in altered_page(folders, name, made[name])]
    is_called = identity(made[MANIFEST]) if made else ""
    if wanted and is_called != wanted:
        problems.append(
            f"the report ID of these files is {is_called or 'unknown'}, not {wanted}: they are of another report"
        )
    if problems:
        raise NotReproduced("\n".join(problems))
    count = Counter(name.partition("/")[0] for name in recorded if ledger.digest(name))
    return Verified(count["raw"], count["processed"], count["reports"], numbers, is_called, tuple(unrelated))


def known_files(ledger: Ledger) -> dict[str, dict[str, str]]:
    """Every file that a task read or made, by the hashes that it had, each with the task that knew it so."""
    recorded: dict[str, dict[str, str]] = {}
    for entry in ledger.entries():
        for name, sha in (*entry.fingerprint["inputs"].items(), *entry.outputs.items()):
            recorded.setdefault(name, {}).setdefault(sha, f"{entry.stage} {entry.task}")
    return recorded


def altered_index(ledger: Ledger) -> Iterator[str]:
    """Whether the index, where there is one, says what the entries do."""
    file = ledger.home / INDEX
    if os.path.lexists(file) and not _holds(file, ledger.index()):
        yield f"{file} is not what the entries beside it say; remove it, it is made anew by the next run"


def altered_files(folders: Folders, ledger: Ledger, recorded: dict[str, dict[str, str]]) -> Iterator[str]:
    """Files whose content is not what was hashed when they were read or made, by each task that did."""
    for name, hashes in sorted(recorded.items()):
        file, now = folders.file(name), ledger.digest(name)
        if not now and any(hashes):
            yield f"{file} is {'no file' if os.path.lexists(file) else 'gone'}"
            continue
        for was, task in hashes.items():
            if now == was:
                continue
            if not was:
                yield f"{file} is there now, and was not for {task}"
            else:
                yield f"{file} was altered: its SHA-256 is {now[:16]}..., and was {was[:16]}... for {task}"


def unknown_files(folders: Folders, recorded: Iterable[str]) -> tuple[list[str], list[str]]:
    """What is wrong with links, and with files that no stage made, among the results; and the files that are no part
    of them: those of the system, and in raw/ those that no stage read.
    """
    known = {*recorded, f"processed/tasks/{INDEX}", f"raw/{review.FILE}"}
    problems: list[str] = []
    unrelated: list[str] = []
    for root in ("processed", "reports", "raw"):
        home = str(getattr(folders, root))
        for folder, inside, files in os.walk(home):
            links = [each for each in inside if os.path.islink(f"{folder}{os.sep}{each}")]  # which it does not follow
            for file in (f"{folder}{os.sep}{each}" for each in (*files, *links)):
                name = f"{root}{file[len(home) :]}".replace(os.sep, "/")
                if root != "raw" and os.path.islink(file):
                    problems.append(f"{file} is a link to {os.readlink(file)}; results are not read through links")
                elif name in known or ENTRY.fullmatch(name) or (links and any(k.startswith(f"{name}/") for k in known)):
                    continue
                elif root == "raw" or BESIDES.fullmatch(name):
                    unrelated.append(file)
                else:
                    problems.append(f"{file} was made by no stage of this study")
    return sorted(problems), sorted(unrelated)


def differences_from_plan(plan: Plan, report: Task) -> Iterator[str]:
    """What a run would do again, and entries in the ledger of what it would not do."""
    ledger = plan.ledger
    steps = (*every_step(), REPORT)
    for name in sorted({entry.stage for entry in ledger.entries()} - {*steps}):
        yield f"{ledger.folders.processed / 'tasks' / name} holds entries of {name}, and there is no such stage"
    for step in steps:
        tasks = [report] if step == REPORT else list(plan.tasks(declaration(step)))
        planned = {file_name(task.name) for task in tasks}
        extra = [entry.task for entry in ledger.entries(step) if file_name(entry.task) not in planned]
        if extra:
            yield f"{stage_of(step)}: the ledger has entries of what this study has no call for: {listing(extra)}"
        yield from stale(ledger, tasks)


def stale(ledger: Ledger, tasks: Sequence[Task]) -> Iterator[str]:
    """Tasks of a step that did not run as they would now; files that were altered are said of the files."""
    by_reason: dict[str, list[str]] = {}
    for task in tasks:
        entry = ledger.entry(task.step, task.name)
        if entry is None:
            by_reason.setdefault("it is not in the ledger, so it has not run, or its entry was removed", []).append(
                task.name
            )
        elif not entry.failed:
            changed = (r for r in ledger.reasons(entry, task.fingerprint) if not r.endswith("was altered"))
            for reason in list(changed)[:2]:
                by_reason.setdefault(reason, []).append(task.name)
    for reason, names in by_reason.items():
        yield f"{stage_of(tasks[0].step)}: {listing(names)}: {reason}"


def altered_page(folders: Folders, name: str, content: bytes) -> Iterator[str]:
    """Whether a file of the report is what these records and this version give; of results.json, which numbers."""
    file = folders.reports / name
    if not os.path.lexists(file):
        yield f"{file} is gone"
    elif not _holds(file, content):
        of_numbers = name == "results.json" and file.is_file()
        numbers = list(altered_numbers(str(file), read_bytes(file), content)) if of_numbers else []
        yield from numbers or [f"{file} is not what its records give when it is made anew"]


def _holds(file: Path, content: bytes) -> bool:
    """Whether a file has this content, and is one."""
    try:
        return read_bytes(file, len(content)) == content
    except OSError:
        return False


def altered_numbers(file: str, found: bytes, made: bytes) -> Iterator[str]:
    """Results that are not those that the records give, are gone, or are of no record."""
    expected: dict[str, dict[str, Any]] = {result["key"]: result for result in json.loads(made)}
    try:
        results = [dict(result) for result in json.loads(found)]
    except (ValueError, TypeError) as error:
        yield f"{file} cannot be read: {error}"
        return
    seen = Counter(str(result.get("key")) for result in results)
    yield from (f"{file}: {key} is gone" for key in expected if key not in seen)
    yield from (f"{file}: {key} stands there {count} times" for key, count in seen.items() if count > 1)
    for result in results:
        key = str(result.get("key"))
        if key not in expected:
            yield f"{file}: {key} comes from no record of this study"
            continue
        for name, value in expected[key].items():
            if name not in result or result[name] != value:
                yield f"{file}: {key}: says {name} {result.get(name)!r}, but its records give {value!r}"


def listing(names: Sequence[str]) -> str:
    """The first of many names, and how many more there are."""
    return ", ".join(names[:MOST]) + (f" and {len(names) - MOST} more" if len(names) > MOST else "")
