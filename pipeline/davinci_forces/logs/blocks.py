"""Blocks of samples on their way to whoever asked for them: gathered to a useful size, and made ahead of their use."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from davinci_forces.logs.log import Block

ROWS = 1 << 16  # of a block, or fewer
CELLS = 1 << 20  # of a block of many channels


def ahead(blocks: Iterator[Block]) -> Iterator[Block]:
    """The same samples in blocks of at least `ROWS` rows or `CELLS` cells, but for the last.

    Each is made while the one before is used: parsing and compressing both leave the interpreter free, so that reading
    and storing a log share two processors.  A log of one block needs no second one, which takes longer to start.
    """
    made = _gathered(blocks)
    block = next(made, None)
    if block and not _is_full(_rows(block), len(block)):
        yield block
    elif block:
        with ThreadPoolExecutor(max_workers=1) as reader:
            while block:
                following = reader.submit(next, made, None)
                yield block
                block = following.result()


def _gathered(blocks: Iterator[Block]) -> Iterator[Block]:
    waiting: list[Block] = []
    rows = 0
    for block in blocks:
        waiting.append(block)
        rows += _rows(block)
        if _is_full(rows, len(block)):
            yield _joined(waiting)
            waiting, rows = [], 0
    if rows:
        yield _joined(waiting)


def _rows(block: Block) -> int:
    return len(next(iter(block.values()), ()))


def _is_full(rows: int, channels: int) -> bool:
    return rows >= ROWS or rows * channels >= CELLS


def _joined(blocks: Sequence[Block]) -> Block:
    if len(blocks) == 1:
        return blocks[0]
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
