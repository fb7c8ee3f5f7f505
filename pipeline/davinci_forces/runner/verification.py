"""Check that a study is unaltered and complete, that its records give its report, and raw/ the same results again."""

import json
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import redirect_stderr, suppress
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from davinci_forces.errors import NotReproduced
from davinci_forces.files import read_bytes
from davinci_forces.records.record import groups_of
from davinci_forces.report import REPORT
from davinci_forces.report.results import MANIFEST, identity
from davinci_forces.runner import ALL, reporting, runs
from davinci_forces.runner.console import shorten
from davinci_forces.runner.execution import error_message
from davinci_forces.runner.graph import every_step
from davinci_forces.runner.ledger import Folders, Ledger, file_name
from davinci_forces.runner.plan import Plan, Task
from davinci_forces.runner.signature import declaration, stage_of
from davinci_forces.study import Study, review

MAX_NAMES = 5  # names of files or tasks in one message
PAGES = ".html", ".pdf"
ENTRY = re.compile(r"processed/tasks/[^./][^/]*/[^./][^/]*\.json")  # files that a ledger reads
# Files that systems leave in any folder, the lock of a run, the mark by which workers of a cluster know a folder, and
# the index of entries that earlier versions wrote.
IGNORED = re.compile(
    r"(.*/)?(\.DS_Store|Thumbs\.db|desktop\.ini|\._[^/]*)|processed/\.(lock(-[0-9a-f]+)?(/.*)?|run-[0-9a-f]{12})"
    r"|processed/tasks/index\.json"
)
MAX_ROUNDING = 1e-9  # relative change of a number that counts as unchanged
MAX_RELATIVE_CHANGE = 1e-6  # relative change of a number without standard deviation
MAX_CHANGE_BY_STD = 0.1  # change of a number, or of its standard deviation, over the standard deviation
MAX_ZERO = 1e-12  # in any unit: a number up to this size is a rounding error of 0
# Keys of results that depend strongly on the last digits of other numbers are not limited.  With other kernels of BLAS
# and without AVX2 in numpy, all other numbers of the demonstration, a UR10e and a dVRK are within the limits.
UNLIMITED = re.compile(
    r"ekf-adaptive\..*"  # the noise is tuned to innovations that depend on the noise
    r"|.*\.pso\..*"  # a swarm follows its best particle
    r"|control\..*"  # an integrator chooses its steps
    r"|(haptics|stability)\..*"  # bisection for the tissue at which a simulated hand begins to diverge
    r"|.*\.push_delay|tissue\..*\.onset"  # counted in samples until a level is passed
)
DIFFERENT, FAR = "differ by more than 1e-9 of their size", "differ by more than their standard deviation"
NOT_LIMITED = "differ without a limit, since they come from a search or a count of samples"
NEW, MISSING, WRONG = "are not in results.json", "are not computed from raw/", "do not agree with raw/"


@dataclass(frozen=True)
class Verified:
    """Number of files and numbers that were compared, and the report ID."""

    raw: int
    processed: int
    reports: int
    numbers: int
    identity: str
    unrelated: tuple[str, ...]  # files that are not part of the results


def verify(study: Study, folders: Folders, report_id: str = "", pages: bool = True) -> Verified:
    """Hash all files that a run reads and makes, compare the ledger with the plan, and render the report again.

    `report_id` is the expected one, or "" for any.  Without `pages`, only the numbers of the report are compared.
    Raises NotReproduced with all differences, one per line.
    """
    ledger = Ledger(folders)
    recorded: dict[str, dict[str, str]] = {}  # files that tasks read or made: for each hash, a task that did
    for entry in ledger.entries():
        for name, sha in (*entry.fingerprint["inputs"].items(), *entry.outputs.items()):
            recorded.setdefault(name, {}).setdefault(sha, f"{entry.stage} {entry.task}")
    problems = [f"{file} was altered: {reason}" for file, reason in ledger.invalid_files().items()]
    if not recorded and not problems:
        raise NotReproduced(f"{folders.processed} has no results; run `davinci-forces all {folders.raw}` first")
    strays, unrelated = unknown_files(folders, recorded)
    problems += [*altered_files(folders, ledger, recorded), *strays]
    plan = Plan(study, ledger)
    report = reporting.task(plan)
    problems += differences_from_plan(plan, report)
    contents, numbers = {}, 0
    try:
        contents = reporting.render(ledger, report)
        numbers = len(json.loads(contents["results.json"]))
    except Exception as error:  # altered records may break the report in any way
        problems.append(f"the report cannot be written again: {error_message(error)}")
    compared = [name for name in contents if pages or not name.endswith(PAGES)]
    problems += [problem for name in compared for problem in altered_page(folders, name, contents[name])]
    actual_id = identity(contents[MANIFEST]) if contents else ""
    if report_id and actual_id != report_id:
        what = f"the report ID of these files is {actual_id or 'unknown'}, not {report_id}"
        problems.append(f"{what}: they are of another report")
    if problems and not has_same_environment(folders):
        problems.append(
            "last digits may differ: some files were made with other packages, on another kind of processor, or in "
            "Python where numpy was loaded before `davinci_forces.run`; `davinci-forces report --force` makes the "
            "pages again, and `davinci-forces verify --again` compares all numbers"
        )
    if problems:
        raise NotReproduced("\n".join(problems))
    count = Counter(name.partition("/")[0] for name in recorded if ledger.digest(name))
    return Verified(count["raw"], count["processed"], count["reports"], numbers, actual_id, tuple(unrelated))


