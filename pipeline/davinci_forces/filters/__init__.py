"""Filters that track the external effort: one module each, exporting `blocks` and `NAME`."""

from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from davinci_forces.filters.problem import Block, Filter, NoiseModel, Recording, Tracked, join_blocks
from davinci_forces.maths.arrays import BLOCK_SAMPLES, Array

FILTERS = ("ekf", "ekf_euler", "ekf_adaptive", "rts", "rate", "momentum", "direct")
DEFAULT = "ekf"  # the other filters are compared with this one
MAX_NIS_RATIO = 50.0  # of the mean normalised innovation squared to 2, the mean of a consistent filter


@cache
def _filter(name: str) -> Any:
    return import_module(f"davinci_forces.filters.{name}")


@cache
def tracker(name: str) -> Filter:
    """Return the filter of that name, as a function of one recording and its noise."""
    return lambda recording, noise: filter_parts(name, [recording], noise)


def title(name: str) -> str:
    """Return the title of a filter in reports."""
    return str(_filter(name).NAME)


def filter_parts(
    name: str, parts: Sequence[Recording], noise: NoiseModel, names: Sequence[str] = Tracked._fields
) -> Tracked:
    """Run a filter over the parts of a recording between gaps; columns that are not named are empty."""
    return join_blocks(filter_blocks(name, parts, noise), sum(part.samples for part in parts), names)


def filter_blocks(name: str, parts: Sequence[Recording], noise: NoiseModel) -> Iterator[Block]:
    """Yield the blocks of a filter's pass over the parts of a recording; the filter restarts at each part."""
    start = 0
    for part in parts:
        for rows, tracked in _filter(name).blocks(part, noise):
            yield slice(start + rows.start, start + rows.stop), tracked
        start += part.samples


def gather_blocks(blocks: Iterable[Block]) -> Iterator[Block]:
    """Join consecutive blocks to blocks of at least `BLOCK_SAMPLES` samples, but for the last."""
    pending: list[Block] = []
    for block in blocks:
        pending.append(block)
        if block[0].stop - pending[0][0].start >= BLOCK_SAMPLES:
            yield _concatenated(pending)
            pending = []
    if pending:
        yield _concatenated(pending)


def _concatenated(blocks: Sequence[Block]) -> Block:
    columns = zip(*(tracked for _, tracked in blocks), strict=True)
    return slice(blocks[0][0].start, blocks[-1][0].stop), Tracked(*(np.concatenate(column) for column in columns))


def diverges(tau_ext: Array, nis: float) -> bool:
    """Whether the innovations are so much larger than the filter assumes that its result is not usable.

    `tau_ext` (N,) is the filter's external effort, and `nis` the mean of its normalised innovations squared.
    """
    return not np.isfinite(tau_ext).all() or nis > 2.0 * MAX_NIS_RATIO
