"""Total least squares: what noise of the motion does to the columns, and that it no longer pulls the parameters."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators import estimator
from davinci_forces.estimators.problem import Regression
from davinci_forces.estimators.tls import fit_for_noise
from davinci_forces.identification.regression import averaged_motion, join_regressions, pose, row_covariance
from davinci_forces.identification.scores import select_logs
from davinci_forces.maths.estimation.least_squares import triangle
from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.models.model import ArmMotion
from davinci_forces.maths.periods.harmonics import Harmonics, derivative, kept_noise
from davinci_forces.records import Diagnostic, Fit
from davinci_forces.robots.models import independent
from davinci_forces.stages.model import fit
from tests import arm
from tests.contracts.test_estimators import NAMES, PHI, problem
from tests.test_estimation import trajectory
from tests.test_too_little_data import recording, said

K, PERIOD, SEEDS = 800, 10.0, 200
T = PERIOD * np.arange(K) / K
SHARE = np.array([0.2, 0.0, 0.2])  # of the deviations of q, dq and ddq that their noise has


def motion_of(columns) -> ArmMotion:
    return ArmMotion(*(x[:, None] for x in columns), PERIOD / K, np.zeros(K, np.int64))


def measured(seed: int, name="hand_roll", share=SHARE, tau_std=0.02) -> Regression:
    """Samples whose motion is measured with noise of a known size, one period, nothing averaged."""
    rng, model = np.random.default_rng(seed), independent(arm.joint(name))
    true = arm.excitation(name, T, PERIOD)
    tau = regressor(arm.joint(name).terms, *true) @ arm.THETA[name] + tau_std * rng.normal(size=K)
    sigma = share * np.array([x.std() for x in true])
    noisy = motion_of([x + s * rng.normal(size=K) for x, s in zip(true, sigma, strict=True)])
    J = model.sensitivity(motion_of(true))
    cov = np.einsum("kip,i,kiq->pq", J, sigma**2, J) / K
    names = tuple(parameter.name for parameter in model.parameters)
    var = np.full(K, tau_std**2)
    return Regression(model.regressor(noisy).Phi[:, 0], tau, var, np.ones(K, int), (0,), names, Phi_cov=cov[None])


def scores(name: str, joint="hand_roll") -> np.ndarray:
    """By how many deviations of their own the parameters are off, over 200 seeds."""
    found = np.array([estimator(name)(measured(seed, joint)).theta for seed in range(SEEDS)])
    return (found.mean(axis=0) - arm.THETA[joint]) / (found.std(axis=0) / np.sqrt(SEEDS))


def test_noise_of_the_motion_pulls_least_squares_and_not_total_ones():
    """A fifth of position and acceleration; in units of the standard error of 200 seeds' mean."""
    assert abs(scores("lse")[0]) > 30.0
    assert (np.abs(scores("tls")) < 4.0).all()


def test_columns_whose_noise_is_one_and_the_same_are_no_obstacle():
    """The slide's lifted mass and inertia have the noise of one acceleration."""
    p = measured(0, "instrument_slide")
    assert np.linalg.matrix_rank(p.Phi_cov[0]) == 1
    assert abs(scores("lse", "instrument_slide")[1]) > 10.0
    assert (np.abs(scores("tls", "instrument_slide")) < 4.0).all()


def test_classical_errors_are_as_large_as_those_that_noise_of_the_motion_makes_and_stated_ones_no_smaller():
    """White noise in the columns is taken for correlation, so that stated errors are too large."""
    found = [estimator("tls")(measured(seed)) for seed in range(SEEDS)]
    off = np.array([e.theta - arm.THETA["hand_roll"] for e in found])
    z, stated = (off / np.array([getattr(e.standard_errors, std) for e in found]) for std in ("classical", "total"))
    assert_allclose(z.std(axis=0), 1.0, atol=4 / np.sqrt(2 * SEEDS))
    assert (stated.std(axis=0) < 1.0).all()


