"""Records of what was measured: how logs were read, and the motion and effort of their joints."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Column, Counts, Labels, Names, Published, Record


@dataclass(frozen=True, eq=False)
class LogSummary(Record):
    """How one log was read: what the reader noticed, and what each of its channels is used for."""

    KEY = ("log",)

    log: str
    role: str
    format: str
    files: Names
    started: str
    zone: str
    rows: int
    rate: float
    duration: float
    jitter: float
    longest_gap: float
    backward: int
    repeated: int
    duplicates: int
    dropped: int
    facts: Names
    warnings: Names
    channel: Labels
    unit: Labels
    feeds: Labels
    nulls: Counts
    nans: Counts

    def published(self) -> Iterator[Published]:
        """What the reader noticed of the clock and the rows."""
        names = ("rows", "rate", "duration", "jitter", "longest_gap", "duplicates", "dropped")
        yield from self.publish(f"log.{self.log}", *names)


@dataclass(frozen=True, eq=False)
class Touch(Record):
    """What the channels of one log beyond its joints say of contact, as recorded; NaN without such a channel."""

    KEY = ("log",)
    UNKNOWN = ("t", "depth", "force", "force_x", "force_y", "force_z", "x", "y", "z")

    log: str
    role: str
    sample: Counts
    push: Counts
    t: Column  # NaN of a log without a clock
    depth: Column
    force: Column
    force_x: Column
    force_y: Column
    force_z: Column
    x: Column
    y: Column
    z: Column


@dataclass(frozen=True, eq=False)
class Recording(Record):
    """One joint during one log, as recorded: at the log's own clock, in joint units."""

    log: str
    joint: str
    role: str
    rate: float
    velocity: str  # "logged", or "derived": dq is then zero here and filled in when the clock is made uniform
    t: Column
    q: Column
    dq: Column
    tau: Column
