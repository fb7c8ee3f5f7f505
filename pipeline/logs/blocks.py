"""Blocks of samples on their way to whoever asked for them: gathered to a useful size, and made ahead of their use."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from pipeline.logs.log import Block

ROWS = 1 << 16  # of a block, or fewer
CELLS = 1 << 20  # of a block of many channels


def ahead(blocks: Iterator[Block]) -> Iterator[Block]:
    """The same samples in blocks of at least `ROWS` rows or `CELLS` cells, but for the last.

    Each is made while the one before is used: parsing and compressing both leave the interpreter free, so that reading
    and storing a log share two processors.
    """
    made = _gathered(blocks)
    with ThreadPoolExecutor(max_workers=1) as reader:
        following = reader.submit(next, made, None)
        while (block := following.result()) is not None:
            following = reader.submit(next, made, None)
            yield block


def _gathered(blocks: Iterator[Block]) -> Iterator[Block]:
    waiting: list[Block] = []
    rows = 0
    for block in blocks:
        waiting.append(block)
        rows += len(next(iter(block.values()), ()))
        if rows >= ROWS or rows * len(block) >= CELLS:
            yield _joined(waiting)
            waiting, rows = [], 0
    if rows:
        yield _joined(waiting)


def _joined(blocks: Sequence[Block]) -> Block:
    if len(blocks) == 1:
        return blocks[0]
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
