"""Single estimators against what defines them: their equations, solved in another way."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators import huber, iv, lse, prior, tls, wlse
from davinci_forces.estimators.problem import Prior, Regression, factorise
from tests.contracts.test_estimators import NAMES, PHI, SIGMA, THETA, K, M, problem

TWO_LOGS = (0, K // 2)


def outliers(seed: int = 0, share: float = 0.1) -> Regression:
    """Averaged efforts of which a share is far off."""
    p, rng = problem(seed), np.random.default_rng(seed)
    tau = p.tau + 3.0 * (rng.uniform(size=K) < share) * rng.choice([-1.0, 1.0], K)
    return Regression(p.Phi, tau, p.tau_var, p.periods, (0,), NAMES)


def test_residuals_that_count_less_beyond_a_size_balance(monkeypatch):
    """sum psi(r / s) Phi = 0, with s the standard deviation of normal residuals of this median; it takes few steps."""
    steps, plain = [], huber.factorise
    monkeypatch.setattr(huber, "factorise", lambda *given: steps.append(1) or plain(*given))
    p = outliers()
    residual = p.tau - p.Phi @ huber.estimate(p).theta
    s = np.median(np.abs(residual)) / 0.6745  # the upper quartile of the normal distribution
    balance = np.clip(residual / s, -1.345, 1.345) @ p.Phi  # 1.345: 95 % efficient for normal noise
    assert np.abs(balance / np.linalg.norm(p.Phi, axis=0)).max() < 1e-4 * np.sqrt(K)
    assert len(steps) < huber.MAX_STEPS_HUBER  # or it would not have converged


def test_known_noise_counts_at_samples_within_the_bound_over_their_share():
    """As that of least squares does at all of them."""
    rng = np.random.default_rng(1)
    p = replace(outliers(), noise=rng.normal(size=K), periods=rng.integers(0, 4, K))
    robust, valid = huber.estimate(p), p.periods > 0
    residual = np.sqrt(p.periods) * np.abs(p.tau - p.Phi @ robust.theta)
    inside = residual < 1.345 * np.median(residual[valid]) / 0.6745
    plain = lse.estimate(replace(p, noise=p.noise * inside))
    assert_allclose(robust.standard_errors.noise * inside[valid].mean(), plain.standard_errors.noise, rtol=1e-9)


@pytest.mark.parametrize("condition", [0.9e10, 1.1e10])
def test_columns_of_a_condition_number_above_ten_billion_are_not_told_apart(condition):
    """Of two columns at a small angle a, it is 2 / a."""
    p, Q = problem(seed=1), np.linalg.qr(np.random.default_rng(0).normal(size=(K, 2)))[0]
    p = replace(p, Phi=np.column_stack([Q[:, 0], Q[:, 0] + 2.0 / condition * Q[:, 1]]), names=("one", "other"))
    if condition < 1e10:
        factorise(p, p.weight)
    else:
        with pytest.raises(NotIdentifiable, match=r"does not separate one, other: condition number 1\.1e\+10 of"):
            factorise(p, p.weight)


@pytest.mark.parametrize(("part", "named"), [(0.18, [0, 2, 4]), (0.08, [0, 4])])
def test_columns_are_named_that_make_up_a_hundredth_of_what_is_not_told_apart(part, named):
    """Of the sum of squares of that combination of columns, each of length 1."""
    unit, names = PHI / np.linalg.norm(PHI, axis=0), np.array([*NAMES, "the twin"])
    Phi = np.column_stack([PHI, unit[:, 0] + part * unit[:, 2]])
    with pytest.raises(NotIdentifiable) as refused:
        factorise(replace(problem(seed=1), Phi=Phi, names=tuple(names)), np.ones(K))
    assert [name for name in names if name in str(refused.value)] == names[named].tolist()


@pytest.mark.parametrize("estimator", [lse, wlse, huber])
@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_an_estimate_is_the_same_whatever_the_unit_of_the_effort(estimator, unit):
    p = outliers()
    other = Regression(p.Phi, unit * p.tau, unit**2 * p.tau_var, p.periods, p.starts, p.names)
    assert_allclose(estimator.estimate(other).theta, unit * estimator.estimate(p).theta, rtol=1e-5)


def test_a_robust_fit_converges_whatever_the_units_of_the_columns():
    p, unit = outliers(), np.array([1e6, 1e5, 1e7, 1e6])
    other = huber.estimate(replace(p, Phi=p.Phi * unit))
    assert_allclose(other.theta * unit, huber.estimate(p).theta, rtol=1e-9)


def test_outliers_move_a_robust_fit_by_no_more_than_its_standard_error_says():
    off, std = [], []
    for seed in range(40):
        estimate = huber.estimate(outliers(seed))
        off.append(estimate.theta - THETA)
        std.append(estimate.standard_errors.noise)
    assert_allclose(np.std(off, axis=0), np.mean(std, axis=0), rtol=4 / np.sqrt(2 * 40))


@pytest.mark.parametrize("size", [0.1, 1.0])
def test_the_variance_of_the_model_s_error_makes_residuals_as_large_as_stated(size):
    """sum r^2 / (1/w + s^2) = K - p."""
    rng = np.random.default_rng(3)
    noise = rng.uniform(0.01, 0.1, K)
    weight = np.where(np.arange(K) % 7 == 0, 0.0, 1.0 / noise)
    residual = np.sqrt(noise + size) * rng.standard_normal(K)
    degrees = int(np.count_nonzero(weight)) - 4
    new = wlse.add_model_error(weight, residual, degrees)
    assert np.sum(residual**2 * new) == pytest.approx(degrees, rel=1e-9)
    s2 = 1.0 / new[weight > 0] - noise[weight > 0]
    assert_allclose(s2, s2[0], rtol=1e-6)
    assert s2[0] == pytest.approx(size, rel=0.3)
    assert not new[weight == 0].any()


def test_pooled_variances_are_means_over_neighbours_that_hold_enough_degrees_of_freedom():
    var, few = np.full(K, 0.25), np.full(K, M)
    assert_allclose(wlse.pool_variance(var, few), 0.25)
    few[::2] = M // 2  # a gap in half of the periods
    var[::2] = 0.5  # and twice the variance there
    pooled = wlse.pool_variance(var, few)
    degrees = np.where(np.arange(K) % 2, M - 1.0, M // 2 - 1.0)
    assert_allclose(pooled, np.sum(degrees * var) / np.sum(degrees), rtol=0.05)
    assert_allclose(wlse.pool_variance(np.zeros(K), few), 1.0)  # periods that are alike all count the same
    assert wlse.median_periods(np.array([0, 0, 0, 4, 6, 8])) == 6
    assert wlse.median_periods(np.array([1, 1, 3])) == 1


@pytest.mark.parametrize("error", [1.0, 0.01])
def test_a_prior_has_the_strength_that_makes_the_data_most_likely(error):
    """By the density of the data itself: normal, of the noise and of parameters that scatter around the guess."""
    p, some = problem(4), slice(None, None, 4)
    guess = THETA * (1.0 + error * np.array([0.3, -0.2, 0.1, -0.1]))
    p = Regression(p.Phi[some], p.tau[some], p.tau_var[some], p.periods[some], (0,), NAMES, Prior(guess=guess))
    F = p.Phi * np.abs(guess)  # in units of the guess
    y = p.tau - p.Phi @ guess
    size = np.linalg.norm(F * np.sqrt(M)) ** 2
    costs, fits = [], []
    for strength in prior.STRENGTHS[prior.STRENGTHS > 1e-12] * size:
        C = np.eye(len(y)) / M + F @ F.T / strength
        quadratic = y @ np.linalg.solve(C, y)
        costs.append(len(y) * np.log(quadratic) + np.linalg.slogdet(C)[1])
        change = np.linalg.solve(M * F.T @ F + strength * np.eye(len(guess)), M * F.T @ y)
        fits.append(guess * (1 + change * np.sign(guess)))
    assert_allclose(prior.estimate(p).theta, fits[int(np.argmin(costs))], rtol=1e-6)


def test_instruments_are_the_regressors_before_and_after_within_each_log():
    p = problem(5)
    p = Regression(p.Phi, p.tau, p.tau_var, np.where(np.arange(K) % 9 == 0, 0, M), TWO_LOGS, NAMES)
    parts = (PHI[: K // 2], PHI[K // 2 :])
    Z = np.concatenate([np.roll(part, 3, axis=0) + np.roll(part, -3, axis=0) for part in parts])
    Z *= p.periods[:, None]
    assert_allclose(iv.estimate(p).theta, np.linalg.solve(Z.T @ PHI, Z.T @ p.tau), rtol=1e-8)


def noisy(variances, sigma=SIGMA, seed=6) -> Regression:
    """Averaged efforts of columns with noise of these variances."""
    rng = np.random.default_rng(seed)
    Phi = PHI + np.sqrt(variances) * rng.standard_normal(PHI.shape)
    tau = PHI @ THETA + sigma / np.sqrt(M) * rng.standard_normal(K)
    cov = np.diag(variances)[None] * 1.0
    return Regression(Phi, tau, np.full(K, 1e-12), np.full(K, M), (0,), NAMES, Phi_cov=cov)


def test_noise_that_hides_one_column_is_reported_of_that_column_alone():
    variances = np.zeros(len(NAMES))
    variances[:2] = [4.0, 0.1] * np.mean(PHI[:, :2] ** 2, axis=0)
    with pytest.raises(NotIdentifiable, match=f"of the excitation of {NAMES[0]};"):
        tls.estimate(noisy(variances))


@pytest.mark.parametrize(("part", "named"), [(0.6, "one, other"), (0.4, "one")])
def test_noise_that_hides_a_combination_is_reported_of_columns_that_make_up_half_as_much_as_the_largest(part, named):
    """Of two orthogonal columns whose noise is one and the same, in the proportion of 1 to the root of `part`."""
    rng, noise = np.random.default_rng(0), np.array([1.0, np.sqrt(part)])
    Phi, tau = np.linalg.qr(rng.normal(size=(K, 2)))[0], rng.normal(size=K)
    cov = 0.8 / (1.0 + part) * np.outer(noise, noise)[None] / K
    p = Regression(Phi, tau, np.ones(K), np.ones(K, int), (0,), ("one", "other"), Phi_cov=cov)
    with pytest.raises(NotIdentifiable, match=f"noise is 80 % of the excitation of {named};"):
        tls.estimate(p)


@pytest.mark.parametrize("share", [0.48, 0.52])
def test_a_column_of_which_more_than_half_is_noise_is_refused_with_its_share(share):
    """Of what the other columns do not explain of it."""
    p, others = problem(seed=1), PHI[:, 1:]
    alone = PHI[:, 0] - others @ np.linalg.lstsq(others, PHI[:, 0])[0]
    variances = np.zeros(len(NAMES))
    variances[0] = share * np.mean(alone**2)
    p = replace(p, Phi_cov=np.diag(variances)[None])
    if share < 0.5:
        assert np.isfinite(tls.estimate(p).theta).all()
    else:
        with pytest.raises(NotIdentifiable, match=f"noise is 52 % of the excitation of {NAMES[0]};"):
            tls.estimate(p)


@pytest.mark.parametrize(("less", "unit"), [(1.0, 1.0), (1e-4, 1e-6)])
def test_total_least_squares_solve_their_equations(monkeypatch, less, unit):
    """(Phi' Phi - K C) theta = Phi' tau, which takes what the noise of the motion adds to the squares away again."""
    variances = 0.05 * np.mean(PHI**2, axis=0) * np.array([1.0, 0.0, less, 0.0])
    p = noisy(variances)
    p = replace(p, tau=unit * p.tau, tau_var=unit**2 * p.tau_var)
    corrected = np.linalg.solve(p.Phi.T @ p.Phi - K * np.diag(variances), p.Phi.T @ p.tau)
    steps, plain = [], tls.fit_for_noise
    monkeypatch.setattr(tls, "fit_for_noise", lambda *given: steps.append(1) or plain(*given))
    theta = tls.estimate(p).theta
    assert len(steps) < tls.MAX_STEPS_TLS  # or it would not have converged
    wrong = np.linalg.lstsq(p.Phi, p.tau, rcond=None)[0]
    assert_allclose(theta, corrected, rtol=1e-7)
    assert np.abs(wrong / corrected - 1.0).max() > 0.01


def test_the_effort_has_at_least_the_noise_by_which_its_periods_differ():
    """(Phi' Phi - lambda C) theta = Phi' tau, lambda = |tau - Phi theta|^2 / (v + theta' C theta), v that noise."""
    variances = 0.05 * np.mean(PHI**2, axis=0) * np.array([1.0, 0.0, 1.0, 0.0])
    p, recorded = noisy(variances), np.arange(K) % 7 > 0
    p = replace(p, tau_var=np.where(recorded, 1.0, 1e6), periods=np.where(recorded, 1, 0))
    theta, C, v = tls.estimate(p).theta, p.periods.sum() * np.diag(variances), np.count_nonzero(recorded)
    residual = p.tau - p.Phi @ theta
    share = p.periods @ residual**2 / (v + theta @ C @ theta)
    assert share < 0.9
    normal = p.Phi.T @ (p.periods * residual) + share * C @ theta
    assert_allclose(normal, 0.0, atol=1e-6 * np.abs(p.Phi.T @ (p.periods * p.tau)).max())


ERROR = np.sqrt(2 / (K - 4))  # of the mean square of K residuals of noise, as a share


@pytest.mark.parametrize(
    ("copies", "excess", "more"),
    [(50, 0.03, False), (50, 0.07, True), (1, 2.8 * ERROR, False), (1, 3.2 * ERROR, True)],
)
def test_residuals_that_exceed_the_noise_are_the_model_s_error_unless_by_less_than_the_noise_is_known(
    copies, excess, more
):
    """Of very many samples, where chance explains no excess, a variance of 200 degrees of freedom is known to 10 %.

    Of few samples, chance explains three standard errors.
    """
    rng, many = np.random.default_rng(7), copies * K
    Phi, var = np.tile(PHI, (copies, 1)), SIGMA**2 * np.where(np.arange(many) % K < K // 2, 1.0, 4.0)
    p = Regression(Phi, Phi @ THETA, var, np.full(many, M), (0,), NAMES)
    root = np.sqrt(M / wlse.pool_variance(var, p.periods))
    residual = rng.standard_normal(many)
    A = Phi * root[:, None]
    residual -= A @ np.linalg.lstsq(A, residual, rcond=None)[0]
    residual *= np.sqrt((1.0 + excess) * (many - 4) / np.sum(residual**2))
    p = Regression(Phi, Phi @ THETA + residual / root, var, p.periods, (0,), NAMES)
    assert (np.abs(wlse.estimate(p).theta / THETA - 1.0).max() > 1e-9) == more


@pytest.mark.parametrize(("weight", "named"), [(0.5, "effort"), (0.0, "effort"), (-0.5, "weight"), (np.nan, "weight")])
def test_a_share_is_a_weight_and_what_is_negative_or_no_number_is_not(weight: float, named: str):
    """With another sample whose effort is no number."""
    p = problem(seed=1)
    tau, weights = p.tau.copy(), np.ones(K)
    tau[7], weights[3] = np.nan, weight
    with pytest.raises(NotIdentifiable, match=f"the {named} of sample {8 if named == 'effort' else 4} of {K}"):
        factorise(replace(p, tau=tau), weights)


@pytest.mark.parametrize("missing", [0, 3])
def test_few_samples_count_without_the_parameters_and_without_those_that_no_period_has(missing: int):
    """s^2 = r' W r / (K - p), and the covariance s^2 (Phi' W Phi)^-1."""
    some, p = slice(None, None, K // 12), problem(seed=2)
    weight = np.where(np.arange(len(p.tau[some])) < missing, 0, M)
    few = replace(p, Phi=p.Phi[some], tau=p.tau[some], tau_var=p.tau_var[some], periods=weight)
    found = lse.estimate(few)
    residual = few.tau - few.Phi @ found.theta
    variance = residual @ (weight * residual) / (np.count_nonzero(weight) - 4)
    covariance = variance * np.linalg.inv(few.Phi.T @ (weight[:, None] * few.Phi))
    assert_allclose(found.standard_errors.classical, np.sqrt(np.diag(covariance)), rtol=1e-9)
    assert not found.standard_errors.model.any()  # that of a model is stated by whoever knows of others
