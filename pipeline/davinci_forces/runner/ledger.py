"""The record of what each result was made from: one small JSON file per task.

A task is up to date while its fingerprint and the content of its outputs agree with its entry.

A study may come from somebody else, and files that an entry names may be removed.  So an entry is valid only in its own
place, and only if it names files of the report and records of present or former kinds.
"""

import json
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from glob import glob
from pathlib import Path, PurePosixPath
from typing import Any

from davinci_forces.files import digest, read_bytes, write_bytes
from davinci_forces.records import FORMER_FOLDERS, KINDS
from davinci_forces.report import FILES
from davinci_forces.runner.fingerprint import Fingerprint, differences, hash_of_text

MAX_NAME_BYTES = 200  # in a file's name, which may have 255 bytes with all endings
SEAL = ',\n "seal": "{}"\n}}\n'  # the end of an entry
INDEX = "index.json"  # of all entries, which earlier versions wrote
UNREADABLE = OSError, ValueError, TypeError, LookupError, AttributeError, RecursionError  # raised by foreign JSON
PARTS = "inputs", "given", "settings", "schemas", "code"  # of a fingerprint, that are tables
FOLDERS = "|".join((*(kind.folder() for kind in KINDS.values()), *FORMER_FOLDERS))
RECORD = rf"processed/(?:{FOLDERS})/(?:(?!\.\.?/)[^/\\:\0]+/)?[^/\\:\0]+\.parquet"
OUTPUT = re.compile(f"{RECORD}|reports/(?:{'|'.join(map(re.escape, FILES))})")


@dataclass(frozen=True)
class Folders:
    """The three folders of one study.  In the ledger a file is named `raw/...`, `processed/...` or `reports/...`."""

    raw: Path
    processed: Path
    reports: Path

    def file(self, name: str) -> Path:
        """The file that a name in the ledger stands for."""
        root, _, path = name.partition("/")
        return Path(getattr(self, root)) / path

    def expand(self, name: str) -> list[str]:
        """The names of the files directly in a folder, such as a ROS 2 bag; the name of a file stays unchanged."""
        folder = self.file(name)
        if not folder.is_dir():
            return [name]
        return sorted(f"{name.rstrip('/')}/{file.name}" for file in folder.iterdir() if file.is_file())


@dataclass(frozen=True)
class Entry:
    """The last run of a task."""

    stage: str  # or the step of a stage: "tune.gather"
    task: str
    fingerprint: dict[str, Any]
    outputs: dict[str, str] = field(default_factory=dict)  # file -> sha256
    failed: str = ""
    environment: str = ""  # hash of the packages and the processor


