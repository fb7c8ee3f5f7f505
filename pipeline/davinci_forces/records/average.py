"""Records of averaged periods: the mean, and what averaging removes."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Column, Counts, Published, Record


@dataclass(frozen=True, eq=False)
class Average(Record):
    """One period of a joint, averaged over the periods of a recording, with the spread between them."""

    log: str
    joint: str
    rate: float
    period: float
    period_std: float
    stated_period: float
    periods: int
    t_start: float
    sigma_q: float
    sigma_dq: float
    sigma_tau: float
    sigma_tau_white: float
    relative_noise: float
    t: Column
    q: Column
    dq: Column
    tau: Column
    q_var: Column
    dq_var: Column
    tau_var: Column
    count: Counts

    def published(self) -> Iterator[Published]:
        """The period, which the joints of a log share, and the noise between periods."""
        yield Published(f"period.{self.log}", "period", std="period_std")
        yield Published(f"period.{self.log}.periods", "periods")
        yield from self.publish(f"noise.{self.log}.{self.joint}", "sigma_q", "sigma_dq", "sigma_tau", "relative_noise")


@dataclass(frozen=True, eq=False)
class PeriodResidual(Record):
    """What averaging removed: each sample minus the mean of the periods at its phase."""

    log: str
    joint: str
    t: Column
    q_noise: Column
    dq_noise: Column
    tau_noise: Column
