"""Records of tests of what should be white noise."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Column, Counts, Published, Record


@dataclass(frozen=True, eq=False)
class Whiteness(Record):
    """Whether a signal that should be white is: its autocorrelation and the tests of it."""

    KEY = ("log", "joint", "signal")

    log: str
    joint: str
    signal: str
    tested: int
    band: float
    band_99: float
    acf1: float
    outside: float
    ljung_box: float
    ljung_box_lags: int
    ljung_box_p: float
    periodogram_d: float
    periodogram_p: float
    periodogram_band: float
    periodogram_band_99: float
    jarque_bera_p: float
    skewness: float
    kurtosis: float
    white: int
    all_white: int
    lag: Counts
    acf: Column
    cycles: Column
    cumulated: Column

    def published(self) -> Iterator[Published]:
        """The tests, of innovations among the filter's own numbers."""
        if not self.signal.startswith("innovation_"):
            names = ("acf1", "ljung_box_p", "jarque_bera_p", "skewness", "kurtosis", "white")
            yield from self.publish(f"whiteness.{self.log}.{self.joint}.{self.signal}", *names)
            return
        prefix, signal = f"ekf.{self.log}.{self.joint}", self.signal.removeprefix("innovation_")
        for name in ("acf1", "ljung_box_p", "periodogram_p", "jarque_bera_p"):
            yield Published(f"{prefix}.{name}_{signal}", name)
        yield Published(f"{prefix}.white", "all_white")
