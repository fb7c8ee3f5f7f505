"""Test whether what averaging, the fit and the filter leave unexplained is white noise."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.maths.signals import whiteness
from davinci_forces.maths.signals.windows import longest_run, settled
from davinci_forces.records import Column, PeriodResidual, Residual, Track, Whiteness

LAGS = 100  # of the autocorrelation that is shown
TESTED_LAGS = 20  # of the Ljung-Box statistic
LEVEL = 0.01  # below this probability a signal is called not white


def run(subject: PeriodResidual | Residual | Track) -> Iterator[Whiteness]:
    """What averaging removed, the effort that a fit leaves of a period, and a filter's innovations over its run."""
    if isinstance(subject, PeriodResidual):
        signals = {name: getattr(subject, name) for name in ("q_noise", "dq_noise", "tau_noise")}
    elif isinstance(subject, Residual):
        signals = {f"tau.{subject.model}.{subject.estimator}": subject.tau - subject.tau_hat}
    else:
        # Correlations across a gap mean nothing, and after one the filter starts anew.
        run_ = longest_run(subject.t, subject.rate)
        kept = settled(subject.t[run_])
        signals = {name: getattr(subject, name)[run_][kept] for name in ("innovation_q", "innovation_dq")}
    found = {name: statistics(x) for name, x in signals.items()}
    together = int(all(result["white"] and float(result["periodogram_p"]) > LEVEL for result in found.values()))  # type: ignore[arg-type]
    for name, result in found.items():
        yield Whiteness(log=subject.log, joint=subject.joint, signal=name, all_white=together, **result)  # type: ignore[arg-type]


def statistics(x: Column) -> dict[str, object]:
    """Autocorrelation, Ljung-Box, cumulative periodogram and Jarque-Bera of one signal.

    A signal without variance has nothing to test and is not called white.
    """
    N = len(x)
    lags, tested_lags = min(LAGS, N // 4), min(TESTED_LAGS, N // 5)
    cycles = 0.5 * np.arange(lags + 1) / max(lags, 1)
    correlation, straight = np.eye(1, lags + 1)[0], 2.0 * cycles
    box, wave = whiteness.LjungBox(0.0, 0.0), whiteness.Cumulative(cycles, straight, 0.0, 0.0)
    skewness = kurtosis = normal = 0.0
    if whiteness.FEWEST <= N and np.ptp(x) > 0:
        level = whiteness.centred([x])
        correlation = whiteness.autocorrelation(level, lags)
        box = whiteness.ljung_box(level, correlation, tested_lags)
        wave = whiteness.cumulative_periodogram(level)
    if np.ptp(x) > 0:
        skewness, kurtosis, normal = whiteness.shape(x)
    band, ordinates = 1.0 / np.sqrt(N), (N - 1) // 2
    return {
        "tested": N,
        "band": float(whiteness.NORMAL_95 * band),
        "band_99": float(whiteness.NORMAL_99 * band),
        "acf1": float(correlation[1]) if lags else 0.0,
        "outside": float(np.mean(np.abs(correlation[1:]) > whiteness.NORMAL_95 * band)) if lags else 0.0,
        "ljung_box": box.statistic,
        "ljung_box_lags": tested_lags,
        "ljung_box_p": box.probability,
        "periodogram_d": wave.distance,
        "periodogram_p": wave.probability,
        "periodogram_band": whiteness.distance_of(0.05, ordinates),
        "periodogram_band_99": whiteness.distance_of(0.01, ordinates),
        "jarque_bera_p": normal if N >= whiteness.FEWEST else 0.0,
        "skewness": skewness,
        "kurtosis": kurtosis,
        "white": int(box.probability > LEVEL),
        "lag": np.arange(lags + 1),
        "acf": correlation,
        "cycles": cycles,
        "cumulated": np.interp(cycles, wave.frequency, wave.share, left=0.0),
    }
