"""Parameters: those put in come out, as well as they claim to."""

from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from davinci_forces.estimators import ESTIMATORS, estimator
from davinci_forces.estimators.problem import Regression
from davinci_forces.estimators.wlse import pool_variance
from davinci_forces.identification.joint_models import Identified
from davinci_forces.identification.scores import folds
from davinci_forces.maths.models.model import Parameter
from davinci_forces.records import (
    Average,
    CrossFit,
    Diagnostic,
    Fit,
    FittedPaths,
    MeasurementNoise,
    PathShare,
    Prediction,
    Residual,
    Trajectory,
)
from davinci_forces.records.prediction import ANOTHER_PATH
from davinci_forces.robots.models import independent
from davinci_forces.stages.model import fit, predict
from davinci_forces.stages.recordings import average, differentiate
from tests import arm
from tests.test_averaging import entry


def trajectory(signal) -> Trajectory:
    averages = average.run([signal], entry(name=signal.log), arm.ARM, harmonics=0, lowpass=17.0)
    [mean] = [r for r in averages if isinstance(r, Average)]
    made = differentiate.run(mean, arm.joint(signal.joint), harmonics=0)
    return next(r for r in made if isinstance(r, Trajectory))


def fits(*signals) -> dict[str, Fit]:
    made = fitted_to([trajectory(s) for s in signals])
    return {r.estimator: r for r in made if isinstance(r, Fit)}


def problem(K=400, seed=0, rho=0.0, M=10) -> tuple[Regression, np.ndarray]:
    """A linear problem with known parameters and noise of a first-order autoregression."""
    rng = np.random.default_rng(seed)
    phase = 2 * np.pi * np.arange(K) / K
    Phi = np.column_stack([np.sin(phase), np.cos(2 * phase), np.sign(np.sin(phase + 0.3))])
    theta = np.array([1.0, -0.5, 0.2])
    noise = rng.normal(size=K + 50)
    for k in range(1, len(noise)):
        noise[k] += rho * noise[k - 1]
    tau_var = 0.01 * rng.chisquare(M - 1, size=K) / (M - 1) * M
    tau = Phi @ theta + 0.1 * noise[50:] * np.sqrt(1 - rho**2)
    return Regression(Phi, tau, tau_var, np.full(K, M), (0,), ("a", "b", "c")), theta


@pytest.mark.slow
def test_parameters_are_found_as_well_as_they_claim_to_be(monkeypatch):
    """Errors of many simulated recordings over stated deviations of noise have deviation one, for both estimators.

    The model is right, and its part of the error widens the total by at most half.
    """
    monkeypatch.setattr(fit, "ESTIMATORS", ("lse", "wlse"))  # the others are not judged
    found = [fits(arm.signal(seed=seed)) for seed in range(60)]
    for name in ("lse", "wlse"):
        total, noise = (np.mean([getattr(f[name], s) for f in found], axis=0) for s in ("theta_std", "theta_std_noise"))
        assert ((noise <= total) & (total < 1.5 * noise)).all(), total / noise
        for std in ("theta_std_classical", "theta_std_noise"):
            scores = np.array([(f[name].theta - arm.THETA["hand_roll"]) / getattr(f[name], std) for f in found])
            assert_allclose(scores.std(axis=0), 1.0, atol=0.3)
            assert_allclose(scores.mean(axis=0), 0.0, atol=4 / np.sqrt(60))


@pytest.mark.parametrize("name", arm.THETA)
def test_every_joint_gives_back_its_parameters(name):
    lse = fits(arm.signal(name))["lse"]
    assert (np.abs(lse.theta - arm.THETA[name]) < 4 * lse.theta_std_classical).all()
    assert list(lse.parameter) == [term.name for term in arm.joint(name).terms]


def test_weights_of_averaged_variances_do_not_do_worse_than_none():
    """Weights of single variances would: their parameters scatter 1.18 times as much at ten periods."""
    lse, wlse = (
        np.std([estimator(name)(problem(seed=seed)[0]).theta for seed in range(300)], axis=0)
        for name in ("lse", "wlse")
    )
    assert (wlse / lse < 1.05).all()


def test_weights_gain_where_noise_differs_over_the_period():
    def varied(seed):
        p, theta = problem(seed=seed, K=800)
        loud = np.where(np.arange(800) < 400, 5.0, 1.0)
        tau = p.Phi @ theta + (p.tau - p.Phi @ theta) * loud
        return Regression(p.Phi, tau, p.tau_var * loud**2, p.periods, p.starts, p.names)

    lse, wlse = (np.std([estimator(n)(varied(s)).theta for s in range(100)], axis=0) for n in ("lse", "wlse"))
    assert (wlse < 0.75 * lse).all()


