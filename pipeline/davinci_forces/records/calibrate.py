"""Records of the error of an external effort in free motion that no fit has seen."""

from dataclasses import dataclass

from davinci_forces.records.record import Column, Counts, Record


@dataclass(frozen=True, eq=False)
class FreeMotion(Record):
    """What a filter makes of one joint of a log in which nothing touches the robot, by a fit that has not seen it.

    A row is a block of the log, a sixth of it, at one range of speeds.
    """

    log: str
    joint: str
    path: str
    scheme: str
    tested: int
    free_mean: float
    block: Counts
    speed_bin: Counts
    count: Counts
    mean_square: Column
    filter_square: Column
