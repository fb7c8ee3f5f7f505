"""The fingerprint of a task: hashes of values, records and code that its outputs depend on, and what changed."""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from datetime import date, time
from enum import Enum
from functools import cache
from hashlib import sha256
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from davinci_forces.files import read_bytes
from davinci_forces.records.quantities import QUANTITIES
from davinci_forces.records.record import COLUMN_DTYPES, Record
from davinci_forces.runner.signature import declaration

PACKAGE = Path(__file__).parents[1]
IMPORT = re.compile(r"^[ \t]*from (davinci_forces[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
COMMENT = re.compile(r"#.*")
PLAIN = (str, float, int, bool, type(None))
CHANGED = {"given": "the ", "schemas": "the declaration of ", "code": "the code of ", "inputs": ""}  # why to run


def hash_of_text(text: str) -> str:
    """The sha256 of a text."""
    return sha256(text.encode()).hexdigest()


def hash_of(value: Any) -> str:
    """The sha256 of a value's content; arrays are hashed by their bytes, since `repr` rounds."""
    return hash_of_text(canonical(value))


def canonical(value: Any) -> str:
    """A text that is equal for two values only if their contents are; raises TypeError for a type without one."""
    if type(value) in PLAIN:  # the most frequent case
        return repr(value)
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
    if isinstance(value, int | float | str | date | time):
        return repr(value)
    raise TypeError(f"a {type(value).__name__} has no canonical text")


@dataclass(frozen=True)
class Fingerprint:
    """Everything that the outputs of a task depend on."""

    inputs: dict[str, str]  # file -> sha256
    given: dict[str, str]  # argument of the stage other than records -> sha256
    settings: dict[str, Any]
    schemas: dict[str, str]  # kind of record read or made -> sha256 of its declaration
    code: dict[str, str]  # module -> sha256
    version: str


def differences(then: dict[str, Any], now: Fingerprint) -> list[str]:
    """Descriptions of the changes from the fingerprint of an entry to the present one."""
    if then == vars(now):
        return []
    changed = []
    if then.get("version") != now.version:
        changed.append(f"version {then.get('version')} became {now.version}")
    old = then.get("settings", {})
    changed += [f"{k} = {old.get(k)!r} became {v!r}" for k, v in now.settings.items() if old.get(k) != v]
    for what, words in CHANGED.items():
        old, new = then.get(what, {}), getattr(now, what)
        changed += [f"{words}{name} changed" for name in sorted(old | new) if old.get(name) != new.get(name)]
    return changed


@cache
def schemas(step: str) -> dict[str, str]:
    """The hash of the declaration of each kind of record that a step reads or makes."""
    asks = declaration(step)
    hashes = {kind.__name__: _hash(kind, is_made=False) for kind in asks.reads}
    return hashes | {kind.__name__: _hash(kind, is_made=True) for kind in asks.makes}


def _hash(kind: type[Record], is_made: bool) -> str:
    """The hash of names, types and units, and for a step that makes it of the meanings of columns, as in the file."""
    described = []
    for f in fields(kind):  # type: ignore[arg-type]
        is_column, (meaning, unit) = f.type in COLUMN_DTYPES, QUANTITIES[f.name]
        stored = str(np.dtype(COLUMN_DTYPES[f.type])) if is_column else str(f.type)
        described.append((f.name, stored, unit, *([meaning] if is_made and is_column else [])))
    return hash_of((kind.__name__, kind.KEY, kind.UNKNOWN, described))


@cache
def package_fingerprint() -> str:
    """The fingerprint of the package's code, 12 digits: the same from a wheel and from a checkout."""
    listed = sorted(f"{sha}  {name}\n" for name, (sha, _) in _package().items())
    return sha256("".join(listed).encode()).hexdigest()[:12]


@cache
def code(*modules: str, without: str = "") -> dict[str, str]:
    """The hashes of modules and of all that they import, directly or not, except others in the package `without`."""
    named = {name for module in modules for name in _files(module)}
    files, waiting = set(named), list(named)
    while waiting:
        imported = set(_imports(waiting.pop())) - files
        files |= imported
        waiting += imported
    left_out = (f"{_place(without)}/",) if without else ()
    return {name: _package()[name][0] for name in sorted(files) if name in named or not name.startswith(left_out)}


@cache
def _imports(file: str) -> tuple[str, ...]:
    imports = ((module, name) for module, names in find_imports(_package()[file][1]) for name in names)
    return tuple(file for module, name in imports for file in _files(f"{module}.{name}") or _files(module))


def find_imports(source: str) -> Iterator[tuple[str, list[str]]]:
    """Find the modules, and the names from each, that a source imports: by a regular expression, as parsing is slow."""
    for module, text in IMPORT.findall(source):
        names = COMMENT.sub("", text).strip("() \n").split(",")
        yield module, [name.split()[0] for name in names if name.strip()]


@cache
def _files(module: str) -> list[str]:
    """The file of a module; for a package its `__init__`, or all its files if that imports modules by name."""
    place, package = _place(module), _package()
    if f"{place}.py" in package:
        return [f"{place}.py"]
    init = f"{place}/__init__.py"
    if init not in package:
        return []
    by_name = "import_module" in package[init][1]
    return [name for name in package if name.startswith(f"{place}/")] if by_name else [init]


def _place(module: str) -> str:
    """The path of a module below the package, without ending."""
    return module.partition(".")[2].replace(".", "/")


@cache
def _package() -> dict[str, tuple[str, str]]:
    """The hash of each file of the package, and the source of a module, by the path below the package."""
    files = {}
    for folder, _, names in os.walk(PACKAGE):  # takes a third of the time of rglob
        place = folder.removeprefix(str(PACKAGE)).replace(os.sep, "/").lstrip("/")
        for name in names if not place.endswith("__pycache__") else ():
            content = read_bytes(f"{folder}{os.sep}{name}")
            source = content.decode() if name.endswith(".py") else ""
            files[f"{place}/{name}".lstrip("/")] = sha256(content).hexdigest(), source
    return dict(sorted(files.items()))
