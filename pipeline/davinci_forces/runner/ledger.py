"""What was made from what: one small JSON file per task, next to the records it made, and an index of them all.

A task is current while its fingerprint (inputs by content, settings, robot, records as declared, code, version) and the
content of its outputs are what its entry says.  Comparing an old entry with a new fingerprint gives the reason to run.

A study may come from somebody else, and an entry names files that are removed.  So an entry counts only if it is in its
own place and names nothing but records, of kinds that there are or were, and files of the report.

All entries of a ledger in one file, so that a run that finds nothing to do reads one and not thousands.

It is there while it holds what the entries do: the first entry that is written or removed takes it away, and a run that
ends puts it back.  Where an entry is newer, or any is missing, all are read one by one.  Nothing is believed for the
index's sake, since a task is current only where its files are what its entry says, and `verify` reads the entries.
"""

import json
import os
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from glob import glob
from pathlib import Path, PurePosixPath
from typing import Any

from davinci_forces.files import digest, read_bytes, write_bytes
from davinci_forces.records import FORMER_FOLDERS, KINDS
from davinci_forces.report import FILES
from davinci_forces.runner.fingerprints.fingerprint import Fingerprint, differences, hash_of_text

LONGEST = 200  # bytes of a file's name, which with all endings may have 255
SEAL = ',\n "seal": "{}"\n}}\n'  # what an entry ends with
INDEX = "index.json"
UNREADABLE = OSError, ValueError, TypeError, LookupError, AttributeError, RecursionError  # what JSON of others raises
PARTS = "inputs", "given", "settings", "schemas", "code"  # of a fingerprint, that are tables
SHARED = "code", "schemas", "settings"  # parts of a fingerprint that are the same for many tasks
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

    def inside(self, name: str) -> list[str]:
        """The files right in the folder that a name stands for, as a bag of ROS 2 is one; any other name is a file."""
        file = self.file(name)
        if not file.is_dir():
            return [name]
        return sorted(f"{name.rstrip('/')}/{each.name}" for each in file.iterdir() if each.is_file())


@dataclass(frozen=True)
class Entry:
    """One task as it was last run."""

    stage: str  # or a further step of one: "tune.gather"
    task: str
    fingerprint: dict[str, Any]
    outputs: dict[str, str] = field(default_factory=dict)  # file -> sha256
    failed: str = ""
    environment: str = ""  # hash of the packages and the processor that it ran with


