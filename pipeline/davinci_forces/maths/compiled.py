"""Compiling the loops that numpy cannot take over.  No fastmath: a result must not depend on the compiler's mood."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from numba import njit

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """The function, compiled when it is first called, anew in every process."""
    made: F = njit(function)
    return made


def inlined(function: F) -> F:
    """The function as part of every compiled function that calls it."""
    made: F = njit(inline="always")(function)
    return made


def cached(*inlines: ModuleType) -> Callable[[F], F]:
    """A decorator: the function, compiled once an installation and kept on disk.

    `inlines` are the modules whose functions become part of it: compiled code that is older than one of them is
    dropped, because the compiler's own cache looks at the function's file only.
    """

    def compile_once(function: F) -> F:
        kernel: Any = njit(cache=True, error_model="numpy")(function)
        forget_older(kernel, *inlines)
        made: F = kernel
        return made

    return compile_once


def forget_older(kernel: Any, *inlines: ModuleType) -> None:
    """Drop a kernel's compiled code that is older than what it has inlined."""
    newest = max((Path(str(module.__file__)).stat().st_mtime for module in inlines), default=0.0)
    for index in Path(kernel.stats.cache_path).glob(f"*.{kernel.py_func.__name__}-*.nbi"):
        if index.stat().st_mtime < newest:
            index.unlink(missing_ok=True)
