"""What was made from what: one small JSON file per task, next to the records it made.

A task is current while its fingerprint (inputs by content, settings, robot, code, version) and the content of
its outputs are what its entry says.  Comparing an old entry with a new fingerprint gives the reason to run.
"""

import ast
import json
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from datetime import date, time
from enum import Enum
from functools import cache
from hashlib import sha256
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from pipeline.records import store

PACKAGE = Path(__file__).parents[1]


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


@dataclass(frozen=True)
class Fingerprint:
    """Everything that the outputs of a task depend on."""

    inputs: dict[str, str]  # file -> sha256
    given: dict[str, str]  # what the stage was given besides records -> sha256
    settings: dict[str, Any]
    code: dict[str, str]  # module -> sha256
    version: str


@dataclass(frozen=True)
class Entry:
    """One task as it was last run."""

    stage: str
    task: str
    fingerprint: dict[str, Any]
    outputs: dict[str, str] = field(default_factory=dict)  # file -> sha256
    failed: str = ""


class Ledger:
    """The entries of one study."""

    def __init__(self, folders: Folders) -> None:
        self.folders = folders
        self._digests: dict[Path, str] = {}

    def place(self, stage: str, task: str) -> Path:
        """Where the entry of a task is."""
        return self.folders.processed / "tasks" / stage / f"{task.replace('/', '.')}.json"

    def entry(self, stage: str, task: str) -> Entry | None:
        """The entry of a task, or None when it has not run or its entry cannot be read."""
        try:
            text = self.place(stage, task).read_text(encoding="utf-8")
            entry = Entry(**{key: value for key, value in json.loads(text).items() if key != "seal"})
        except (OSError, ValueError, TypeError, AttributeError):
            return None
        return entry if sealed(entry) == text else None

    def entries(self, stage: str | None = None) -> Iterator[Entry]:
        """Every entry, or every one of a stage, in order."""
        for file in sorted((self.folders.processed / "tasks" / (stage or "")).rglob("*.json")):
            entry = self.entry(file.parent.name, file.stem)
            if entry:
                yield entry

    def write(self, entry: Entry) -> None:
        """Record what a task made."""
        store.write_bytes(self.place(entry.stage, entry.task), sealed(entry).encode())

    def broken(self) -> Iterator[Path]:
        """Entries that are not as they were written; other files there are no concern of ours."""
        for file in sorted((self.folders.processed / "tasks").rglob("*.json")):
            if file.is_file() and self.entry(file.parent.name, file.stem) is None:
                yield file

    def remove(self, entry: Entry) -> None:
        """Forget a task, and remove what it made, with the folders that this leaves empty."""
        for file in (*map(self.folders.file, entry.outputs), self.place(entry.stage, entry.task)):
            file.unlink(missing_ok=True)
            with suppress(OSError):  # a folder that holds more stays
                file.parent.rmdir()
                file.parent.parent.rmdir()

    def digest(self, name: str, fresh: bool = False) -> str:
        """The hash of a file, read once a run; "" when it is not there."""
        file = self.folders.file(name)
        if fresh or file not in self._digests:
            self._digests[file] = store.digest(file) if file.is_file() else ""
        return self._digests[file]

    def reasons(self, entry: Entry | None, now: Fingerprint) -> list[str]:
        """Why a task has to run; nothing when it is current."""
        if entry is None:
            return ["it has not run yet"]
        if entry.failed:
            return ["it failed last time"]
        changed = [f"{name} was altered" for name, sha in entry.outputs.items() if self.digest(name) != sha]
        then = entry.fingerprint
        if then.get("version") != now.version:
            changed.append(f"version {then.get('version')} became {now.version}")
        old = then.get("settings", {})
        changed += [f"{k} = {old.get(k)!r} became {v!r}" for k, v in now.settings.items() if old.get(k) != v]
        for what, reason in (("given", "the {} changed"), ("code", "the code of {} changed"), ("inputs", "{} changed")):
            old, new = then.get(what, {}), getattr(now, what)
            changed += [
                reason.format(name) for name in sorted(old.keys() | new.keys()) if old.get(name) != new.get(name)
            ]
        return changed


def sealed(entry: Entry) -> str:
    """An entry as it is written, with a hash of its own content, so that a change of it is noticed, too."""
    content = asdict(entry)
    seal = hash_of_text(json.dumps(content, ensure_ascii=False, sort_keys=True))
    return json.dumps({**content, "seal": seal}, indent=1, ensure_ascii=False, sort_keys=True) + "\n"


@cache
def code(*modules: str) -> dict[str, str]:
    """The hash of modules and of everything of the pipeline that they import, directly or not."""
    files: dict[Path, None] = {}
    for module in modules:
        _collect(_files(module), files)
    return {file.relative_to(PACKAGE.parent).as_posix(): _hash_of(file) for file in sorted(files)}


def _collect(sources: Iterable[Path], files: dict[Path, None]) -> None:
    for file in sources:
        if file not in files:
            files[file] = None
            if file.suffix == ".py":
                for module in _imports(file):
                    _collect(_files(module), files)


@cache
def _imports(file: Path) -> tuple[str, ...]:
    modules = []
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("pipeline"):
            for alias in node.names:
                deeper = f"{node.module}.{alias.name}"
                modules.append(deeper if _files(deeper) else node.module)
    return tuple(modules)


def _files(module: str) -> list[Path]:
    """The file of a module; of a package its `__init__`, or all files where that imports its modules by name."""
    place = PACKAGE.joinpath(*module.split(".")[1:])
    if place.with_suffix(".py").is_file():
        return [place.with_suffix(".py")]
    if place == PACKAGE or not place.is_dir():
        return []
    init = place / "__init__.py"
    if init.is_file() and "import_module" not in init.read_text(encoding="utf-8"):
        return [init]
    return sorted(f for f in place.rglob("*") if f.is_file() and "__pycache__" not in f.parts)


@cache
def _hash_of(file: Path) -> str:
    return store.digest(file)


def hash_of_text(text: str) -> str:
    """The sha256 of a text."""
    return sha256(text.encode()).hexdigest()


def hash_of(value: Any) -> str:
    """The sha256 of a value by all that it holds: arrays by their bytes, of which `repr` shows a few digits."""
    return hash_of_text(canonical(value))


def canonical(value: Any) -> str:
    """A text that two values share only if they hold the same.

    Raises
    ------
    TypeError
        If the value holds something of which that cannot be said.
    """
    if is_dataclass(value) and not isinstance(value, type):
        items = (f"{f.name}={canonical(getattr(value, f.name))}" for f in fields(value))
        return f"{type(value).__name__}({', '.join(items)})"
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return f"array({value.dtype.str}, {value.shape}, {sha256(value.tobytes()).hexdigest()})"
    if isinstance(value, dict):
        return f"{{{', '.join(sorted(f'{canonical(k)}: {canonical(v)}' for k, v in value.items()))}}}"
    if isinstance(value, list | tuple):
        return f"{type(value).__name__}({', '.join(map(canonical, value))})"
    if isinstance(value, Enum):
        return f"{type(value).__name__}.{value.name}"
    if isinstance(value, PurePath):
        return f"path({value.as_posix()!r})"
    if isinstance(value, np.generic):
        return canonical(value.item())
    if value is None or isinstance(value, bool | int | float | str | date | time):
        return repr(value)
    raise TypeError(f"a {type(value).__name__} has no canonical text")