def test_where_the_motion_is_exact_total_least_squares_are_least_squares():
    total, plain = (estimator(name)(problem(1)) for name in ("tls", "lse"))
    assert_array_equal(total.theta, plain.theta)
    assert_allclose(total.theta_std, plain.theta_std, rtol=1e-12)
    assert_allclose(total.standard_errors.classical, plain.standard_errors.classical, rtol=1e-12)


def test_with_noise_of_one_size_everywhere_it_is_the_textbook_s_smallest_singular_vector():
    rng = np.random.default_rng(0)
    Phi, tau = rng.normal(size=(60, 3)), rng.normal(size=60)
    R = triangle(Phi, tau, np.ones(60))
    found = fit_for_noise(R, np.eye(3), 1.0 / R.scale**2, 1.0) / R.scale
    *_, v = np.linalg.svd(np.column_stack([Phi, tau]))[2]
    assert_allclose(found, -v[:3] / v[3], rtol=1e-9)


def test_columns_without_noise_are_taken_out_first():
    """As they are in the limit of no noise, which only QR reaches."""
    rng = np.random.default_rng(1)
    Phi, tau = rng.normal(size=(60, 3)), rng.normal(size=60)
    R = triangle(Phi, tau, np.ones(60))
    mixed = fit_for_noise(R, np.eye(3), np.array([0.0, 0.0, 1.0]), 1.0)
    limit = fit_for_noise(R, np.eye(3), np.array([1e-10, 1e-10, 1.0]), 1.0)
    assert_allclose(mixed, limit, rtol=1e-6)
    assert np.abs(mixed - R.theta * R.scale).max() > 0.01


def test_a_model_that_errs_beyond_noise_is_not_taken_for_noise_of_the_columns():
    """The textbook's ratio of both noises would blame the columns for what friction leaves."""
    clean = measured(0, share=np.array([0.02, 0.0, 0.02]), tau_std=1e-3)
    wrong = replace(clean, tau=clean.tau + 0.2 * np.sin(2 * np.pi * 7 * T / PERIOD))
    C, Phi = K * wrong.Phi_cov[0], wrong.Phi
    expected = np.linalg.solve(Phi.T @ Phi - C, Phi.T @ wrong.tau)
    lse, tls = (estimator(name)(wrong).theta for name in ("lse", "tls"))
    assert_allclose(tls, expected, rtol=1e-6)
    R = triangle(Phi, wrong.tau, np.ones(K))
    variance, axes = np.linalg.eigh(C / np.outer(R.scale, R.scale))
    variance = np.where(variance > 1e-12 * variance[-1], variance, 0.0)
    textbook = fit_for_noise(R, axes, variance, float(wrong.tau_var.sum())) / R.scale
    assert abs(textbook[0] - lse[0]) > 10 * abs(tls[0] - lse[0])


# What is known of the noise


def test_the_derivatives_of_the_regressor_are_those_of_finite_differences():
    for name in arm.THETA:
        model, h = independent(arm.joint(name)), 1e-6
        q, dq, ddq = arm.excitation(name, T[5:-5:7] + 0.003)
        J = model.sensitivity(ArmMotion(q[:, None], dq[:, None], ddq[:, None], 0.1, np.zeros(len(q), np.int64)))
        terms = arm.joint(name).terms
        for i, step in enumerate(h * np.eye(3)):
            ahead, behind = (regressor(terms, q + s * step[0], dq + s * step[1], ddq + s * step[2]) for s in (1, -1))
            assert_allclose(J[:, i], (ahead - behind) / (2 * h), atol=1e-6)


