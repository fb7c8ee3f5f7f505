"""Hashes of the code that a result depends on: modules and all modules of the pipeline that they import."""

import hashlib
import re
from collections.abc import Iterable, Iterator
from functools import cache
from os import sep
from pathlib import Path

from davinci_forces.files import digest

PACKAGE = Path(__file__).parents[2]
IMPORT = re.compile(r"^[ \t]*from (davinci_forces[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
COMMENT = re.compile(r"#.*")
_hash_of = cache(digest)  # of a module, which many tasks depend on


@cache
def package_fingerprint() -> str:
    """The fingerprint of the package's code, 12 digits: the same from a wheel and from a checkout."""
    files = (file for file in PACKAGE.rglob("*") if file.is_file() and file.suffix != ".pyc")
    listed = sorted(f"{digest(file)}  {file.relative_to(PACKAGE).as_posix()}\n" for file in files)
    return hashlib.sha256("".join(listed).encode()).hexdigest()[:12]


@cache
def code(*modules: str, without: str = "") -> dict[str, str]:
    """The hashes of modules and of everything of the pipeline that they import, directly or not.

    Modules in the package `without` are left out, unless they are named.
    """
    files: dict[Path, None] = {}
    for module in modules:
        _collect(_files(module), files)
    named = {file for module in modules for file in _files(module)}
    left_out = PACKAGE.joinpath(*without.split(".")[1:]) if without else None
    hashed = (file for file in sorted(files, key=str) if file in named or not str(file).startswith(f"{left_out}{sep}"))
    return {file.relative_to(PACKAGE).as_posix(): _hash_of(file) for file in hashed}


def _collect(sources: Iterable[Path], files: dict[Path, None]) -> None:
    for file in sources:
        if file not in files:
            files[file] = None
            _collect(_imports(file), files)


@cache
def _imports(file: Path) -> tuple[Path, ...]:
    if file.suffix != ".py":
        return ()
    imports = find_imports(file.read_text(encoding="utf-8"))
    return tuple(file for module, names in imports for n in names for file in _files(f"{module}.{n}") or _files(module))


def find_imports(source: str) -> Iterator[tuple[str, list[str]]]:
    """Find what a source imports from the pipeline: each module, and the names from it.

    A regular expression finds the statements, since parsing all of a stage's modules would take longer than many runs.
    """
    for module, text in IMPORT.findall(source):
        names = COMMENT.sub("", text).strip("() \n").split(",")
        yield module, [name.split()[0] for name in names if name.strip()]


@cache
def _files(module: str) -> list[Path]:
    """The file of a module; for a package its `__init__`, or all its files if that imports modules by name."""
    place = PACKAGE.joinpath(*module.split(".")[1:])
    if place.with_suffix(".py").is_file():
        return [place.with_suffix(".py")]
    if place == PACKAGE or not place.is_dir():
        return []
    init = place / "__init__.py"
    if init.is_file() and "import_module" not in init.read_text(encoding="utf-8"):
        return [init]
    return sorted(f for f in place.rglob("*") if f.is_file() and "__pycache__" not in f.parts)
