"""Records of the external effort."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Column, Published, Record


@dataclass(frozen=True, eq=False)
class Track(Record):
    """The external effort on one joint during one log, as a filter tracked it, and how far it may be off.

    Its standard deviation is the total: the filter's own, the model's error on free motion that no fit had seen, what
    the filter lags behind, and the offset of the day, where `free` windows tell one.
    """

    log: str
    joint: str
    model: str
    estimator: str
    filter: str
    role: str
    path: str
    at_rest: int
    rate: float
    tau_ext_rms: float
    nis_mean: float
    r_q: float
    r_dq: float
    q_dq: float
    q_tau: float
    day_offset: float
    day_offset_std: float
    filter_part: float
    model_part: float
    model_part_std: float
    lag_part: float
    smooth_rise: float
    band_from: str
    t: Column
    q: Column
    dq: Column
    tau: Column
    tau_hat: Column
    tau_ext: Column
    tau_ext_std: Column
    tau_ext_std_filter: Column
    tau_ext_smooth: Column
    tau_ext_direct: Column
    innovation_q: Column
    innovation_dq: Column
    nis: Column

    def published(self) -> Iterator[Published]:
        """What the filter found outside contacts, the noise that it assumes, and what its deviation is made of."""
        prefix = f"{self.filter}.{self.log}.{self.joint}"
        names = ("tau_ext_rms", "nis_mean", "r_q", "r_dq", "q_dq", "q_tau", "filter_part", "lag_part")
        yield from self.publish(prefix, *names)
        yield Published(f"{prefix}.model_part", "model_part", std="model_part_std")
        yield Published(f"{prefix}.day_offset", "day_offset", std="day_offset_std")
