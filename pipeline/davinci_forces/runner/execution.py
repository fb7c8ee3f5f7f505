"""Run one task, in this process or another: read its records, call its function, write its outputs."""

import errno
import os
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from davinci_forces.errors import BadLog, PipelineError
from davinci_forces.files import digest
from davinci_forces.logs.log import Log
from davinci_forces.maths.arrays import BLOCK_SAMPLES
from davinci_forces.records import KINDS, Diagnostic, Record, diagnostic
from davinci_forces.robots.robot import Kind
from davinci_forces.runner.ledger import Folders, file_name
from davinci_forces.runner.plan import Located, Task, is_about_log
from davinci_forces.runner.signature import declaration, function_of, stage_of
from davinci_forces.study import LogEntry

if TYPE_CHECKING:
    from davinci_forces.records import store


LONG = 0.25  # [s] after which a task may have held much memory; returning it takes milliseconds


@dataclass(frozen=True)
class Outcome:
    """The outputs of a task or the reason why it failed, and its messages for the console."""

    task: Task
    outputs: dict[str, str]  # file -> sha256
    failed: str = ""
    messages: tuple[str, ...] = ()
    seconds: float = 0.0


def perform(folders: Folders, task: Task, mark: Path | None = None) -> Outcome:
    """Run one task.  An error becomes its outcome, so that the other tasks go on.

    Raises any error if its diagnostic cannot be written, or the file `mark` is gone.  Then the run has ended, and the
    next one may have removed what this task was writing.
    """
    from davinci_forces.records import store  # here, so that a run in which all is up to date does not load pyarrow

    messages: list[str] = []
    start = perf_counter()
    try:
        with record_writer(folders, task) as writer:
            for record in function_of(task.step)(**arguments(folders, task)):
                writer.write(record)
                if isinstance(record, Diagnostic):
                    messages += [f"{s}: {t}" for s, t in zip(record.severity, record.text, strict=True) if s != "note"]
                del record  # frees its memory before the stage makes the next
        return Outcome(task, _made(writer), messages=tuple(messages), seconds=perf_counter() - start)
    except Exception as error:
        if mark and not mark.exists():
            raise
        message = error_message(error)
        failed = without_folders(message, folders)
        with record_writer(folders, task) as writer:
            writer.write(diagnostic(stage_of(task.step), file_name(task.subject), "error", failed))
        return Outcome(task, _made(writer), failed, (f"error: {message}",), perf_counter() - start)
    finally:
        if perf_counter() - start > LONG:
            store.release()


def error_message(error: Exception) -> str:
    """The message of an error; an unexpected one is named as a bug, with its place in the code."""
    if isinstance(error, OSError) and error.errno == errno.ENAMETOOLONG:
        return f"{error}; files are named after their log: give the log a shorter name in study.toml"
    if isinstance(error, PipelineError | OSError):
        return str(error)
    frame = traceback.extract_tb(error.__traceback__)[-1]
    bug = f"{type(error).__name__}: {error} ({Path(frame.filename).name}:{frame.lineno} in {frame.name})"
    if isinstance(error, np.linalg.LinAlgError):
        why = "its equations have no solution, as of a channel of constants or noise, or in another unit"
        return f"{bug}: {why}; look at the remarks on the logs, check their channels, and report it if they are right"
    return f"{bug}: a bug of davinci-forces, not an error in the data; please report it"


def without_folders(message: str, folders: Folders) -> str:
    """The message without the folders of this machine, so that a recorded message is the same on every machine."""
    for folder in (folders.processed, folders.reports, folders.raw):
        message = message.replace(f"{folder}{os.sep}", "")
    return message


def arguments(folders: Folders, task: Task) -> dict[str, Any]:
    """The keyword arguments of a task's function."""
    asks = declaration(task.step)
    values: dict[str, Any] = dict(task.fingerprint.settings)
    for parameter, located in task.records.items():
        records = InTurn(folders, task, located)
        if parameter in asks.each or parameter in asks.optional:
            values[parameter] = next(iter(records), None)
        else:
            values[parameter] = records if parameter in asks.in_turn else list(records)
    of_study = {p: _log(folders, value) if asks.given[p] == "log" else value for p, value in task.given.items()}
    return values | of_study


@dataclass(frozen=True)
class InTurn:
    """Records that are read one by one and not kept, since all records of a long log would take much memory."""

    folders: Folders
    task: Task
    located: tuple[Located, ...]

    def __iter__(self) -> Iterator[Record]:
        return (_record(self.folders, self.task, place) for place in self.located)

    def __len__(self) -> int:
        return len(self.located)


def _record(folders: Folders, task: Task, located: Located) -> Record:
    kind, place = located
    sha256 = task.fingerprint.inputs[f"processed/{place}"]
    # The records of a joint are small, and the tasks of all the joint's logs read them.
    read = _read if is_about_log(KINDS[kind]) else _read_cached
    return read(kind, folders.processed, place, sha256)


def _read(kind: str, folder: Path, place: str, sha256: str) -> Record:
    from davinci_forces.records import store

    return store.read(KINDS[kind], folder, Path(place), sha256, BLOCK_SAMPLES)


_read_cached = lru_cache(maxsize=256)(_read)


def record_writer(folders: Folders, task: Task) -> "store.Writer":
    """The writer of a task's records, with the units of their joints."""
    from davinci_forces.records import store

    def unit(record: Record) -> "store.Unit":
        name = getattr(record, "joint", getattr(record, "group", ""))
        kind, measured, is_geared = task.joints.get(name, (Kind.REVOLUTE, "", True))
        return lambda template: kind.unit(template, measured, is_geared)

    return store.Writer(folders.processed, unit, vars(task.fingerprint))


def _made(writer: "store.Writer") -> dict[str, str]:
    return {f"processed/{place.as_posix()}": digest(writer.folder / place) for place in writer.places}


def _log(folders: Folders, entry: LogEntry) -> Log:
    from davinci_forces.logs.joined import open_joined
    from davinci_forces.logs.parts import open_parts

    if missing := [file for file in entry.files if not (folders.raw / file).exists()]:
        names = ", ".join(map(repr, missing))
        raise BadLog(f"file {names} of log {entry.name!r} is not in raw/{folders.raw.resolve().name}")
    files = [folders.raw / file for file in entry.files]
    return open_joined(files, entry.options) if entry.join else open_parts(files, entry.options)