class Ledger:
    """The entries of one study.  Entries, and the files whose hash is asked for, are read once a run.

    They are read from their index where that holds them all, or `one_by_one`.
    """

    def __init__(self, folders: Folders, one_by_one: bool = False) -> None:
        self.folders = folders
        self._digests: dict[str, str] = {}
        self.changes: list[tuple[Iterable[str], Iterable[str]]] = []  # files that went and came, one pair an entry
        self.home = folders.processed / "tasks"
        self._one_by_one, self._indexed = one_by_one, False
        self._void: dict[str, str] = {}  # files that are no entry, each with the reason

    def place(self, stage: str, task: str) -> Path:
        """Where the entry of a task is."""
        return self.home / stage / f"{file_name(task)}.json"

    @cached_property
    def _entries(self) -> dict[str, dict[str, Entry]]:
        indexed = {} if self._one_by_one else read_index(self.home, list(self._files()))
        with suppress(*UNREADABLE):
            entries = {s: {n: checked(Entry(**e), s, n) for n, e in named.items()} for s, named in indexed.items()}
            self._indexed = bool(entries)
            return entries or self._read_one_by_one()
        return self._read_one_by_one()

    def _read_one_by_one(self) -> dict[str, dict[str, Entry]]:
        entries: dict[str, dict[str, Entry]] = {}
        shared: dict[tuple[tuple[str, str], ...], dict[str, str]] = {}
        for stage, name, file in self._files():
            try:
                entry = _read(file)
            except UNREADABLE as error:
                self._void[file] = str(error)
                continue
            # The code of a stage is the same for all its tasks, and most of what an entry holds.
            code = entry.fingerprint["code"]
            entry.fingerprint["code"] = shared.setdefault(tuple(code.items()), code)
            entries.setdefault(stage, {})[name] = entry
        return entries

    def _files(self) -> Iterator[tuple[str, str, str]]:
        """Stage, task and file of every entry; as text, since paths would take as long as hashing what was made."""
        for name in sorted(glob("*/*.json", root_dir=self.home)):
            yield os.path.dirname(name), os.path.basename(name).removesuffix(".json"), f"{self.home}{os.sep}{name}"

    def entry(self, stage: str, task: str) -> Entry | None:
        """The entry of a task, or None when it has not run or its entry cannot be read."""
        return self._entries.get(stage, {}).get(file_name(task))

    def read(self, stage: str, task: str) -> Entry | None:
        """The same, of one file alone: what another study has made is asked of one task."""
        with suppress(*UNREADABLE):
            return _read(str(self.place(stage, task)))
        return None

    def entries(self, stage: str | None = None) -> Iterator[Entry]:
        """Every entry, or every one of a stage, in order."""
        for name in sorted(self._entries) if stage is None else [stage]:
            entries = self._entries.get(name, {})
            yield from (entries[task] for task in sorted(entries))

    def write(self, entry: Entry) -> None:
        """Record what a task made, by hashes that are taken as the entry says; what it made before, and no task does
        now, is removed.
        """
        before = self.entry(entry.stage, entry.task)
        self._outputs.update([*entry.outputs])
        gone = self._remove_outputs(before.outputs if before else ())
        self._digests.update(entry.outputs)
        self._forget_index()
        write_bytes(self.place(entry.stage, entry.task), sealed(entry).encode())
        self._entries.setdefault(entry.stage, {})[file_name(entry.task)] = entry
        self.changes.append((gone, entry.outputs))

    def void(self) -> dict[str, str]:
        """Files in the place of entries that are none, each with the reason."""
        return self._void if self._entries is not None else {}

    def remove(self, entry: Entry) -> None:
        """Forget a task, and remove its outputs, with the folders that this leaves empty."""
        self._forget_index()
        self.changes.append((self._remove_outputs(entry.outputs), ()))
        self._entries.get(entry.stage, {}).pop(file_name(entry.task), None)
        self._unlink(f"processed/tasks/{entry.stage}/{file_name(entry.task)}.json")

    def _remove_outputs(self, names: Iterable[str]) -> list[str]:
        """Remove what a task does not make any more, unless another does: a file may pass from stage to stage."""
        self._outputs.subtract([*names])
        gone = [name for name in names if self._outputs[name] <= 0]
        for name in gone:
            self._unlink(name)
        return gone

    @cached_property
    def _outputs(self) -> Counter[str]:
        """How many entries name each output."""
        return Counter(name for entry in self.entries() for name in entry.outputs)

    def _unlink(self, name: str) -> None:
        """Remove a file, unless a link leads to its folder, and the folders below the study's that are empty then."""
        self._digests.pop(name, None)
        file, (root, *parts) = self.folders.file(name), PurePosixPath(name).parts
        home: Path = getattr(self.folders, root)
        if file.parent.resolve() == home.resolve().joinpath(*parts[:-1]):
            file.unlink(missing_ok=True)
            with suppress(OSError):  # a folder that holds more stays
                for folder in list(file.parents)[: len(parts) - 1]:
                    folder.rmdir()

    def write_index(self) -> None:
        """Put the index of all entries in place, unless it is."""
        if self._entries and not self._indexed:
            write_bytes(self.home / INDEX, self.index())
            self._indexed = True

    def index(self) -> bytes:
        """The content that the index of the entries has."""
        return index_of({s: {n: vars(e) for n, e in named.items()} for s, named in self._entries.items()})

    def _forget_index(self) -> None:
        """Remove the index, which is about to say less than the entries do."""
        if self._indexed or not self.changes:
            self.home.joinpath(INDEX).unlink(missing_ok=True)
            self._indexed = False

    def digest(self, name: str) -> str:
        """The hash of a file, read once a run; "" when it is not there."""
        if name not in self._digests:
            root, _, path = name.partition("/")
            file = f"{getattr(self.folders, root)}{os.sep}{path}"
            self._digests[name] = _digest(file)
        return self._digests[name]

    def reasons(self, entry: Entry | None, now: Fingerprint) -> list[str]:
        """Why a task has to run; nothing when it is current."""
        if entry is None:
            return ["it has not run yet"]
        if entry.failed:
            return ["it failed last time"]
        altered = [f"{name} was altered" for name, sha in entry.outputs.items() if self.digest(name) != sha]
        return altered + differences(entry.fingerprint, now)


def file_name(task: str) -> str:
    """The name of a task as that of a file; one that is too long ends in its hash."""
    name = task.replace("/", ".")
    if len(name.encode()) <= LONGEST:
        return name
    return f"{name.encode()[: LONGEST - 17].decode(errors='ignore')}~{hash_of_text(name)[:16]}"


