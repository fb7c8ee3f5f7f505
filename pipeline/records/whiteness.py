"""Records of tests of what should be white noise."""

from dataclasses import dataclass

from pipeline.records.record import Column, Counts, Record


@dataclass(frozen=True, eq=False)
class Whiteness(Record):
    """Whether a signal that should be white is: its autocorrelation and the tests of it."""

    KEY = ("log", "joint", "signal")

    log: str
    joint: str
    signal: str
    tested: int
    band: float
    acf1: float
    outside: float
    ljung_box: float
    ljung_box_lags: int
    ljung_box_p: float
    jarque_bera_p: float
    skewness: float
    kurtosis: float
    white: int
    all_white: int
    lag: Counts
    acf: Column
