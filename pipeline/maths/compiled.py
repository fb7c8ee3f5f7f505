"""Compiling the loops that numpy cannot take over."""

from collections.abc import Callable
from typing import TypeVar

from numba import njit

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """The function, compiled by numba when it is first called; no fastmath, so that a result does not depend on it."""
    made: F = njit(function)
    return made