def sealed(entry: Entry) -> str:
    """An entry as it is written, with a hash of its own text at the end, so that a change of it is noticed, too."""
    text = json.dumps(vars(entry), indent=1, ensure_ascii=False, sort_keys=True)
    return text.removesuffix("\n}") + SEAL.format(hash_of_text(text))


def unsealed(text: str) -> Entry | None:
    """An entry as it was written, or None where that is not so."""
    content = text[: -len(SEAL.format("0" * 64))] + "\n}"
    return Entry(**json.loads(content)) if text.endswith(SEAL.format(hash_of_text(content))) else None


def checked(entry: Entry, stage: str, name: str) -> Entry:
    """The entry, if it is one that a run writes under this stage and name.

    Raises
    ------
    ValueError
        If it is of another task, or names a file that no stage writes, which a run would remove.
    TypeError
        If a part of it is of another type.
    """
    fingerprint = entry.fingerprint if isinstance(entry.fingerprint, dict) else {}
    tables = [entry.outputs, *map(fingerprint.get, PARTS)]
    if not all(isinstance(table, dict) for table in tables):
        raise TypeError("it is not as a stage writes it")
    hashes = (
        value for table in (entry.outputs, fingerprint["inputs"], fingerprint["code"]) for value in table.values()
    )
    if not all(isinstance(text, str) for text in (entry.stage, entry.task, entry.failed, entry.environment, *hashes)):
        raise TypeError("it is not as a stage writes it")
    if (entry.stage, file_name(entry.task)) != (stage, name):
        raise ValueError(f"it is of another task, {entry.stage} {entry.task}")
    for output in entry.outputs:
        if not OUTPUT.fullmatch(output):
            raise ValueError(f"it names {output!r} as an output, which no stage writes")
    return entry


def _read(file: str) -> Entry:
    """The entry in a file; raises as `checked` does, and where the file cannot be read or its hash is another."""
    entry = unsealed(read_bytes(file).decode())
    if entry is None:
        raise ValueError("it is not as a stage wrote it")
    return checked(entry, os.path.basename(os.path.dirname(file)), os.path.basename(file).removesuffix(".json"))


def _digest(file: str) -> str:
    try:
        return digest(file)
    except OSError:  # it is asked afterwards what is wrong, as nearly every file is there
        if os.path.isfile(file):
            raise
        return ""


Entries = dict[str, dict[str, dict[str, Any]]]  # by stage, and by the name of the entry's file


def read_index(folder: Path, files: Collection[tuple[str, str, str]]) -> Entries:
    """The entries of these stages, names and files, or none where the index is not whole, of just these and newer."""
    try:
        written = os.stat(folder / INDEX).st_mtime_ns
        if any(os.stat(file).st_mtime_ns > written for *_, file in files):
            return {}
        content = _unsealed(read_bytes(folder / INDEX).decode())
        entries: Entries = content["entries"]
        if {(stage, name) for stage, named in entries.items() for name in named} != {each[:2] for each in files}:
            return {}
        for entry in (entry for named in entries.values() for entry in named.values()):
            entry["fingerprint"] |= {part: content["shared"][i] for part, i in entry.pop("shared").items()}
    except UNREADABLE:
        return {}
    return entries


def index_of(entries: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> bytes:
    """The content of the index of entries, which are as `read_index` gives them."""
    numbers: dict[str, int] = {}  # of what is shared, by its text
    brief: Entries = {}
    for stage, named in sorted(entries.items()):
        for name, entry in sorted(named.items()):
            own = {part: value for part, value in entry["fingerprint"].items() if part not in SHARED}
            texts = {part: _text(entry["fingerprint"][part]) for part in SHARED if part in entry["fingerprint"]}
            shared = {part: numbers.setdefault(text, len(numbers)) for part, text in texts.items()}
            brief.setdefault(stage, {})[name] = {**entry, "fingerprint": own, "shared": shared}
    text = _text({"entries": brief, "shared": list(map(json.loads, numbers))})
    return f"{hash_of_text(text)}\n{text}".encode()


def _unsealed(text: str) -> Any:
    """What an index holds below the hash of it in its first line."""
    sha, _, content = text.partition("\n")
    if sha != hash_of_text(content):
        raise ValueError("not as it was written")
    return json.loads(content)


def _text(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
