"""Write the report of a study from all its records, as the last task of a run."""

import hashlib
import importlib.metadata
import platform
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from time import perf_counter

from davinci_forces import __version__
from davinci_forces.files import digest, read_bytes, text_of, write_together
from davinci_forces.records import KINDS, Record
from davinci_forces.records.catalogue import Catalogue, Provenance
from davinci_forces.report import REPORT
from davinci_forces.runner.execution import Outcome, error_message, without_folders
from davinci_forces.runner.fingerprint import Fingerprint, code, hash_of, package_fingerprint
from davinci_forces.runner.ledger import Ledger
from davinci_forces.runner.plan import Located, Plan, Task
from davinci_forces.runner.processes import arithmetic
from davinci_forces.runner.results import stated
from davinci_forces.study import Study, review
from davinci_forces.study.review import Rating

MAX_CACHED_ROWS = 1 << 16  # rows of a record that stays in memory while the report is made
PACKAGES = "numpy", "scipy", "pandas", "pyarrow", "statsmodels", "numba", "clarabel", "matplotlib", "typst", "npTDMS"


def task(plan: Plan) -> Task:
    """The task of the report on one study, with all that the report depends on."""
    study, ledger = plan.study, plan.ledger
    located = plan.places().find(tuple(KINDS.values()))
    inputs = [f"processed/{place}" for _, place in located] + [f"raw/{file}" for file in study_files(study)]
    reviewed = study.folder / review.FILE  # the page depends on it, the report ID does not
    review_hash = {"review": digest(reviewed)} if reviewed.is_file() else {}
    hashes = code("davinci_forces.report.report", "davinci_forces.records.store")
    fingerprint = Fingerprint(
        inputs={name: ledger.digest(name) for name in sorted(inputs)},
        given={"study": hash_of(replace(study, folder=Path(study.name)))} | review_hash,
        settings=asdict(study.settings), schemas={}, code=hashes | {"the whole package": package_fingerprint()},
        version=__version__,
    )  # fmt: skip
    return Task(REPORT, REPORT, fingerprint, {"records": located}, {"study": study})


def perform(ledger: Ledger, task: Task) -> Outcome:
    """Write all files of the report or none.  An error becomes the outcome, and earlier pages stay."""
    start = perf_counter()
    try:
        files = render(ledger, task)
        write_together({ledger.folders.reports / name: content for name, content in files.items()})
        outputs = {f"reports/{name}": hashlib.sha256(content).hexdigest() for name, content in files.items()}
        return Outcome(task, outputs, seconds=perf_counter() - start)
    except Exception as error:
        message, before = error_message(error), ledger.entry(task.step, task.name)
        earlier = before.outputs if before else {}
        messages = [f"error: {message}"]
        if any(map(ledger.digest, earlier)):
            messages.append(f"the pages in {ledger.folders.reports} are those of an earlier run")
        return Outcome(task, earlier, without_folders(message, ledger.folders), tuple(messages))


def render(ledger: Ledger, task: Task) -> dict[str, bytes]:
    """The content of the report's files, by name; raises BadRecord if a record cannot be read."""
    from davinci_forces.report.report import write_report  # importing its plotting library takes longer than most runs

    study, located = task.given["study"], task.records["records"]
    baseline = stated.read(study.folder / study.baseline) if study.baseline else None
    return write_report(catalogue(ledger, located), study, provenance(study, ledger, located), baseline, ratings(study))


def ratings(study: Study) -> tuple[Rating, ...]:
    """The reviewers' ratings of the study's report, if its folder holds any."""
    file = study.folder / review.FILE
    return review.read(file) if file.exists() else ()


def catalogue(ledger: Ledger, located: tuple[Located, ...]) -> Catalogue:
    """A catalogue of the records at these places, each read when it is used."""
    from davinci_forces.records import store

    def read(kind: type[Record]) -> list[Record]:
        stored = {place: ledger.digest(f"processed/{place}") for name, place in located if name == kind.__name__}
        folder = ledger.folders.processed
        return [store.read(kind, folder, Path(place), sha, MAX_CACHED_ROWS) for place, sha in stored.items()]

    return Catalogue(read)


def provenance(study: Study, ledger: Ledger, located: tuple[Located, ...]) -> Provenance:
    """Versions, the hash of every file, and the tasks that failed."""
    listed = (*study_files(study), *(file for entry in study.logs for file in entry.files))
    files = [name.removeprefix("raw/") for file in listed for name in ledger.folders.expand(f"raw/{file}")]
    raw = {f"raw/{study.name}/{file}": ledger.digest(f"raw/{file}") for file in files}
    processed = {place: ledger.digest(f"processed/{place}") for _, place in located}
    failed = [entry for entry in ledger.entries() if entry.failed and entry.stage != REPORT]
    failures = {" ".join([*entry.stage.split("."), entry.task]): entry.failed for entry in failed}
    text = text_of(read_bytes(study.folder / "study.toml"), errors="replace")
    return Provenance(study.name, __version__, versions(), raw, processed, failures, text, package_fingerprint())


def versions() -> dict[str, str]:
    """Versions of the packages that results and pages are made with, and the arithmetic of this process."""
    return {p: importlib.metadata.version(p) for p in PACKAGES} | {"arithmetic": arithmetic.description()}


@cache
def environment() -> str:
    """The hash of the packages and the kind of processor, on which the bytes of results depend, too."""
    machine = platform.python_version(), platform.system(), platform.machine(), arithmetic.instructions()
    return hash_of((versions(), *machine))[:16]


def study_files(study: Study) -> tuple[str, ...]:
    """The files of a study other than its logs."""
    names = ("study.toml", study.robot.file, "truth.toml" if study.truth else "", study.haptics_file, study.baseline)
    return tuple(name for name in names if name)
