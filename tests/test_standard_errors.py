"""Intervals of 95 % hold the truth 95 times in 100, however the noise is correlated."""

from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter

from davinci_forces.estimators import estimator
from davinci_forces.estimators.problem import Regression
from davinci_forces.identification.regression import pose
from davinci_forces.maths.estimation import correlation
from davinci_forces.maths.periods import averaging
from davinci_forces.records import Average, Signal, Trajectory
from davinci_forces.robots.dvrk_psm import ROBOT
from davinci_forces.robots.models import independent
from davinci_forces.stages.recordings import average, differentiate
from tests.test_averaging import entry

JOINTS = tuple(joint.name for joint in ROBOT.joints)
SEEDS = 200
RATE = 200.0
NOISE = 0.05  # of the raw effort


@pytest.fixture(scope="module")
def one(data) -> list[Average]:
    """The averaged periods of an arm of which all joints move."""
    table = np.loadtxt(data / "dvrk_wpi" / "one.csv", delimiter=",")
    N = len(table)
    signals = []
    for i, joint in enumerate(JOINTS):
        columns = {"t": np.arange(N) / RATE, "q": table[:, i], "dq": table[:, 7 + i], "tau": table[:, 14 + i]}
        columns["segment"] = columns["filled"] = np.zeros(N, int)
        signals.append(Signal("one", joint, "identification", RATE, "as recorded", "logged", 0, 0, **columns))
    return [
        r for r in average.run(signals, entry(name="one"), ROBOT, harmonics=0, lowpass=17.0) if isinstance(r, Average)
    ]


def problems(averages: list[Average]) -> dict[str, Regression]:
    """The regression of every joint."""
    made = {}
    for mean in averages:
        joint = ROBOT.joint(mean.joint)
        [trajectory] = (r for r in differentiate.run(mean, joint, harmonics=0) if isinstance(r, Trajectory))
        made[joint.name] = pose(independent(joint), trajectory)
    return made


def averaged_noise(phases: averaging.Phases, rho: float, seed: int, white: float = 0.0) -> averaging.Folded:
    """Noise of a first-order autoregression on the raw effort, of variance one, and some that is white, averaged."""
    rng = np.random.default_rng(seed)
    N = len(phases.t)
    e = lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.normal(size=N + 2000))[2000:] + white * rng.normal(size=N)
    return phases.fold(e)


@pytest.fixture(scope="module")
def scores(one):
    """Errors over stated standard errors (seeds, p) of every joint, and over the classical ones, by a function.

    A seed is estimated once for all tests that ask for it.
    """
    posed = problems(one)
    thetas = {joint: np.linalg.lstsq(p.Phi, p.tau, rcond=None)[0] for joint, p in posed.items()}
    N = int(one[0].periods * one[0].period * RATE)
    phases = averaging.Phases(np.arange(N) / RATE, one[0].period, len(one[0]))

    @cache
    def of_seed(rho, white, seed):
        noise, errors = averaged_noise(phases, rho, seed, white), {}
        for joint, p in posed.items():
            theta = thetas[joint]
            tau, var = p.Phi @ theta + NOISE * noise.mean, NOISE**2 * noise.var
            found = estimator("lse")(Regression(p.Phi, tau, var, p.periods, p.starts, p.names))
            errors[joint] = [(found.theta - theta) / std for std in (found.theta_std, found.standard_errors.classical)]
        return errors

    def of_seeds(rho: float, white: float = 0.0, seeds: int = SEEDS):
        every = [of_seed(rho, white, seed) for seed in range(seeds)]
        return tuple({joint: [errors[joint][k] for errors in every] for joint in JOINTS} for k in (0, 1))

    return of_seeds


def coverage(scores) -> dict[str, float]:
    """The share of intervals of 95 % that hold the truth, pooled over a joint's parameters."""
    return {joint: float(np.mean(np.abs(own) < 1.96)) for joint, own in scores.items()}


@pytest.mark.medium
@pytest.mark.parametrize("rho", [0.0, 0.97])
def test_intervals_cover_what_they_say_where_noise_is_correlated(scores, rho):
    """Of 50 seeds; the classical ones do not."""
    stated, classical = map(coverage, scores(rho, seeds=50))
    assert min(stated.values()) > 0.90
    assert (min(classical.values()) > 0.90) == (rho == 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(("rho", "least", "most"), [
    (0.0, 0.92, 0.98), (0.5, 0.92, 0.98), (0.9, 0.92, 0.98), (0.97, 0.92, 0.98), (0.99, 0.88, 1.0),
])  # fmt: skip
def test_intervals_cover_between_92_and_98_percent_up_to_a_correlation_of_97_percent(scores, rho, least, most):
    stated, _ = scores(rho)
    assert all(least <= share <= most for share in coverage(stated).values()), coverage(stated)


@pytest.mark.slow
@pytest.mark.parametrize("white", [0.3, 1.0])
def test_intervals_cover_where_a_slow_error_hides_in_white_noise(scores, white):
    """One autoregression for both would be that of the faster, and cover half of it."""
    stated, _ = scores(0.97, white)
    assert min(coverage(stated).values()) > 0.91


def test_a_spectrum_is_that_of_its_correlations():
    """S(w) = 1 + 2 sum r_k cos(k w): at w = 0 with the sum of all correlations, and with a mean of 1 over all w."""
    w = np.linspace(0.0, np.pi, 4097)
    S, sums = correlation.candidates(w, 60)
    np.testing.assert_allclose(S[:, 0], 1.0 + sums, rtol=1e-12)
    np.testing.assert_allclose(np.trapezoid(S, w, axis=1) / np.pi, 1.0, rtol=1e-6)
    assert len(np.unique(sums)) > len(S) // 2
