"""What a log says of contact beyond its joints."""

from typing import Protocol

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.logs.log import Block, Channel, Log
from davinci_forces.maths.arrays import Booleans
from davinci_forces.records import Column, Counts, Touch
from davinci_forces.study import LogEntry, Source

# Channels of the log by the columns of a Touch; those of joints become recordings.
TOUCHED = {
    "depth": "depth", "force": "force", "force_x": "force_x", "force_y": "force_y", "force_z": "force_z",
    "x": "tip_x", "y": "tip_y", "z": "tip_z",
}  # fmt: skip


class Quantities(Protocol):
    """A reading of a log, as far as it is asked here."""

    log: Log
    entry: LogEntry
    rows: int
    sources: dict[str, Source]
    channels: dict[str, Channel]

    @property
    def clocked(self) -> bool:
        """Whether it is known when the samples were taken."""

    def converted(self, block: Block, quantity: str) -> Column:
        """A channel in SI."""


def touched(reading: Quantities, block: Block, t: Column, kept: Booleans) -> Touch | None:
    """What the channels of the log say of contact; NaN in columns that it has no channel of."""
    if not set(reading.sources) & {*TOUCHED.values(), "push"}:
        return None
    unknown = np.full(len(t), np.nan)
    columns = {
        name: reading.converted(block, quantity) if quantity in reading.sources else unknown
        for name, quantity in TOUCHED.items()
    }
    return Touch(
        log=reading.entry.name,
        role=reading.entry.role,
        sample=(reading.rows + np.arange(len(t)))[kept],
        push=_pushes(reading, block, len(t))[kept],
        t=(t if reading.clocked else unknown)[kept],
        **{name: column[kept] for name, column in columns.items()},
    )


def _pushes(reading: Quantities, block: Block, rows: int) -> Counts:
    """The numbers of the pushes, 0 throughout where the log does not count them."""
    if "push" not in reading.sources:
        return np.zeros(rows, dtype=np.int64)
    numbers = reading.converted(block, "push")
    odd = np.flatnonzero((numbers != np.round(numbers)) | (np.abs(numbers) >= 2**53))
    if len(odd):
        raise BadLog(
            f"{reading.log.path}: channel {reading.channels['push'].name!r} holds {numbers[odd[0]]:g} at row "
            f"{reading.rows + int(odd[0])} (counted from 0), but the number of a push is a whole one; name another "
            "channel, or leave push out, and pushes are found"
        )
    return numbers.astype(np.int64)
