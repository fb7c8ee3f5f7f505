"""How fast signals are averaged and tested, beside the sums and transforms that this cannot do without."""

import time

import numpy as np
import pytest
from scipy.fft import irfft, next_fast_len, rfft

from davinci_forces.maths.periods import averaging
from davinci_forces.stages.forces import whiteness

SAMPLES = 1_000_000
RATE, PERIOD = 1000.0, 5.0  # Hz, s
AS_A_SUM = 20.0  # times at most, what averaging takes, over numpy's sum of the samples
AS_TRANSFORMS = 2.0  # times at most, what testing takes, over the Fourier transforms in it


def seconds(work) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def least(ours, rival, turns: int = 15) -> tuple[float, float]:
    """What two things take when nothing disturbs them, each done in turn with the other."""
    times = [(seconds(ours), seconds(rival)) for _ in range(turns)]
    first, second = (min(column) for column in zip(*times, strict=True))
    return first, second


def noise() -> np.ndarray:
    return np.random.default_rng(0).normal(size=SAMPLES)


def padded(x: np.ndarray) -> np.ndarray:
    return np.concatenate([x, np.zeros(next_fast_len(SAMPLES + whiteness.LAGS, real=True) - SAMPLES)])


def test_averaging_periods_of_whole_samples_takes_at_most_twenty_sums(capsys):
    t = np.arange(SAMPLES) / RATE
    x = np.sin(2 * np.pi * t / PERIOD) + noise()
    K = averaging.phases(PERIOD, RATE)
    ours, rival = least(lambda: averaging.Phases(t, PERIOD, K).fold(x), x.sum)
    mean = x.reshape(-1, K).mean(axis=0)
    np.testing.assert_allclose(averaging.Phases(t, PERIOD, K).fold(x).mean, mean, rtol=0, atol=1e-12)
    with capsys.disabled():
        print(f"\naveraging {SAMPLES} samples: {1e9 * ours / SAMPLES:.1f} ns each, {ours / rival:.1f} sums", end="")
    assert ours < AS_A_SUM * rival


def test_testing_a_million_samples_takes_at_most_twice_its_transforms(capsys):
    x = noise()
    long = padded(x)

    def transforms():
        irfft(rfft(long), len(long))
        rfft(x)

    level = padded(x - x.mean())
    squares = irfft(np.abs(rfft(level)) ** 2, len(level))
    assert whiteness.statistics(x)["acf1"] == pytest.approx(squares[1] / squares[0], abs=1e-12)
    ours, rival = least(lambda: whiteness.statistics(x), transforms)
    with capsys.disabled():
        print(f"\ntesting {SAMPLES} samples: {1e3 * ours:.0f} ms, {ours / rival:.2f} times its transforms", end="")
    assert ours < AS_TRANSFORMS * rival