def altered_files(folders: Folders, ledger: Ledger, recorded: dict[str, dict[str, str]]) -> Iterator[str]:
    """Report files that changed since a task read or made them."""
    for name, hashes in sorted(recorded.items()):
        file, now = folders.file(name), ledger.digest(name)
        if not now and any(hashes):
            yield f"{file} is {'no file' if os.path.lexists(file) else 'missing'}"
            continue
        for before, task in hashes.items():
            if not before and now:
                yield f"{file} exists now, and did not for {task}"
            elif now != before:
                yield f"{file} was altered: its SHA-256 is {now[:16]}..., and was {before[:16]}... for {task}"


def unknown_files(folders: Folders, recorded: Iterable[str]) -> tuple[list[str], list[str]]:
    """Problems with links and unknown files among the results, and the files in raw/ that no stage read."""
    paths = {*recorded, f"raw/{review.FILE}"}
    problems: list[str] = []
    unrelated: list[str] = []
    for root in ("processed", "reports", "raw"):
        home = str(getattr(folders, root))
        for folder, inside, files in os.walk(home):
            links = [name for name in inside if os.path.islink(f"{folder}{os.sep}{name}")]  # not followed by os.walk
            for file in (f"{folder}{os.sep}{name}" for name in (*files, *links)):
                name = f"{root}{file[len(home) :]}".replace(os.sep, "/")
                if root != "raw" and os.path.islink(file):
                    problems.append(f"{file} is a link to {os.readlink(file)}; results are not read through links")
                elif name in paths or ENTRY.fullmatch(name) or (links and any(p.startswith(f"{name}/") for p in paths)):
                    continue
                elif root == "raw":
                    unrelated.append(file)
                elif not IGNORED.fullmatch(name):
                    problems.append(f"{file} was made by no stage of this study")
    return sorted(problems), sorted(unrelated)


def differences_from_plan(plan: Plan, report: Task) -> Iterator[str]:
    """Tasks that a run would run again, and entries in the ledger of tasks that the study does not have."""
    ledger = plan.ledger
    steps = (*every_step(), REPORT)
    for name in sorted({entry.stage for entry in ledger.entries()} - {*steps}):
        yield f"{ledger.folders.processed / 'tasks' / name} has entries of {name}, which is not a stage"
    for step in steps:
        tasks = [report] if step == REPORT else list(plan.tasks(declaration(step)))
        planned = {file_name(task.name) for task in tasks}
        extra = [entry.task for entry in ledger.entries(step) if file_name(entry.task) not in planned]
        if extra:
            what = "the ledger has entries of tasks that this study does not have"
            yield f"{stage_of(step)}: {what}: {shorten(extra, MAX_NAMES)}"
        yield from stale(ledger, tasks)


def stale(ledger: Ledger, tasks: Sequence[Task]) -> Iterator[str]:
    """Tasks of a step that are not up to date, without the reason of altered files, which are reported by file."""
    by_reason: dict[str, list[str]] = {}
    for task in tasks:
        entry = ledger.entry(task.step, task.name)
        reasons = ["it is not in the ledger, so it has not run, or its entry was removed"]
        if entry is not None:
            changed = [] if entry.failed else ledger.reasons(entry, task.fingerprint)
            reasons = [reason for reason in changed if not reason.endswith("was altered")][:2]
        for reason in reasons:
            by_reason.setdefault(reason, []).append(task.name)
    for reason, names in by_reason.items():
        yield f"{stage_of(tasks[0].step)}: {shorten(names, MAX_NAMES)}: {reason}"


def altered_page(folders: Folders, name: str, content: bytes) -> Iterator[str]:
    """Report a file of the report that differs from `content`, and for results.json each number that does."""
    file = folders.reports / name
    if not os.path.lexists(file):
        yield f"{file} is missing"
        return
    with suppress(OSError):  # it is larger, or no file
        if read_bytes(file, len(content)) == content:
            return
    has_numbers = name == "results.json" and file.is_file()
    problems = list(altered_numbers(str(file), read_bytes(file), content)) if has_numbers else []
    yield from problems or [f"{file} differs from what its records give"]


