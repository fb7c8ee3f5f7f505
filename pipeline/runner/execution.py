"""Running one task: read its records, call its stage, write what it makes.  In this process or in another."""

import importlib.metadata
import os
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from pipeline.errors import BadLog, PipelineError
from pipeline.logs.log import Log, Options
from pipeline.logs.parts import open_parts
from pipeline.records import KINDS, Diagnostic, Record, diagnostic, store
from pipeline.records.catalogue import Catalogue, Provenance
from pipeline.robots.robot import Kind
from pipeline.runner.ledger import Folders, Ledger
from pipeline.runner.plan import VERSION, Places, Task, given, study_files
from pipeline.runner.signature import Declaration, declaration
from pipeline.study import Study


@dataclass(frozen=True)
class Outcome:
    """What a task made, or why it could not, and its messages for the console."""

    task: Task
    outputs: tuple[str, ...]
    failed: str = ""
    messages: tuple[str, ...] = ()


def perform(study: Study, folders: Folders, task: Task, made_from: dict[str, Any]) -> Outcome:
    """Run one task.  Whatever goes wrong is its outcome, so that it costs no other task.

    Raises
    ------
    OSError
        If not even a diagnostic of what went wrong can be written.
    """
    asks = declaration(task.stage)
    messages: list[str] = []
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
                messages += _messages(record)
        return Outcome(
            task, tuple(f"processed/{place.as_posix()}" for place in writer.places), messages=tuple(messages)
        )
    except (PipelineError, OSError) as error:
        return _failed(study, folders, task, made_from, str(error))
    except Exception as error:
        # A fault of ours must not cost the other logs; where it happened is all that a report of it needs.
        frame = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(frame.filename).name}:{frame.lineno} in {frame.name}"
        fault = f"{type(error).__name__}: {error} ({place})"
        message = f"{fault}: a fault of davinci-forces, not of the data; please report it"
        return _failed(study, folders, task, made_from, message)


def _failed(study: Study, folders: Folders, task: Task, made_from: dict[str, Any], message: str) -> Outcome:
    """The outcome of a task that could not be done: a diagnostic of why, for the report."""
    portable = _without_folders(message, study, folders)
    with _writer(study, folders, made_from) as writer:
        writer.write(diagnostic(task.stage, task.name.replace("/", "."), "error", portable))
    places = tuple(f"processed/{place.as_posix()}" for place in writer.places)
    return Outcome(task, places, failed=portable, messages=(f"error: {message}",))


def _without_folders(message: str, study: Study, folders: Folders) -> str:
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

    files = run(Catalogue(read), study, _provenance(study, folders, places))
    for name, content in files.items():
        store.write_bytes(folders.reports / name, content)
    return tuple(f"reports/{name}" for name in files)


def _provenance(study: Study, folders: Folders, places: Places) -> Provenance:
    packages = ("numpy", "scipy", "pandas", "pyarrow", "statsmodels", "numba", "matplotlib", "bokeh", "typst", "npTDMS")
    ledger = Ledger(folders)
    files = (*study_files(study), *(file for entry in study.logs for file in entry.files))
    raw = {f"raw/{study.name}/{file}": ledger.digest(f"raw/{file}") for file in files}
    processed = {place.as_posix(): ledger.digest(f"processed/{place.as_posix()}") for _, place in places}
    failures = {f"{e.stage} {e.task}": e.failed for e in ledger.entries() if e.failed and e.stage != "report"}
    return Provenance(VERSION, {p: importlib.metadata.version(p) for p in packages}, raw, processed, failures)


def _argument(asks: Declaration, folders: Folders, task: Task, parameter: str) -> Any:
    records = [store.read(KINDS[kind], folders.processed, place) for kind, place in task.records[parameter]]
    if parameter in asks.each:
        return records[0]
    if parameter in asks.optional:
        return records[0] if records else None
    return records


def _given(what: str, study: Study, task: Task) -> Any:
    return _log(study, task) if what == "log" else given(what, study, task)


def _log(study: Study, task: Task) -> Log:
    entry = study.log(task.log)
    missing = [file for file in entry.files if not (study.folder / file).is_file()]
    if missing:
        names = ", ".join(map(repr, missing))
        raise BadLog(f"file {names} of log {entry.name!r} is not in raw/{study.name}")
    options = Options(entry.delimiter, entry.decimal, entry.header, entry.encoding)
    return open_parts([study.folder / file for file in entry.files], options)


def _messages(record: Record) -> list[str]:
    if not isinstance(record, Diagnostic):
        return []
    return [f"{s}: {t}" for s, t in zip(record.severity, record.text, strict=True) if s in ("warning", "error")]