def test_correlated_residuals_widen_the_stated_errors_to_those_there_are():
    answers = [(estimator("lse")(p), theta) for p, theta in (problem(seed=s, rho=0.9, K=2000) for s in range(200))]
    stated = np.std([(a.theta - theta) / a.theta_std for a, theta in answers], axis=0)
    classical = np.std([(a.theta - theta) / a.standard_errors.classical for a, theta in answers], axis=0)
    assert (classical[:2] > 2.0).all()
    assert_allclose(stated[:2], 1.0, atol=4 / np.sqrt(2 * 200))


@given(st.integers(0, 2**32 - 1), st.floats(0, 1e3))
def test_any_other_parameters_have_the_error_that_the_normal_equations_predict(seed, size):
    """MSE(theta) = MSE_LSE + d' (Phi' Phi / K) d with d = theta - theta_LSE."""
    p, _ = problem(seed=seed)
    lse = estimator("lse")(p).theta
    d = size * np.random.default_rng(seed).normal(size=3)
    excess = np.mean((p.tau - p.Phi @ (lse + d)) ** 2) - np.mean((p.tau - p.Phi @ lse) ** 2)
    assert excess == pytest.approx(d @ (p.Phi.T @ p.Phi / len(p.tau)) @ d, rel=1e-9, abs=1e-9)


def test_few_periods_leave_the_weights_out_and_the_rest_goes_on():
    made = fitted_to([trajectory(arm.signal(periods=3))])
    estimators = {r.estimator for r in made if isinstance(r, Fit)}
    assert "lse" in estimators
    assert "wlse" not in estimators
    [said] = [text for r in made if isinstance(r, Diagnostic) for text in r.text]
    assert "wlse is left out: weights need at least 4 periods in every log, and one holds 3" in said


@given(st.integers(4, 500), st.integers(4, 60), st.integers(0, 2**32 - 1))
def test_pooling_keeps_the_mean_variance_and_never_leaves_a_weight_infinite(K, M, seed):
    var = np.random.default_rng(seed).chisquare(2, size=K)
    var[0] = 0.0
    smooth = pool_variance(var, np.full(K, M))
    assert (smooth > 0).all()
    assert smooth.mean() == pytest.approx(var.mean(), rel=1e-9)


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_residuals_are_said_to_be_correlated_over_as_many_lags_as_they_are(rho):
    """The correlations of a first-order autoregression at all lags but 0 sum to 2 rho / (1 - rho)."""
    lags = [estimator("lse")(problem(seed=s, rho=rho, K=2000)[0]).standard_errors.lags for s in range(20)]
    assert np.median(lags) == pytest.approx(2 * rho / (1 - rho), rel=0.15, abs=0.5)


def test_logs_of_a_joint_are_pooled():
    one, both = fits(arm.signal(seed=1)), fits(arm.signal(seed=1, log="a"), arm.signal(seed=2, log="b", period=8.0))
    assert both["lse"].logs == ("a", "b")
    assert (both["lse"].theta_std_classical < one["lse"].theta_std_classical).all()


def test_a_period_is_differentiated_as_its_spectrum_is():
    [mean] = [
        r for r in average.run([arm.signal()], entry(), arm.ARM, harmonics=0, lowpass=17.0) if isinstance(r, Average)
    ]
    made = next(differentiate.run(mean, arm.joint("hand_roll"), harmonics=0))
    spectrum = np.fft.rfft(mean.q)
    spectrum[made.harmonics + 1 :] = 0.0
    omega = 2 * np.pi / mean.period * np.arange(len(spectrum))
    for order, name in enumerate(("q", "dq", "ddq")):
        expected = np.fft.irfft((1j * omega) ** order * spectrum, n=len(mean.q))
        assert_allclose(getattr(made, name), expected, atol=1e-12 * np.abs(expected).max())


def test_derivatives_are_those_of_the_trajectory():
    made = trajectory(arm.signal(noise=0))
    expected = arm.excitation("hand_roll", made.t, made.period)
    for name, wanted in zip(("q", "dq", "ddq"), expected, strict=True):
        assert_allclose(getattr(made, name), wanted, atol=1e-7)


