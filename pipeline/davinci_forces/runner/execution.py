"""Running one task: read its records, call its function, write what it makes.  In this process or in another."""

import errno
import os
import traceback
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import Any

from davinci_forces.errors import BadLog, PipelineError
from davinci_forces.files import digest
from davinci_forces.logs.joined import open_joined
from davinci_forces.logs.log import Log, Options
from davinci_forces.logs.parts import open_parts
from davinci_forces.records import KINDS, Diagnostic, Record, diagnostic, store
from davinci_forces.robots.robot import Kind
from davinci_forces.runner.ledger import Folders, file_name
from davinci_forces.runner.places import Located, is_about_log
from davinci_forces.runner.plan import Task
from davinci_forces.runner.signature import declaration, function_of, stage_of
from davinci_forces.study import LogEntry


@dataclass(frozen=True)
class Outcome:
    """What a task made, or why it could not, and its messages for the console."""

    task: Task
    outputs: dict[str, str]  # file -> sha256
    failed: str = ""
    messages: tuple[str, ...] = ()
    seconds: float = 0.0


def perform(folders: Folders, task: Task, mark: Path | None = None) -> Outcome:
    """Run one task.  Whatever goes wrong is its outcome, so that it costs no other task.

    Raises
    ------
    Exception
        If not even a diagnostic of what went wrong can be written, or the run has ended, whose mark is then gone: the
        next one may have removed what this task was writing.
    """
    messages: list[str] = []
    start = perf_counter()
    try:
        with _writer(folders, task) as writer:
            for record in function_of(task.step)(**arguments(folders, task)):
                writer.write(record)
                messages += _messages(record)
                del record  # before the stage makes the next
        return Outcome(task, _made(writer), messages=tuple(messages), seconds=perf_counter() - start)
    except Exception as error:
        if mark and not mark.exists():
            raise
        said = said_of(error)
        failed = without_folders(said, folders)
        with _writer(folders, task) as writer:
            writer.write(diagnostic(stage_of(task.step), file_name(task.subject), "error", failed))
        return Outcome(task, _made(writer), failed, (f"error: {said}",), perf_counter() - start)
    finally:
        store.release()


def said_of(error: Exception) -> str:
    """What went wrong in a task.  A fault of ours must not cost the other logs, so it is said like any other."""
    if isinstance(error, OSError) and error.errno == errno.ENAMETOOLONG:
        return f"{error}; what is about a log is stored under its name: give it a shorter one in study.toml"
    if isinstance(error, PipelineError | OSError):
        return str(error)
    # Where it happened is all that a report of it needs.
    frame = traceback.extract_tb(error.__traceback__)[-1]
    fault = f"{type(error).__name__}: {error} ({Path(frame.filename).name}:{frame.lineno} in {frame.name})"
    return f"{fault}: a fault of davinci-forces, not of the data; please report it"


def without_folders(message: str, folders: Folders) -> str:
    """A message without the folders of this machine, as what is kept of it has to be the same on every one."""
    for folder in (folders.processed, folders.reports, folders.raw):
        message = message.replace(f"{folder}{os.sep}", "")
    return message


def arguments(folders: Folders, task: Task) -> dict[str, Any]:
    """Everything that a task's function is called with."""
    asks = declaration(task.step)
    handed: dict[str, Any] = dict(task.settings)
    for parameter, located in task.records.items():
        if parameter in asks.in_turn:
            handed[parameter] = InTurn(folders, task, located)
            continue
        records = [_record(folders, task, each) for each in located]
        alone = parameter in asks.each or parameter in asks.optional
        handed[parameter] = next(iter(records), None) if alone else records
    for parameter, value in task.given.items():
        handed[parameter] = _log(folders, value) if asks.given[parameter] == "log" else value
    return handed


@dataclass(frozen=True)
class InTurn(Collection[Record]):
    """Records that are read whenever they are come to, and not kept: all of a long log would take much memory."""

    folders: Folders
    task: Task
    located: tuple[Located, ...]

    def __iter__(self) -> Iterator[Record]:
        return (_record(self.folders, self.task, each) for each in self.located)

    def __len__(self) -> int:
        return len(self.located)

    def __contains__(self, record: object) -> bool:
        return any(record is each for each in self)


def _record(folders: Folders, task: Task, located: Located) -> Record:
    kind, place = located
    sha256 = task.fingerprint.inputs[f"processed/{place}"]
    # What is about a joint is read by the tasks of all its logs, and is small.
    read = _read if is_about_log(KINDS[kind]) else _kept
    return read(kind, folders.processed, place, sha256)


def _read(kind: str, folder: Path, place: str, sha256: str) -> Record:
    return store.read(KINDS[kind], folder, Path(place), sha256)


_kept = lru_cache(maxsize=256)(_read)


@contextmanager
def _writer(folders: Folders, task: Task) -> Iterator[store.Writer]:
    def unit(record: Record) -> store.Unit:
        name = getattr(record, "joint", getattr(record, "group", ""))
        kind, measured = task.joints.get(name, (Kind.REVOLUTE, ""))
        return lambda template: kind.unit(template, measured)

    with store.Writer(folders.processed, unit, vars(task.fingerprint)) as writer:
        yield writer


def _made(writer: store.Writer) -> dict[str, str]:
    return {f"processed/{place.as_posix()}": digest(writer.folder / place) for place in writer.places}


def _log(folders: Folders, entry: LogEntry) -> Log:
    missing = [file for file in entry.files if not (folders.raw / file).exists()]
    if missing:
        names = ", ".join(map(repr, missing))
        raise BadLog(f"file {names} of log {entry.name!r} is not in raw/{folders.raw.resolve().name}")
    options = Options(entry.delimiter, entry.decimal, entry.header, entry.encoding, entry.dtype, entry.columns)
    files = [folders.raw / file for file in entry.files]
    return open_joined(files, options) if entry.join else open_parts(files, options)


def _messages(record: Record) -> list[str]:
    if not isinstance(record, Diagnostic):
        return []
    return [f"{s}: {t}" for s, t in zip(record.severity, record.text, strict=True) if s in ("warning", "error")]
