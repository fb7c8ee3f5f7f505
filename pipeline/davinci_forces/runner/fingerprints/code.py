"""Hashes of the code that a result depends on: modules and all modules of the pipeline that they import."""

import os
import re
from collections.abc import Iterable, Iterator
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from davinci_forces.files import read_bytes

PACKAGE = Path(__file__).parents[2]
IMPORT = re.compile(r"^[ \t]*from (davinci_forces[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
COMMENT = re.compile(r"#.*")


class File(NamedTuple):
    """A file of the package."""

    sha256: str
    imports: list[tuple[str, list[str]]]  # modules of the pipeline, and the names from them
    by_name: bool  # whether it imports others by name


@cache
def package_fingerprint() -> str:
    """The fingerprint of the package's code, 12 digits: the same from a wheel and from a checkout."""
    listed = sorted(f"{file.sha256}  {name}\n" for name, file in _package().items())
    return sha256("".join(listed).encode()).hexdigest()[:12]


@cache
def code(*modules: str, without: str = "") -> dict[str, str]:
    """The hashes of modules and of everything of the pipeline that they import, directly or not.

    Modules in the package `without` are left out, unless they are named.
    """
    files: dict[str, None] = {}
    named = [name for module in modules for name in _files(module)]
    _collect(named, files)
    left_out = (f"{_place(without)}/",) if without else ()
    return {name: _package()[name].sha256 for name in sorted(files) if name in named or not name.startswith(left_out)}


def _collect(names: Iterable[str], files: dict[str, None]) -> None:
    for name in names:
        if name not in files:
            files[name] = None
            _collect(_imports(name), files)


@cache
def _imports(file: str) -> tuple[str, ...]:
    imports = ((module, name) for module, names in _package()[file].imports for name in names)
    return tuple(file for module, name in imports for file in _files(f"{module}.{name}") or _files(module))


def find_imports(source: str) -> Iterator[tuple[str, list[str]]]:
    """Find what a source imports from the pipeline: each module, and the names from it.

    A regular expression finds the statements, since parsing all of a stage's modules would take longer than many runs.
    """
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
    return [name for name in package if name.startswith(f"{place}/")] if package[init].by_name else [init]


def _place(module: str) -> str:
    """The path of a module below the package, without ending."""
    return module.partition(".")[2].replace(".", "/")


@cache
def _package() -> dict[str, File]:
    """All files of the package, each read once, by their paths below it."""
    files = {}
    for folder, _, names in os.walk(PACKAGE):  # takes a third of the time of rglob
        place = folder.removeprefix(str(PACKAGE)).replace(os.sep, "/").lstrip("/")
        for name in names if not place.endswith("__pycache__") else ():
            content = read_bytes(f"{folder}{os.sep}{name}")
            source = content.decode() if name.endswith(".py") else ""
            file = File(sha256(content).hexdigest(), [*find_imports(source)], "import_module" in source)
            files[f"{place}/{name}".lstrip("/")] = file
    return dict(sorted(files.items()))
