"""Records of what a hung mass asks of the joints."""

from dataclasses import dataclass

from davinci_forces.records.record import Column, Record


@dataclass(frozen=True, eq=False)
class Load(Record):
    """What a kilogram, hung as in a weight log, asks of one joint along a log's path, and the external effort there.

    Where the log's motion repeats, rows are one period, averaged; both efforts are low-passed alike, without delay.
    """

    KEY = ("log", "joint", "weight")
    UNKNOWN = ("tau_ext_unseen",)

    log: str
    joint: str
    weight: str
    role: str
    rate: float
    period: float
    t: Column
    q: Column
    load: Column
    load_mirrored: Column
    tau_ext: Column
    tau_ext_unseen: Column