def test_a_harmonic_that_is_left_out_is_remarked_on():
    signal = arm.signal("hand_roll")
    object.__setattr__(signal, "q", signal.q + 0.05 * np.sin(2 * np.pi * 5 * signal.t / 10))
    [mean] = [r for r in average.run([signal], entry(), arm.ARM, harmonics=0, lowpass=17.0) if isinstance(r, Average)]
    made = list(differentiate.run(mean, arm.joint("hand_roll"), harmonics=2))
    assert "harmonic 5 of the position is" in str(made[-1].text)


def predictions(signal, role, fitted, trajectories=(), **changes):
    made, about = fitted_to(trajectories), entry(name=signal.log, role=role, **changes)
    identified = [*fitted, *(r for r in made if isinstance(r, FittedPaths))]
    motions, own = [arm.motion(replace(signal, role=role))], [t for t in trajectories if t.log == signal.log]
    refits = [r for r in made if isinstance(r, CrossFit)]
    every = [
        *fit.apply(motions, own, refits, about, arm.ARM, lowpass=17.0),
        *predict.run(motions, identified, about, arm.ARM, lowpass=17.0, fit="chosen"),
    ]
    every = [r for r in every if not isinstance(r, PathShare)]
    return [r for r in every if not isinstance(r, Prediction) or r.model != "chosen"]


def path_new(signal, seen):
    """The share of a recording's path that none of the averages of other logs follows."""
    motion = arm.motion(signal)
    identified = Identified(arm.ARM, [r for r in fitted_to(seen) if isinstance(r, FittedPaths)])
    return identified.path_new(motion)


def fitted_to(trajectories, smoothed=()):
    return list(fit.run(trajectories, smoothed, arm.ARM, lowpass=17.0))


def test_a_validation_log_is_predicted_down_to_its_noise():
    fitted = fits(arm.signal())
    fresh = arm.signal(seed=9, period=7.3)
    [made, *_] = predictions(fresh, "validation", fitted.values())
    assert made.scheme == "validation"
    assert made.rmse == pytest.approx(arm.NOISE["hand_roll"], rel=0.05)
    assert made.r2 == pytest.approx(1 - made.rmse**2 / fresh.tau.var(), rel=1e-9)


def test_known_contacts_do_not_count_against_a_prediction():
    pushed = arm.signal(seed=9, external=lambda t: np.where((t > 20) & (t < 30), 5.0, 0.0))
    fitted = fits(arm.signal())
    [inside, *_] = predictions(pushed, "contact", fitted.values())
    [outside, *_] = predictions(pushed, "contact", fitted.values(), contact=((20.0, 30.0),))
    assert inside.rmse > 5 * outside.rmse
    assert outside.rmse == pytest.approx(arm.NOISE["hand_roll"], rel=0.05)


def test_an_identification_log_is_predicted_from_the_others_or_from_its_other_periods():
    a, b = arm.signal(seed=1, log="a"), arm.signal(seed=2, log="b")
    together = [trajectory(a), trajectory(b)]
    [by_log, *_] = predictions(a, "identification", [], together)
    [by_period, *_] = predictions(a, "identification", [], together[:1])
    assert (by_log.scheme, by_period.scheme) == ("leave one log out", "leave one period out")
    for made in (by_log, by_period):
        assert isinstance(made, Prediction)
        assert made.rmse == pytest.approx(arm.NOISE["hand_roll"], rel=0.05)


def refit_without(trajectories, *logs) -> np.ndarray:
    rest = [t for t in trajectories if t.log not in logs]
    return next(r for r in fitted_to(rest) if isinstance(r, Fit)).theta


def test_every_log_is_left_out_once_by_refits_to_all_the_others():
    every = [trajectory(arm.signal(seed=i, log=f"log-{i}", periods=4)) for i in range(3)]
    cross = next(r for r in fitted_to(every) if isinstance(r, CrossFit))
    for t in every:
        assert_allclose(cross.theta[cross.left_out == t.log], refit_without(every, t.log), rtol=1e-12)
    assert len(cross) == 3 * 4


