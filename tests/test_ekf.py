"""The extended Kalman filter on joints with friction and gravity, its stage, and the tests of whiteness."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipeline.errors import PipelineError
from pipeline.filters import ekf
from pipeline.filters.problem import NoiseModel
from pipeline.maths.models.bias import bias
from pipeline.maths.models.independent import combined, inertia_of
from pipeline.records import Diagnostic, Fit, MeasurementNoise, Track, Whiteness
from pipeline.stages import ekf as stage
from pipeline.stages import fit, whiteness
from tests import arm
from tests.test_averaging import entry
from tests.test_estimation import trajectory

T_S = 0.01
NOISE = NoiseModel(r_q=1e-3, r_dq=8e-3, q_q=1e-5, q_dq=1e-4, q_tau=0.05)


def simulate(used, theta, tau_ext, tau, noise, seed=0, x=(0.1, -0.2)):
    """Measurements of the model as it is printed: forward Euler, with the noises that the filter assumes."""
    rng, (q, dq), rows = np.random.default_rng(seed), x, []
    M, c = inertia_of(used, theta), combined(used, theta)
    for k in range(len(tau)):
        rows.append((q + noise.r_q * rng.normal(), dq + noise.r_dq * rng.normal()))
        acceleration = (tau[k] - bias(c, q, dq, 0.0)[0] - tau_ext[k]) / M
        w_q, w_dq = rng.normal(size=2) * (noise.q_q, noise.q_dq)
        q, dq = q + T_S * dq + w_q, dq + T_S * acceleration + w_dq
    return np.array(rows).T


def walk(N, step, seed=1):
    return np.cumsum(step * np.random.default_rng(seed).normal(size=N))


@pytest.mark.parametrize("name", arm.THETA)
def test_innovations_of_a_matched_model_are_white_and_as_large_as_stated(name):
    used, theta = arm.joint(name).terms, arm.THETA[name].copy()
    theta[-1] = 0.0  # Coulomb friction jumps at reversals, where no linearisation holds
    N = 6000
    t = np.arange(N) * T_S
    tau_ext = walk(N, NOISE.q_tau)
    tau = tau_ext + 3 * inertia_of(used, theta) * np.sin(2 * t) + combined(used, theta)[0]
    y = simulate(used, theta, tau_ext, tau, NOISE)
    made = ekf.track(arm.dynamics(used, theta, N), *y, tau, T_S, NOISE, first_std=1.0)
    kept = slice(200, None)
    assert made.nis[kept].mean() == pytest.approx(2.0, abs=4 * 2 / np.sqrt(N - 200))
    for x, r in ((made.innovation_q[kept], NOISE.r_q), (made.innovation_dq[kept], NOISE.r_dq)):
        found = whiteness.statistics(x)
        assert found["ljung_box_p"] > 1e-3
        assert x.std() >= 0.99 * r
    errors = (made.tau_ext - tau_ext)[kept] / made.tau_ext_std[kept]
    assert errors.std() == pytest.approx(1.0, abs=0.2)


def test_a_mass_hung_on_the_slide_gives_a_negative_effort():
    """(7.8) makes tau_ext what the robot exerts on the environment: it holds the mass up, against gravity."""
    used, theta = arm.joint("instrument_slide").terms, arm.THETA["instrument_slide"]
    N, weight = 4000, 0.097 * 9.81
    t = np.arange(N) * T_S
    drive = 4.5 * np.sin(3 * t)
    held = -theta[0] * 9.81 - weight  # gravity pulls the slide along +q
    y = simulate(used, theta, np.full(N, -weight), drive + held, NOISE)
    made = ekf.track(arm.dynamics(used, theta, N), *y, drive + held, T_S, NOISE, first_std=5.0)
    assert made.tau_ext[1000:].mean() == pytest.approx(-weight, abs=0.05)


def test_the_loop_is_the_same_compiled_and_as_it_is_written():
    used, theta = arm.joint("hand_pitch").terms, arm.THETA["hand_pitch"]
    signal = arm.signal("hand_pitch", periods=2)
    told = arm.dynamics(used, theta, len(signal))
    compiled = ekf.track(told, signal.q, signal.dq, signal.tau, T_S, NOISE, 1.0)
    written = np.empty((7, len(signal)))
    motion = (told.inertia, signal.q, signal.dq, signal.tau)
    ekf._pass.py_func(told.coefficients, *motion, T_S, *NOISE, 1.0, ekf.FIRST, *written)
    for a, b in zip(compiled, written, strict=True):
        assert_allclose(a, b, rtol=1e-12, atol=1e-12 * np.abs(a).max())


@pytest.fixture(scope="module")
def identified():
    signal = arm.signal()
    made = list(fit.run([trajectory(signal)], [], arm.ARM, lowpass=17.0))
    return [r for r in made if isinstance(r, Fit)], [r for r in made if isinstance(r, MeasurementNoise)]


def tracked(identified, signal, **changes):
    fits, noises = identified
    made = stage.run(
        [signal], fits, [], noises, entry(role=signal.role, **changes), arm.ARM,
        fit=changes.pop("fit", "independent.lse"), lowpass=17.0, q_tau=0.0,
    )  # fmt: skip
    return list(made)


def test_the_stage_finds_a_push_where_it_was(identified):
    pushed = arm.signal(seed=5, period=7.3, role="contact", external=lambda t: np.where((t > 20) & (t < 30), 1.0, 0.0))
    [made] = tracked(identified, pushed, contact=((20.0, 30.0),))
    assert isinstance(made, Track)
    inside = (made.t > 21) & (made.t < 29)
    assert made.tau_ext[inside].mean() == pytest.approx(1.0, abs=0.1)
    assert made.tau_ext_rms < 0.2
    assert np.corrcoef(made.tau_ext_direct, made.tau_ext)[0, 1] > 0.8


def test_the_filter_takes_its_noise_from_the_periods(identified):
    [made] = tracked(identified, arm.signal(seed=5))
    assert made.r_q == pytest.approx(1e-4, rel=0.05)
    assert made.r_dq == pytest.approx(1e-3, rel=0.05)
    ddq = arm.excitation("hand_roll", made.t)[2]
    assert made.q_q == pytest.approx(0.5e-4 * np.sqrt(np.mean(ddq**2)), rel=0.05)
    driven = 0.01 * arm.NOISE["hand_roll"] / arm.THETA["hand_roll"][0]
    assert made.q_dq == pytest.approx(driven, rel=0.1)


def test_a_gap_starts_the_filter_anew(identified):
    signal = arm.signal(seed=5)
    object.__setattr__(signal, "segment", (signal.t > 50).astype(int))
    [made] = tracked(identified, signal)
    first = np.flatnonzero(signal.t > 50)[0]
    assert made.tau_ext_std[first] > 1.5 * made.tau_ext_std[first - 1]


def test_a_joint_without_a_fit_is_noted_not_guessed(identified):
    [made] = tracked(identified, arm.signal("hand_pitch"))
    assert isinstance(made, Diagnostic)
    assert "no identification log moves this joint" in made.text[0]


def test_a_fit_that_does_not_exist_is_refused_with_those_there_are(identified):
    says = "no fit 'coupled.pso'; set fit in [settings] to one of independent.lse, "
    fits, noises = identified
    run = stage.run(
        [arm.signal()], fits, [], noises, entry(), arm.ARM, fit="coupled.pso", lowpass=17.0, q_tau=0.0
    )  # fmt: skip
    with pytest.raises(PipelineError, match=re.escape(says)):
        list(run)


def test_white_noise_is_called_white_as_often_as_the_level_says():
    calls = [whiteness.statistics(np.random.default_rng(s).normal(size=500))["white"] for s in range(400)]
    rejected = 400 - sum(calls)
    assert rejected < 4 + 4 * np.sqrt(400 * 0.01 * 0.99)


def test_the_ljung_box_statistic_is_that_of_statsmodels_own_test():
    from statsmodels.stats.diagnostic import acorr_ljungbox

    x = walk(400, 1.0) * 0.1 + np.random.default_rng(3).normal(size=400)
    own, table = whiteness.statistics(x), acorr_ljungbox(x, lags=[20])
    assert own["ljung_box"] == pytest.approx(table["lb_stat"].iloc[0], rel=1e-9)
    assert own["ljung_box_p"] == pytest.approx(table["lb_pvalue"].iloc[0], rel=1e-9)


def test_a_walk_and_a_constant_are_not_called_white():
    walked = whiteness.statistics(walk(1000, 1.0))
    assert walked["white"] == 0
    assert walked["acf1"] > 0.9
    assert whiteness.statistics(np.ones(1000))["white"] == 0


def test_a_track_is_white_only_when_all_its_innovations_are(identified):
    [track] = tracked(identified, arm.signal(seed=5))
    object.__setattr__(track, "innovation_q", np.random.default_rng(0).normal(size=len(track)))
    object.__setattr__(track, "innovation_dq", walk(len(track), 1.0))
    q, dq = whiteness.run(track)
    assert isinstance(q, Whiteness)
    assert (q.white, dq.white, q.all_white, dq.all_white) == (1, 0, 0, 0)