def altered_numbers(file: str, content: bytes, expected_content: bytes) -> Iterator[str]:
    """Report results that are missing, repeated, unknown, or differ from those that the records give."""
    expected: dict[str, dict[str, Any]] = {result["key"]: result for result in json.loads(expected_content)}
    try:
        results = [dict(result) for result in json.loads(content)]
    except (ValueError, TypeError) as error:
        yield f"{file} cannot be read: {error}"
        return
    counts = Counter(str(result.get("key")) for result in results)
    yield from (f"{file}: {key} is missing" for key in expected if key not in counts)
    yield from (f"{file}: {key} appears {count} times" for key, count in counts.items() if count > 1)
    for result in results:
        key = str(result.get("key"))
        if key not in expected:
            yield f"{file}: {key} comes from no record of this study"
            continue
        for name, value in expected[key].items():
            if name not in result or result[name] != value:
                yield f"{file}: {key}: has {name} {result.get(name)!r}, but its records give {value!r}"


def has_same_environment(folders: Folders) -> bool:
    """Whether all results were made with the packages and the kind of processor of this process."""
    return {entry.environment for entry in Ledger(folders).entries()} == {reporting.environment()}


def recompute(folders: Folders, by_bytes: bool, jobs: int = 1) -> list[str]:
    """Recompute a study from raw/ in a temporary folder, and compare files byte by byte, or else numbers.

    Raises NotReproduced if a task fails that did not fail before, or files or numbers do not agree.
    """
    with TemporaryDirectory(prefix="davinci-forces-") as home:
        new = runs.folders(folders.raw, Path(home, "processed"), Path(home, "reports"))
        with redirect_stderr(StringIO()):  # the warnings were printed when the results were made
            runs.run(folders.raw, ALL, new.processed.parent, new.reports.parent, jobs=jobs, verbosity="quiet")
        stored, computed = Ledger(folders), Ledger(new)
        before = {(entry.stage, entry.task) for entry in stored.entries() if entry.failed}
        if failed := [e for e in computed.entries() if e.failed and (e.stage, e.task) not in before]:
            lines = (f"recomputed from raw/, {e.stage} fails on {e.task}: {e.failed}" for e in failed)
            raise NotReproduced("\n".join(lines))
        if by_bytes:
            return compare_files(stored, computed)
        results = (json.loads(read_bytes(side.reports / "results.json")) for side in (folders, new))
        return compare_numbers(*({row["key"]: row for row in rows} for rows in results))


def compare_files(stored: Ledger, computed: Ledger) -> list[str]:
    """Compare all outputs by their hashes, in the order of the stages; raises as `recompute` does."""
    by_stage = (sorted(ledger.entries(), key=lambda e: ALL.index(stage_of(e.stage))) for ledger in (stored, computed))
    old, new = ({name: sha for e in entries for name, sha in e.outputs.items()} for entries in by_stage)
    if different := [str(stored.folders.file(name)) for name in old | new if old.get(name) != new.get(name)]:
        count = f"{len(different)} of {len(old | new)} files differ from those recomputed from raw/"
        raise NotReproduced(f"{count}: {shorten(different, MAX_NAMES)}")
    return [f"recomputed from raw/: {len(new)} files are the same, byte for byte"]


def compare_numbers(old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    """Compare results by key, within the limits; raises as `recompute` does."""
    pairs = ((what, key) for key in old | new for what in differences(key, old.get(key), new.get(key)))
    groups = {DIFFERENT: list[str](), FAR: list[str]()} | groups_of(pairs)
    examples = {what: f" ({shorten(keys, MAX_NAMES)})" if keys else "" for what, keys in groups.items()}
    counts = "; ".join(f"{len(groups[what])} {what}{names}" for what, names in examples.items())
    head = "recomputed from raw/ with another processor or packages, so compared by number and not by byte"
    text = f"{head}: of {len(new)} numbers {counts}"
    if groups.keys() & {NEW, MISSING, WRONG}:
        raise NotReproduced(text)
    return [text]


def differences(key: str, old: dict[str, Any] | None, new: dict[str, Any] | None) -> Iterator[str]:
    """How a number of results.json, its unit and its standard deviation differ from the recomputed ones."""
    if not old or not new:
        yield MISSING if old else NEW
        return
    std, size = new["std"] or 0.0, abs(new["value"])
    difference = abs(old["value"] - new["value"])
    if difference > max(MAX_ROUNDING * size, MAX_ZERO):
        yield DIFFERENT
        if UNLIMITED.fullmatch(key):
            yield NOT_LIMITED
    if 0 < std < difference:
        yield FAR
    deviates = abs((old["std"] or 0.0) - std) > MAX_CHANGE_BY_STD * std
    differs = difference > (MAX_CHANGE_BY_STD * std or max(MAX_RELATIVE_CHANGE * size, MAX_ZERO))
    if not UNLIMITED.fullmatch(key) and (differs or deviates or old["unit"] != new["unit"]):
        yield WRONG
