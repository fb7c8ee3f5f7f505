"""Records of signals that should be white, and of the reasons why they are not."""

from collections.abc import Iterator

from davinci_forces.records.record import Column, Counts, Labels, LogJointRecord, Published


class TestedSignal(LogJointRecord):
    """Correlations of one signal over the lag, and the bands that they keep if it is white."""

    KEY = ("log", "joint", "signal")

    signal: str
    tested: int
    band: float
    band_99: float
    lag: Counts


class Whiteness(TestedSignal):
    """The whiteness of a signal: its autocorrelation and its tests."""

    acf1: float
    acf1_std: float
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
    skewness_std: float
    kurtosis: float
    kurtosis_std: float
    white: int
    all_white: int
    acf: Column
    cycles: Column
    cumulated: Column

    def published(self) -> Iterator[Published]:
        """The tests; those of innovations are among the filter's numbers."""
        if not self.signal.startswith("innovation_"):
            tests = "acf1± skewness± kurtosis± ljung_box_p jarque_bera_p white"
            return self.publish("whiteness.{log}.{joint}.{signal}", tests)
        signal = self.signal.removeprefix("innovation_")
        names = ("acf1", "ljung_box_p", "periodogram_p", "jarque_bera_p")
        tests = " ".join(f"{name}_{signal}={name}" for name in names).replace("=acf1", "=acf1±")
        return self.publish("ekf.{log}.{joint}", f"{tests} white=all_white")


class Innovation(TestedSignal):
    """One innovation of the default filter: its size over the predicted size, and its correlation with the motion."""

    nis_own: float
    nis_own_std: float
    nis_low: float
    nis_high: float
    with_dq: Column
    with_ddq: Column
    with_sign: Column

    def published(self) -> Iterator[Published]:
        """The normalised square of this innovation alone."""
        return self.publish("ekf.{log}.{joint}", f"nis_{self.signal.removeprefix('innovation_')}=nis_own±")


class Explanation(LogJointRecord):
    """The reason why the innovations of the default filter are not white; a row tests one omission or correction."""

    finding: str  # white, left out, mended, or unexplained
    verdict: str
    clock_std: float
    without: Labels
    explains: Counts
    left: Counts
    ljung_box_p_q: Column
    ljung_box_p_dq: Column
    periodogram_p_q: Column
    periodogram_p_dq: Column
    walk: Column

    def published(self) -> Iterator[Published]:
        """The error of the sample times, where other joints determine it."""
        if self.clock_std > 0.0:
            yield from self.publish("ekf.{log}.{joint}", "clock_std")