def test_harmonics_keep_as_much_noise_as_is_said():
    H, omega, sigma, draws = 3, 2 * np.pi / PERIOD, 0.1, 4000
    rng, at = np.random.default_rng(0), T[[17]]
    averaged, there, kept = Harmonics(T[::8], omega, H), Harmonics(at, omega, H), []
    for _ in range(draws):
        c = averaged.project(sigma * rng.normal(size=K // 8))
        dc = derivative(c, omega)
        kept.append([float(there.evaluate(x)[0]) for x in (c, dc, derivative(dc, omega))])
    expected = kept_noise(sigma, K // 8, H, omega)
    size = np.sqrt(np.diag(expected))
    assert_allclose(np.cov(np.array(kept).T) / np.outer(size, size), expected / np.outer(size, size),
                    atol=4 * np.sqrt(2 / draws))  # fmt: skip


def test_noise_of_averaged_positions_comes_to_the_columns_as_is_said():
    """By averages of positions with noise, differentiated as the stage does."""
    name, draws = "hand_pitch", 300
    t = trajectory(arm.signal(name))
    model, rng = independent(arm.joint(name)), np.random.default_rng(0)
    t = replace(t, sigma_q=1e-2)
    clean, sum_of = model.regressor(averaged_motion(t)).Phi[:, 0], 0.0
    omega = 2 * np.pi / t.period
    kept = Harmonics(t.t, omega, t.harmonics)
    for _ in range(draws):
        c = kept.project(t.sigma_q / np.sqrt(t.periods) * rng.normal(size=len(t.q)))
        dc = derivative(c, omega)
        ddc = derivative(dc, omega)
        off = {s: getattr(t, s) + kept.evaluate(x) for s, x in (("q", c), ("dq", dc), ("ddq", ddc))}
        error = model.regressor(averaged_motion(replace(t, **off))).Phi[:, 0] - clean
        smooth = np.array([n != "Coulomb friction" for n in (p.name for p in model.parameters)])
        error[:, ~smooth] = 0.0  # a sign jumps, which has no derivative
        sum_of = sum_of + error.T @ error / len(error) / draws
    expected = row_covariance(model, t)
    size = np.sqrt(np.diag(expected))
    seen = size > 0
    assert_allclose(np.diag(sum_of)[seen] / np.diag(expected)[seen], 1.0, atol=0.2)
    assert (sum_of[~seen] == 0).all()


def test_what_is_known_of_the_columns_goes_with_the_logs():
    model = independent(arm.joint("hand_roll"))
    one, other = (pose(model, trajectory(arm.signal(seed=seed, log=f"log-{seed}"))) for seed in (0, 1))
    both = join_regressions([one, other])
    assert_array_equal(both.Phi_cov, np.concatenate([one.Phi_cov, other.Phi_cov]))
    assert_array_equal(select_logs(both, [1]).Phi_cov, other.Phi_cov)
    assert join_regressions([one, replace(other, Phi_cov=None)]).Phi_cov is None
    assert select_logs(replace(both, Phi_cov=None), [1]).Phi_cov is None


# What is refused


def test_motion_whose_noise_is_not_known_is_refused():
    with pytest.raises(NotIdentifiable, match="the noise of the motion is not known without repeated periods"):
        estimator("tls")(replace(problem(1), Phi_cov=None))


def test_noise_that_buries_what_the_motion_shows_is_refused_by_name():
    p = problem(1)
    cov = np.zeros((1, 4, 4))
    cov[0, 2, 2] = np.mean(PHI[:, 2] ** 2)
    with pytest.raises(NotIdentifiable, match="% of the excitation of") as refused:
        estimator("tls")(replace(p, Phi_cov=cov))
    assert [name for name in NAMES if name in str(refused.value)] == [NAMES[2]]


def test_a_log_that_does_not_repeat_has_no_total_least_squares_and_it_is_said():
    t = np.arange(3000) / 100.0
    q = 0.3 * np.sin(2.0 * t) + 0.2 * np.sin(2.0 * np.sqrt(2) * t + 1.0)
    made, text = said(fit, recording(q, np.gradient(q, 0.01)))
    assert "hand_roll: tls is left out: the noise of the motion is not known without repeated periods" in text
    assert {"lse", "consistent"} <= {r.estimator for r in made if isinstance(r, Fit)}
    averaged = list(fit.run([trajectory(arm.signal())], [], arm.ARM, lowpass=17.0))
    assert "tls" in {r.estimator for r in averaged if isinstance(r, Fit)}
    assert not [r for r in averaged if isinstance(r, Diagnostic)]
