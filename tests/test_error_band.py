"""The band of free motion: it covers what it says, at every speed, from many logs or one, exact model or poor."""

import numpy as np
import pytest

from davinci_forces.maths.signals.smoothing import lowpass
from davinci_forces.maths.uncertainty.error_band import (
    LOG_BLOCKS,
    NORMAL_95,
    FreeErrors,
    calibrate,
    count_uncorrelated,
    coverage_by_speed,
    error_of_coverage,
    students_95,
)

RATE, STD = 100.0, 0.05


def free_motion(seed, model=0.0, samples=3000):
    """Velocity and error of one log: smoothed noise of deviation .7 STD, and a slow model error that grows with speed.

    The model's error has a size of its own in every log, as on arms.
    """
    random = np.random.default_rng(seed)
    slow = [lowpass(random.normal(size=samples + 2000), RATE, cutoff)[1000:-1000] for cutoff in (0.3, 4.0, 0.5)]
    dq, noise, error = (x / x.std() for x in slow)
    return dq, 0.7 * STD * noise + model * random.uniform(0.7, 1.3) * (0.4 + 0.6 * np.abs(dq)) * error


def of_logs(logs):
    """The errors of some logs (dq, error)."""
    rows = [(np.full(len(dq), i), np.arange(len(dq)) * LOG_BLOCKS // len(dq), dq, e) for i, (dq, e) in enumerate(logs)]
    source, block, dq, error = map(np.concatenate, zip(*rows, strict=True))
    uncorrelated = np.concatenate([np.full(len(e), count_uncorrelated(e) / len(e)) for _, e in logs])
    return FreeErrors(source, block, dq, error, np.full(len(dq), STD), uncorrelated)


def covered(logs, model, studies):
    """Coverage (5,) of unseen logs by the band of so many others, overall and by quartile of speed; its error."""
    shares = []
    for seed in range(studies):
        *others, (dq, error) = [free_motion(100 * seed + i, model) for i in range(logs + 1)]
        std = np.sqrt(calibrate(of_logs(others)).variance(np.full(len(dq), STD), dq))
        shares.append([np.mean(np.abs(error) <= NORMAL_95 * std), *coverage_by_speed(error, std, dq)[0]])
    return np.mean(shares, axis=0), np.std(shares, axis=0, ddof=1) / studies**0.5


@pytest.mark.parametrize("model", [0.0, 0.1])
def test_the_stated_error_of_a_coverage_holds_the_right_one(model):
    """Of the cells (log, quartile of speed) of unseen logs; a log of few uncorrelated errors hardly has one outside."""
    hits = []
    for seed in range(25):
        *others, (dq, error) = [free_motion(100 * seed + i, model) for i in range(7)]
        std = np.sqrt(calibrate(of_logs(others)).variance(np.full(len(dq), STD), dq))
        coverage, coverage_std = coverage_by_speed(error, std, dq)
        hits.append(np.abs(coverage - 0.95) <= 1.96 * coverage_std)
        assert (coverage_std > 0.01).all()
        assert (coverage_std < 0.5 / np.sqrt(count_uncorrelated(error / std) / 4)).all()
    assert np.mean(hits) > 0.9


@pytest.mark.parametrize("model", [0.0, 0.1])
@pytest.mark.parametrize("logs", [1, 6])
def test_an_unseen_log_is_covered_overall_and_at_every_speed(logs, model, request):
    """An exact model and a poor one, which errs thrice as much in fast motion; one log of it errs to wide."""
    mean, error = covered(logs, model, 100 if request.config.getoption("--slow") else 25)
    assert mean[0] + 2.0 * error[0] > 0.92
    assert mean[0] - 2.0 * error[0] < 0.98
    assert (mean[1:] + 2.0 * error[1:] > 0.92).all()
    assert (mean[1:] - 2.0 * error[1:] < (0.997 if logs == 1 and model else 0.99)).all()


def test_a_band_that_ignores_speed_would_not_be_right_at_every_speed():
    """The same poor model with one factor for all speeds: too wide at rest, too narrow in fast motion."""
    *others, (dq, error) = [free_motion(i, 0.1) for i in range(21)]
    calibration = calibrate(of_logs(others))
    flat = calibration._replace(factor=np.full(4, calibration.factor.mean()))
    by_speed, one = (
        coverage_by_speed(error, np.sqrt(c.variance(np.full(len(dq), STD), dq)), dq)[0] for c in (calibration, flat)
    )
    assert np.ptp(by_speed) < np.ptp(one)
    assert calibration.factor[-1] > 1.2 * calibration.factor[0]


def test_heavy_tails_do_not_widen_the_band_beyond_its_quantile():
    """A mean of squares follows the largest errors; the band follows the 95 % quantile."""
    random = np.random.default_rng(4)
    logs = [(random.normal(size=2000), 0.1 * random.standard_t(2.2, size=2000)) for _ in range(8)]
    variance = calibrate(of_logs(logs)).variance(np.full(2000, STD), logs[0][0])
    true = np.quantile(np.abs(0.1 * random.standard_t(2.2, size=200_000)), 0.95)
    assert NORMAL_95 * np.sqrt(variance.mean()) == pytest.approx(true, rel=0.1)


def test_few_uncorrelated_errors_widen_the_band_and_many_do_not():
    """As in conformal prediction: with fewer than 19 uncorrelated errors, the largest one counts."""
    data = of_logs([free_motion(i) for i in range(6)])
    few, many = (calibrate(data._replace(uncorrelated=np.full(len(data.dq), n / len(data.dq)))) for n in (15, 1e6))
    quantile = np.quantile(np.abs(data.error) / STD, 0.95, weights=data.weight, method="inverted_cdf") / NORMAL_95
    assert many.factor == pytest.approx(np.full(4, quantile), rel=0.1)
    assert few.factor == pytest.approx(np.full(4, np.abs(data.error).max() / STD / NORMAL_95), rel=0.2)


def test_every_log_counts_the_same_whatever_its_length():
    long, short = free_motion(1, 0.1, 12_000), [free_motion(i, 0.0, 1000) for i in (2, 3, 4)]
    data = of_logs([long, *short])
    assert [data.weight[data.source == i].sum() for i in range(4)] == pytest.approx([0.25] * 4)


def test_a_model_error_that_few_logs_show_is_taken_as_larger():
    """By Student's t with the blocks of the logs as degrees of freedom; an exact model has no such error."""
    assert (students_95(6), students_95(10**6)) == (pytest.approx(2.447, abs=1e-3), pytest.approx(NORMAL_95, abs=1e-4))
    logs = [free_motion(i, 0.1) for i in range(8)]
    repeated = of_logs(logs)
    one = calibrate(repeated._replace(source=np.zeros_like(repeated.source)))
    assert one.model_variance / calibrate(repeated).model_variance == pytest.approx(
        (2.447 / students_95(48)) ** 2, rel=0.1
    )
    assert calibrate(of_logs([free_motion(9)])).model_variance == 0.0


def test_correlated_errors_are_counted_by_their_correlation():
    """An autoregression of 0.9 has a correlation time of 19 samples; white noise has 1."""
    random, x = np.random.default_rng(5), np.zeros(40_000)
    white = random.normal(size=len(x))
    for k in range(1, len(x)):
        x[k] = 0.9 * x[k - 1] + white[k]
    assert count_uncorrelated(x) == pytest.approx(len(x) / 19, rel=0.15)
    assert count_uncorrelated(white) == pytest.approx(len(x), rel=0.05)
    assert count_uncorrelated(np.ones(10)) == 1.0


def test_a_band_is_as_uncertain_as_its_logs_differ():
    """Of logs whose errors differ in size; the width that is made of them scatters as its standard error says."""
    random, made = np.random.default_rng(6), []
    for _ in range(200):
        logs = [(random.normal(size=300), s * random.normal(size=300)) for s in random.uniform(0.07, 0.2, 6)]
        calibration = calibrate(of_logs(logs))
        made.append((np.log(calibration.variance(np.full(1, STD), np.zeros(1))[0]) / 2, calibration.relative_std))
    values, errors = np.array(made).T
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(values.std(), rel=0.4)


def test_a_share_of_which_no_sample_lies_outside_has_the_error_of_four_samples_more():
    """Of Agresti and Coull: two more inside, and two more outside, of n uncorrelated samples."""
    for inside, n in ((np.ones(400), 40.0), (np.tile([1.0, 1.0, 1.0, 0.0], 100), 40.0)):
        share = (n * inside.mean() + 2) / (n + 4)
        assert error_of_coverage(inside, n) == pytest.approx(np.sqrt(share * (1 - share) / (n + 4)), rel=1e-12)
    rng = np.random.default_rng(1)
    blocks = np.repeat(rng.integers(0, 2, 20), 50).astype(float)  # the bootstrap knows that these are 20 and not 1000
    assert error_of_coverage(blocks, 1000.0) == pytest.approx(np.std(blocks[::50], ddof=1) / np.sqrt(20), rel=0.15)


def test_the_relative_error_of_a_band_is_that_of_the_mean_over_logs_or_over_blocks_of_few():
    for logs, unit in ((6, lambda data: data.source), (2, lambda data: data.source * LOG_BLOCKS + data.block)):
        data = of_logs([free_motion(i) for i in range(logs)])
        numbers = unit(data)
        sizes = [np.log(np.quantile(np.abs(data.error[numbers == n]), 0.95)) for n in np.unique(numbers)]
        expected = np.std(sizes, ddof=1) / np.sqrt(len(sizes))
        assert calibrate(data).relative_std == pytest.approx(expected, rel=1e-9)