def test_a_hundred_logs_are_left_out_five_at_a_time():
    assert folds(100) == [i // 5 for i in range(100)]


def test_many_logs_are_left_out_in_twenty_folds_of_neighbours():
    assert folds(20) == list(range(20))
    for count in (21, 45, 400):
        fold = np.array(folds(count))
        assert (np.diff(fold) >= 0).all()
        assert set(fold) == set(range(20))
        assert np.ptp(np.bincount(fold)) <= 1
    one = trajectory(arm.signal(periods=4, rate=20.0))
    every = [replace(one, log=f"log-{i}", tau=one.tau * (1 + 0.01 * i)) for i in range(30)]
    cross = next(r for r in fitted_to(every) if isinstance(r, CrossFit))
    assert list(dict.fromkeys(cross.left_out))[:3] == ["log-0, log-1", "log-2", "log-3, log-4"]
    assert_allclose(cross.theta[:4], refit_without(every, "log-0", "log-1"), rtol=1e-12)
    [made, *_] = predictions(arm.signal(log="log-4", rate=20.0), "identification", [], every)
    assert made.scheme == "leave 2 logs out"


def test_a_joint_is_fitted_anew_at_most_twenty_times_however_many_its_logs_are(monkeypatch):
    one = trajectory(arm.signal(periods=4, rate=20.0))
    calls = []
    monkeypatch.setattr(
        "davinci_forces.stages.model.fit.estimator", lambda name: lambda p: calls.append(name) or estimator(name)(p)
    )
    for logs in (20, 30, 60):
        calls.clear()
        fitted_to([replace(one, log=f"log-{i}", tau=one.tau * (1 + 0.01 * i)) for i in range(logs)])
        assert Counter(calls) == dict.fromkeys(ESTIMATORS, 1 + 20)


def test_a_log_that_no_refit_can_do_without_has_no_leave_out_score_and_it_is_said():
    """Only one of the logs holds periods enough for weights, and without the others' there are none."""
    every = [trajectory(arm.signal(seed=i, log=f"log-{i}", periods=p)) for i, p in enumerate((5, 3))]
    made = fitted_to(every)
    lse, wlse = (r for r in made if isinstance(r, CrossFit) and r.estimator in ("lse", "wlse"))
    assert (set(lse.left_out), set(wlse.left_out)) == ({"log-0", "log-1"}, {"log-1"})
    said = " ".join(text for r in made if isinstance(r, Diagnostic) for text in r.text)
    assert "hand_roll: wlse has no leave-out score of log-0, because a refit is not possible: weights need" in said
    kept = predictions(arm.signal(seed=0, log="log-0"), "identification", [], every)
    assert [r.estimator for r in kept] == [name for name in ESTIMATORS if name != "wlse"]


def test_a_recording_is_told_to_follow_a_path_that_was_fitted():
    fitted, seen = fits(arm.signal()), [trajectory(arm.signal(log="seen"))]
    again, other = arm.signal(seed=9, log="again"), arm.signal(seed=9, log="other", period=7.3)
    other = replace(other, q=other.q * np.cos(0.3 * other.t))
    for signal, path in ((again, "same path"), (other, "another path")):
        assert {r.path for r in predictions(signal, "validation", fitted.values(), seen)} == {path}


def test_the_path_of_a_fitted_log_is_new_only_where_no_other_fitted_log_follows_it():
    one, again, other = (arm.signal(seed=i, log=name) for i, name in enumerate(("one", "again", "other")))
    other = replace(other, q=other.q * np.cos(0.3 * other.t))
    assert path_new(one, [trajectory(one)]) == 1.0  # its own path tells nothing
    assert path_new(one, [trajectory(one), trajectory(again)]) < 0.01
    assert path_new(other, [trajectory(one), trajectory(again)]) > 0.1


@pytest.mark.parametrize("faster", [0.5, 2.0])
def test_the_speed_of_a_log_is_compared_with_that_of_the_fastest_fitted_one(faster):
    def scaled(by, **about):
        signal = arm.signal(**about)
        return replace(signal, q=by * signal.q, dq=by * signal.dq)

    fitted = [trajectory(scaled(by, seed=i, log=str(i))) for i, by in enumerate((1.0, 0.5))]
    identified = Identified(arm.ARM, [r for r in fitted_to(fitted) if isinstance(r, FittedPaths)])
    motion = arm.motion(scaled(faster, seed=9, log="other"))
    assert identified.speed_ratio(motion) == pytest.approx(faster, rel=0.02)
    if faster < 1.0:
        assert identified.share_outside(motion) == 0.0
    else:
        low, high = fitted[0].q.min(), fitted[0].q.max()
        margin = 0.05 * (high - low)
        beyond = np.mean((motion.q < low - margin) | (motion.q > high + margin))
        assert identified.share_outside(motion) == pytest.approx(beyond, abs=0.01)
        assert beyond > 0.2


def test_a_path_of_which_a_third_is_new_is_another():
    seen, signal = [trajectory(arm.signal(log="seen"))], arm.signal(seed=9, log="other")
    signal = replace(signal, q=signal.q + 0.7 * np.std(signal.q) * np.sqrt(2) * np.cos(3.7 * signal.t))
    identified = Identified(arm.ARM, [r for r in fitted_to(seen) if isinstance(r, FittedPaths)])
    assert identified.path_new(arm.motion(signal)) == pytest.approx(1 / 3, abs=0.05)
    assert identified.path(arm.motion(signal)) == ANOTHER_PATH


def test_of_many_fitted_paths_those_that_differ_most_are_kept_and_it_is_said_when_they_do_not_stand_for_all():
    one = trajectory(arm.signal(periods=4, rate=20.0))
    phase = 2 * np.pi * one.t / one.period

    def kept(paths: int) -> tuple[set[int], str]:
        every = [replace(one, log=f"log-{i}", q=np.sin((1 + i % paths) * phase)) for i in range(60)]
        model = independent(arm.joint("hand_roll"))
        made = list(fit.fitted_paths("hand_roll", [fit.periodic_part(model, t) for t in every]))
        [kept] = (r for r in made if isinstance(r, FittedPaths))
        logs = [int(log.removeprefix("log-")) % paths for log in dict.fromkeys(kept.source)]
        assert len(logs) == 20
        return set(logs), " ".join(text for r in made if isinstance(r, Diagnostic) for text in r.text)

    assert kept(15) == (set(range(15)), "")
    indices, said = kept(30)
    assert len(indices) == 20
    assert "hand_roll: its identification logs follow more than 20 paths" in said


def test_the_noise_of_a_joint_is_that_of_its_logs_together():
    every = [trajectory(arm.signal(seed=i, log=f"log-{i}", noise=noise)) for i, noise in enumerate((1.0, 3.0))]
    noise = next(r for r in fitted_to(every) if isinstance(r, MeasurementNoise))
    assert noise.sigma_tau == pytest.approx(arm.NOISE["hand_roll"] * np.sqrt(5), rel=0.05)
    assert noise.sigma_q == pytest.approx(1e-4 * np.sqrt(5), rel=0.05)


def test_a_period_that_differs_from_the_others_is_predicted_badly():
    """Otherwise what is left out would have been seen."""
    odd = arm.signal(seed=1, external=lambda t: np.where((t > 30) & (t < 40), 3.0 * np.sin(t), 0.0))
    [made, *_] = predictions(odd, "identification", [], [trajectory(odd)])
    bad = (made.t > 30) & (made.t < 40)
    errors = made.tau - made.tau_hat
    assert errors[bad].std() > 10 * errors[~bad].std()


def test_residuals_are_what_the_fit_leaves():
    made = fitted_to([trajectory(arm.signal())])
    lse = next(r for r in made if isinstance(r, Fit))
    residual = next(r for r in made if isinstance(r, Residual))
    assert np.mean((residual.tau - residual.tau_hat) ** 2) == pytest.approx(lse.mse)


def test_where_least_squares_are_not_possible_no_error_is_due_to_the_model(monkeypatch):
    def impossible(*_):
        raise np.linalg.LinAlgError

    seen, stds = [trajectory(arm.signal())], []
    for errors in (lambda *_: 0.0, impossible):
        monkeypatch.setattr(fit, "model_std", errors)
        stds.append({r.estimator: r.theta_std for r in fitted_to(seen) if isinstance(r, Fit)})
    assert stds[0].keys() == stds[1].keys() > {"lse", "wlse"}
    for name, std in stds[0].items():
        np.testing.assert_array_equal(std, stds[1][name], err_msg=name)


def test_a_guess_states_its_error_in_motion_with_its_standard_error():
    rng = np.random.default_rng(4)
    Phi, guess = rng.normal(size=(400, 2)), np.array([1.0, -2.0])
    tau = Phi @ guess + rng.normal(size=400)
    periods = np.repeat([4, 0], [360, 40])
    tau[periods == 0] += 100.0  # at standstill, which no fit counts either, friction is unknown
    regression = SimpleNamespace(Phi=Phi, tau=tau, periods=periods, known=SimpleNamespace(guess=guess))
    parameters = [Parameter(name, "", "N m", positive=False) for name in "ab"]
    [made] = fit.guesses(SimpleNamespace(group="roll", parameters=parameters), regression)
    assert made.mse == pytest.approx(1.0, abs=0.2)
    assert made.mse_std == pytest.approx(np.sqrt(2.0 / 360), rel=0.3)  # of squares of normal values
    [none] = [*fit.guesses(None, SimpleNamespace(known=SimpleNamespace(guess=None)))] or [None]
    assert none is None
