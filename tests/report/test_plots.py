"""What plots say in numbers: means over ranges, cross-correlations, and how much one motion explains."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.report.sections.joints.residuals import binned_means, correlation, explained_by

RNG = np.random.default_rng(1)
X = RNG.uniform(-1.0, 1.0, 4000)


def test_a_crooked_dependence_is_seen_where_a_correlation_is_blind():
    y = X**2 - np.mean(X**2)
    assert abs(np.corrcoef(X, y)[0, 1]) < 0.05
    assert explained_by(X, y) > 0.99


def test_noise_is_explained_by_nothing():
    """Chance alone explains 39 of 3999 parts, which is taken off: over 40 draws the rest is nil."""
    shares = [explained_by(X, np.random.default_rng(seed).standard_normal(4000)) for seed in range(40)]
    assert abs(np.mean(shares)) < 3 * np.std(shares) / np.sqrt(len(shares))


def test_half_of_the_variance_is_half():
    y = np.sign(X) + RNG.standard_normal(len(X))
    assert explained_by(X, y) == pytest.approx(0.5, abs=0.03)


def test_what_does_not_vary_or_is_too_short_is_not_explained():
    assert explained_by(X, np.ones_like(X)) == 0.0
    assert explained_by(X[:3], X[:3]) == 0.0


def test_means_over_ranges_are_those_of_the_samples_in_them():
    x = np.array([0.0, 0.1, 0.9, 1.0])
    middles, means, stds = binned_means(x, np.array([1.0, 3.0, 5.0, 5.0]), bins=2)
    assert_allclose(middles, [0.25, 0.75])
    assert_allclose(means, [2.0, 5.0])
    assert_allclose(stds, [1 / np.sqrt(2), 0.0])


def test_a_delayed_signal_correlates_at_its_delay():
    x = RNG.standard_normal(500)
    lags = np.arange(-10, 11)
    assert lags[np.argmax(correlation(x, np.roll(x, 4), lags))] == 4
    assert correlation(x, x, np.zeros(1, int))[0] == pytest.approx(1.0)
