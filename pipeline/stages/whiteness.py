"""Test whether what averaging, the fit and the filter leave unexplained is white noise."""

from collections.abc import Iterator

import numpy as np

from pipeline.maths.signals.windows import longest_run, settled
from pipeline.records import Column, PeriodResidual, Residual, Track, Whiteness

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
    together = int(all(result["white"] for result in found.values()))
    for name, result in found.items():
        yield Whiteness(log=subject.log, joint=subject.joint, signal=name, all_white=together, **result)  # type: ignore[arg-type]


def statistics(x: Column) -> dict[str, object]:
    """Autocorrelation, Ljung-Box and Jarque-Bera of one signal.

    A signal without variance has nothing to test and is not called white.
    """
    from scipy import stats
    from statsmodels.tsa.stattools import acf, q_stat

    N = len(x)
    lags, tested_lags = min(LAGS, N // 4), min(TESTED_LAGS, N // 5)
    if N < 20 or np.ptp(x) == 0:
        correlation, box, p, normal = np.eye(1, lags + 1)[0], 0.0, 0.0, 0.0
    else:
        correlation = acf(x, nlags=lags, fft=True)
        # statsmodels' own Ljung-Box test correlates the slow way, in a time that grows with the square of N.
        boxes, probabilities = q_stat(correlation[1 : tested_lags + 1], N)
        box, p = float(boxes[-1]), float(probabilities[-1])
        normal = float(stats.jarque_bera(x).pvalue)
    band = 1.96 / np.sqrt(N)
    return {
        "tested": N,
        "band": float(band),
        "acf1": float(correlation[1]) if lags else 0.0,
        "outside": float(np.mean(np.abs(correlation[1:]) > band)) if lags else 0.0,
        "ljung_box": box,
        "ljung_box_lags": tested_lags,
        "ljung_box_p": p,
        "jarque_bera_p": normal,
        "skewness": float(stats.skew(x)) if np.ptp(x) else 0.0,
        "kurtosis": float(stats.kurtosis(x)) if np.ptp(x) else 0.0,
        "white": int(p > LEVEL),
        "lag": np.arange(lags + 1),
        "acf": correlation,
    }
