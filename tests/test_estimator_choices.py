"""What each estimator is for: where it does better than least squares, and that it gives nothing away elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq, nnls

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators import estimator
from davinci_forces.estimators.problem import Prior, Regression, factorise
from davinci_forces.estimators.wlse import pool_variance
from davinci_forces.maths.models.independent import regressor
from tests import arm
from tests.contracts.test_estimators import NAMES, PHI, SEEDS, THETA, K, problem

TERMS = arm.joint("hand_roll").terms
POSITIVE = np.array([term.positive for term in TERMS])


def errors(name: str, problems) -> np.ndarray:
    """Root mean square error of each parameter."""
    return np.sqrt(np.mean([(estimator(name)(p).theta - THETA) ** 2 for p in problems], axis=0))


def test_far_samples_hardly_move_robust_parameters():
    def struck(seed):
        p, random = problem(seed), np.random.default_rng([seed, 1])
        return replace(p, tau=p.tau + 3.0 * (random.random(K) < 0.05) * random.normal(size=K))

    problems = [struck(seed) for seed in range(50)]
    assert (errors("huber", problems) < 0.5 * errors("lse", problems)).all()


@pytest.mark.parametrize("weighted", [False, True])
def test_robust_parameters_are_those_of_statsmodels(weighted):
    from statsmodels.robust.norms import HuberT
    from statsmodels.robust.robust_linear_model import RLM

    p, random = problem(seed=2), np.random.default_rng(3)
    p = replace(p, tau=p.tau + 3.0 * (random.random(K) < 0.2) * random.normal(size=K))
    if weighted:
        p = replace(p, periods=random.integers(1, 9, K))
    root = np.sqrt(p.weight)
    model = RLM(root * p.tau, root[:, None] * p.Phi, M=HuberT(1.345))
    assert_allclose(estimator("huber")(p).theta, model.fit(tol=1e-12, maxiter=500, conv="coefs").params, atol=1e-6)


def test_without_far_samples_robust_parameters_are_nearly_as_good():
    problems = [problem(seed) for seed in range(SEEDS)]
    assert (errors("huber", problems) < 1.1 * errors("lse", problems)).all()


def test_noise_of_the_motion_pulls_least_squares_and_not_instrumental_variables():
    """Noise of the measured position, velocity and acceleration, as where no periods are averaged."""
    t = 10.0 * np.arange(4 * K) / K / 4

    def measured(seed):
        random = np.random.default_rng(seed)
        q, dq, ddq = arm.excitation("hand_roll", t)
        tau = regressor(TERMS, q, dq, ddq) @ THETA + 0.01 * random.normal(size=len(t))
        noisy = (x + 0.2 * x.std() * random.normal(size=len(t)) for x in (q, dq, ddq))
        Phi, var = regressor(TERMS, *noisy), np.full(len(t), 1e-4)
        return Regression(Phi, tau, var, np.ones(len(t), int), (0,), NAMES)

    def bias(name):
        found = [estimator(name)(measured(seed)) for seed in range(40)]
        theta = np.array([each.theta for each in found])
        return np.abs(theta.mean(axis=0) - THETA) / theta.std(axis=0) * np.sqrt(40)

    assert bias("lse")[0] > 10.0
    assert bias("iv")[0] < 4.0
    assert bias("iv")[1] < 4.0


def test_a_bound_is_met_exactly_and_the_rest_is_the_best_there_is():
    theta = np.array([-0.05, 0.0103, 0.3706, 0.21968])
    p = replace(problem(seed=1), tau=PHI @ theta, known=Prior(POSITIVE))
    found = estimator("bounded")(p)
    assert found.theta[0] == 0.0
    rest = np.linalg.lstsq(PHI[:, 1:], p.tau, rcond=None)[0]
    assert_allclose(found.theta[1:], rest, rtol=1e-9)
    everything = replace(p, known=Prior(np.ones(len(NAMES), bool)))
    assert_allclose(estimator("bounded")(everything).theta, nnls(PHI, p.tau)[0], atol=1e-9)


def test_where_no_bound_holds_bounded_least_squares_are_least_squares():
    p = replace(problem(seed=1), known=Prior(POSITIVE))
    assert_allclose(estimator("bounded")(p).theta, estimator("lse")(p).theta, rtol=0, atol=0)


def test_what_the_motion_hardly_shows_is_drawn_to_the_guess_and_the_rest_is_not():
    """The acceleration is a thousandth of what it is, so noise leaves the inertia open."""
    weak = PHI * [1e-3, 1.0, 1.0, 1.0]
    guess = Prior(guess=np.array([0.4, 0.0, 0.3, 0.2]))
    problems = [
        replace(p, Phi=weak, tau=p.tau - PHI @ THETA + weak @ THETA, known=guess) for p in map(problem, range(50))
    ]
    drawn, lse = errors("prior", problems), errors("lse", problems)
    assert drawn[0] < 0.1 * lse[0]
    assert (drawn[1:] < 1.2 * lse[1:]).all()


def test_what_the_model_leaves_beyond_noise_makes_weights_equal():
    """Weights of the noise alone trust the quiet half, where the model errs as it does elsewhere."""
    quiet = np.where(np.arange(K) < K // 2, 1.0, 0.03)
    wrong = 0.3 * np.sin(2 * np.pi * 5 * np.arange(K) / K)
    weigh = {"noise": lambda p: factorise(p, p.periods / pool_variance(p.tau_var, p.periods)).theta}
    weigh |= {name: lambda p, name=name: estimator(name)(p).theta for name in ("lse", "wlse")}

    def off(name, error):
        """Root mean square of the effort that parameters are off by."""
        problems = (problem(seed, 0.3 * quiet) for seed in range(50))
        thetas = [weigh[name](replace(p, tau=p.tau + error)) for p in problems]
        return np.sqrt(np.mean([(PHI @ (theta - THETA)) ** 2 for theta in thetas]))

    assert off("wlse", 0.0) < 0.3 * off("lse", 0.0)
    assert off("noise", wrong) > 1.5 * off("lse", wrong)
    assert off("wlse", wrong) < 1.1 * off("lse", wrong)


def test_weights_that_are_not_numbers_are_refused():
    var = np.full(K, 0.1)
    var[3] = np.nan
    with pytest.raises(NotIdentifiable, match="the weight of sample"):
        estimator("wlse")(replace(problem(seed=1), tau_var=var))


def test_each_log_has_weights_of_its_own_variance_and_enough_periods():
    a, b = problem(seed=1), problem(seed=2, sigma=1.0)
    columns = {
        name: np.concatenate([getattr(p, name) for p in (a, b)]) for name in ("Phi", "tau", "tau_var", "periods")
    }
    both = replace(a, **columns, starts=(0, K))
    weight = np.concatenate([p.periods / pool_variance(p.tau_var, p.periods) for p in (a, b)])
    assert_allclose(estimator("wlse")(both).theta, factorise(both, weight).theta, rtol=1e-9)
    few = replace(both, periods=np.where(np.arange(2 * K) < K, 10, 3))
    with pytest.raises(NotIdentifiable, match="and one holds 3"):
        estimator("wlse")(few)


def test_weights_of_three_periods_are_refused():
    with pytest.raises(NotIdentifiable, match="at least 4 periods in every log, and one holds 3"):
        estimator("wlse")(replace(problem(seed=1), periods=np.full(K, 3)))


def paule_mandel(p: Regression, weight: np.ndarray) -> np.ndarray:
    """Parameters by weights with the one constant variance that makes the residuals as large as stated."""
    R = factorise(p, weight)
    squares, degrees = (p.tau - p.Phi @ R.theta) ** 2, len(weight) - len(R.y)
    s2 = brentq(lambda s2: (squares / (1 / weight + s2)).sum() - degrees, 0.0, 1e6, xtol=1e-14, rtol=1e-14)
    return factorise(p, 1 / (1 / weight + s2)).theta


@pytest.mark.parametrize(("excess", "is_model_error"), [(-0.2, False), (0.15, False), (0.27, True), (0.6, True)])
def test_an_excess_of_three_standard_errors_is_the_model_s_error(excess, is_model_error):
    """With 396 degrees of freedom, three standard errors of the squares are a fifth of them."""
    p = problem(seed=4, sigma=0.2 * np.where(np.arange(K) < K // 2, 1.0, 0.3))
    weight = p.periods / pool_variance(p.tau_var, p.periods)
    residual = p.tau - p.Phi @ factorise(p, weight).theta
    degrees = K - p.Phi.shape[1]
    assert 3.0 * np.sqrt(2.0 / degrees) == pytest.approx(0.21, abs=0.01)
    p = replace(p, tau_var=p.tau_var * (weight * residual**2).sum() / degrees / (1.0 + excess))
    weight = p.periods / pool_variance(p.tau_var, p.periods)
    expected = paule_mandel(p, weight) if is_model_error else factorise(p, weight).theta
    assert_allclose(estimator("wlse")(p).theta, expected, rtol=1e-9)


@pytest.mark.parametrize(
    "periods",
    [np.full(41, 9), np.full(41, 300), 5 + np.arange(41) % 3, np.where(np.arange(41) % 5, 9, np.arange(41) % 2)],
)
def test_a_variance_is_pooled_over_the_fewest_neighbours_that_have_200_degrees(periods):
    var = np.random.default_rng(1).chisquare(4, size=41) ** 3  # of a wide range
    degrees = np.maximum(periods - 1, 0)  # a sample of one period tells nothing of the variance, as one of none
    half = min(int(np.ceil(200 / np.median(degrees))) // 2, 20)
    around = [np.arange(k - half, k + half + 1) % 41 for k in range(41)]
    expected = [np.average(var[near], weights=degrees[near]) for near in around]
    assert_allclose(pool_variance(var, periods), expected, rtol=1e-12)