class Ledger:
    """The entries of one study; a run reads the entries, and hashes each file, once."""

    def __init__(self, folders: Folders) -> None:
        self.folders = folders
        self._digests: dict[str, str] = {}
        self.changes: list[tuple[Iterable[str], Iterable[str]]] = []  # removed and added files, one pair per entry
        self.home = folders.processed / "tasks"
        self._void: dict[str, str] = {}  # file that is not a valid entry -> reason

    def place(self, stage: str, task: str) -> Path:
        """The file of a task's entry."""
        return self.home / stage / f"{file_name(task)}.json"

    @cached_property
    def _entries(self) -> dict[str, dict[str, Entry]]:
        entries: dict[str, dict[str, Entry]] = {}
        shared: dict[str, dict[str, str]] = {}
        for place in sorted(glob("*/*.json", root_dir=self.home)):  # paths would take as long as hashing the outputs
            file = f"{self.home}{os.sep}{place}"
            try:
                entry = _read(file)
            except UNREADABLE as error:
                self._void[file] = str(error)
                continue
            # All tasks of a stage share its code, the largest part of an entry.
            code = shared.setdefault(entry.stage, entry.fingerprint["code"])
            if code == entry.fingerprint["code"]:
                entry.fingerprint["code"] = code
            entries.setdefault(entry.stage, {})[file_name(entry.task)] = entry
        return entries

    def entry(self, stage: str, task: str) -> Entry | None:
        """The entry of a task, or None if the task has not run or its entry is not valid."""
        return self._entries.get(stage, {}).get(file_name(task))

    def read(self, stage: str, task: str) -> Entry | None:
        """Read the entry of one task without the entries of other tasks; None as for `entry`."""
        with suppress(*UNREADABLE):
            return _read(str(self.place(stage, task)))
        return None

    def entries(self, stage: str | None = None) -> Iterator[Entry]:
        """All entries, or those of a stage, in order."""
        for name in sorted(self._entries) if stage is None else [stage]:
            entries = self._entries.get(name, {})
            yield from (entries[task] for task in sorted(entries))

    def write(self, entry: Entry) -> None:
        """Record the outputs of a task, with their hashes; remove its earlier outputs that no task makes now."""
        before = self.entry(entry.stage, entry.task)
        self._outputs.update([*entry.outputs])
        removed = self._remove_outputs(before.outputs if before else ())
        self._digests.update(entry.outputs)
        write_bytes(self.place(entry.stage, entry.task), seal(entry).encode())
        self._entries.setdefault(entry.stage, {})[file_name(entry.task)] = entry
        self.changes.append((removed, entry.outputs))

    def invalid_files(self) -> dict[str, str]:
        """Files in the place of entries that are not valid ones, each with the reason."""
        return self._void if self._entries is not None else {}

    def remove(self, entry: Entry) -> None:
        """Remove the entry and the outputs of a task, and the folders that this leaves empty."""
        self.changes.append((self._remove_outputs(entry.outputs), ()))
        self._entries.get(entry.stage, {}).pop(file_name(entry.task), None)
        self._unlink(f"processed/tasks/{entry.stage}/{file_name(entry.task)}.json")

    def _remove_outputs(self, names: Iterable[str]) -> list[str]:
        """Remove outputs of a task that no other task makes, because a file may move from stage to stage."""
        self._outputs.subtract([*names])
        removed = [name for name in names if self._outputs[name] <= 0]
        for name in removed:
            self._unlink(name)
        return removed

    @cached_property
    def _outputs(self) -> Counter[str]:
        """Number of entries that name each output."""
        return Counter(name for entry in self.entries() for name in entry.outputs)

    def _unlink(self, name: str) -> None:
        """Remove a file, unless a link leads to its folder, and the folders that this leaves empty."""
        self._digests.pop(name, None)
        file, (root, *parts) = self.folders.file(name), PurePosixPath(name).parts
        home: Path = getattr(self.folders, root)
        if file.parent.resolve() == home.resolve().joinpath(*parts[:-1]):
            file.unlink(missing_ok=True)
            with suppress(OSError):  # a folder that is not empty stays
                for folder in list(file.parents)[: len(parts) - 1]:
                    folder.rmdir()

    def digest(self, name: str) -> str:
        """The hash of a file, computed once a run; "" if there is no file."""
        if name not in self._digests:
            root, _, path = name.partition("/")
            file = f"{getattr(self.folders, root)}{os.sep}{path}"
            try:
                self._digests[name] = digest(file)
            except OSError:  # nearly all files exist, so this is faster than checking first
                if os.path.isfile(file):
                    raise
                self._digests[name] = ""
        return self._digests[name]

    def reasons(self, entry: Entry | None, now: Fingerprint) -> list[str]:
        """Reasons to run a task; none if it is up to date."""
        if entry is None:
            return ["first run"]
        if entry.failed:
            return ["it failed last time"]
        altered = [f"{name} was altered" for name, sha in entry.outputs.items() if self.digest(name) != sha]
        return altered + differences(entry.fingerprint, now)


def file_name(task: str) -> str:
    """The file name of a task; a name that would be too long is cut and ends in its hash."""
    name = task.replace("/", ".")
    if len(name.encode()) <= MAX_NAME_BYTES:
        return name
    return f"{name.encode()[: MAX_NAME_BYTES - 17].decode(errors='ignore')}~{hash_of_text(name)[:16]}"


def seal(entry: Entry) -> str:
    """The text of an entry, which ends in its own hash, so that a change of it is noticed."""
    text = json.dumps(vars(entry), indent=1, ensure_ascii=False, sort_keys=True)
    return text.removesuffix("\n}") + SEAL.format(hash_of_text(text))


def _read(file: str) -> Entry:
    """Read the entry in a file, if a run would write it there.

    Raises ValueError if its hash is wrong, it is of another task, or it names a file that no stage writes, which a run
    would remove.  Raises TypeError if a part of it has the wrong type, and if the file cannot be read, other errors.
    """
    text = read_bytes(file).decode()
    content = text[: -len(SEAL.format("0" * 64))] + "\n}"
    if not text.endswith(SEAL.format(hash_of_text(content))):
        raise ValueError("it is not as a stage wrote it")
    entry = Entry(**json.loads(content))
    fingerprint = entry.fingerprint if isinstance(entry.fingerprint, dict) else {}
    tables = [entry.outputs, *map(fingerprint.get, PARTS)]
    if not all(isinstance(table, dict) for table in tables):
        raise TypeError("it is not as a stage writes it")
    texts = [entry.stage, entry.task, entry.failed, entry.environment]
    for table in (entry.outputs, fingerprint["inputs"], fingerprint["code"]):
        texts += table.values()
    if {*map(type, texts)} != {str}:
        raise TypeError("it is not as a stage writes it")
    if [entry.stage, f"{file_name(entry.task)}.json"] != file.split(os.sep)[-2:]:
        raise ValueError(f"it is of another task, {entry.stage} {entry.task}")
    for output in entry.outputs:
        if not OUTPUT.fullmatch(output):
            raise ValueError(f"it names {output!r} as an output, which no stage writes")
    return entry
