"""Records of the external effort."""

from dataclasses import dataclass

from pipeline.records.record import Column, Record


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
