"""Records of the external effort."""

from collections.abc import Iterator
from dataclasses import dataclass

from pipeline.records.record import Column, Published, Record


@dataclass(frozen=True, eq=False)
class Track(Record):
    """The external effort on one joint during one log, as a filter tracked it."""

    log: str
    joint: str
    model: str
    estimator: str
    filter: str
    role: str
    at_rest: int
    rate: float
    tau_ext_rms: float
    nis_mean: float
    r_q: float
    r_dq: float
    q_q: float
    q_dq: float
    q_tau: float
    t: Column
    q: Column
    dq: Column
    tau: Column
    tau_hat: Column
    tau_ext: Column
    tau_ext_std: Column
    tau_ext_direct: Column
    innovation_q: Column
    innovation_dq: Column
    nis: Column

    def published(self) -> Iterator[Published]:
        """What the filter found outside contacts, and the noise that it assumes."""
        names = ("tau_ext_rms", "nis_mean", "r_q", "r_dq", "q_q", "q_dq", "q_tau")
        yield from self.publish(f"{self.filter}.{self.log}.{self.joint}", *names)
