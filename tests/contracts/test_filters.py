"""Every filter, on a joint that is linear: there it has to be the batch solution, and as good as it says.

The model is that of (7.11)-(7.16): q and dq are measured, forward Euler steps them, and the external effort walks.
"""

from importlib import import_module

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.stats import chi2

from pipeline.filters import FILTERS
from pipeline.filters.problem import Filter, NoiseModel
from pipeline.maths.models.terms import inertia, offset, stiffness, viscous
from tests import arm

T_S = 0.01
TERMS, THETA = (inertia, viscous, stiffness, offset), np.array([0.5, 0.3, 2.0, 0.4])
FIRST_STD = 2.0  # of the external effort, before the first sample
NOISE = NoiseModel(r_q=1e-3, r_dq=8e-3, q_q=1e-5, q_dq=1e-4, q_tau=0.05)
SEEDS = 100

FILTER = pytest.mark.parametrize(
    "track", [import_module(f"pipeline.filters.{name}").track for name in FILTERS], ids=FILTERS
)


def transition() -> tuple[np.ndarray, np.ndarray]:
    """x[k+1] = F x[k] + B [tau[k], 1] of the state x = [q, dq, tau_ext]."""
    M, v, c, f = THETA
    F = np.array([[1, T_S, 0], [-T_S * c / M, 1 - T_S * v / M, -T_S / M], [0, 0, 1]])
    return F, np.array([[0, 0], [T_S / M, -T_S * f / M], [0, 0]])


def simulate(N: int, noise: NoiseModel, seed: int, walks=True) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """True states (N, 3), measurements (2, N) and effort (N,), with the noises that the filter is told of.

    The external effort starts as uncertain as the filter is told, unless it does not walk: it is then 0.7.
    """
    random, (F, B) = np.random.default_rng(seed), transition()
    tau = np.sin(3 * T_S * np.arange(N))
    x = np.empty((N, 3))
    x[0] = 0.1, -0.2, FIRST_STD * random.normal() if walks else 0.7
    w = random.normal(size=(N, 3)) * (noise.q_q, noise.q_dq, noise.q_tau if walks else 0.0)
    for k in range(N - 1):
        x[k + 1] = F @ x[k] + B @ (tau[k], 1.0) + w[k]
    return x, (x[:, :2] + random.normal(size=(N, 2)) * (noise.r_q, noise.r_dq)).T, tau


def batch(y: np.ndarray, tau: np.ndarray, noise: NoiseModel) -> tuple[np.ndarray, np.ndarray]:
    """The last state and its covariance, by weighted least squares on all measurements and steps at once.

    Nothing is known of the first position and velocity.
    """
    N, (F, B) = y.shape[1], transition()
    A, b = np.zeros((1 + 2 * N + 3 * (N - 1), 3 * N)), np.zeros(1 + 2 * N + 3 * (N - 1))
    A[0, 2] = 1 / FIRST_STD
    weights, steps = 1 / np.array(noise[:2]), 1 / np.array(noise[2:])
    for k in range(N):
        rows = slice(1 + 2 * k, 3 + 2 * k)
        A[rows, 3 * k : 3 * k + 2], b[rows] = np.diag(weights), weights * y[:, k]
    for k in range(N - 1):
        rows = slice(1 + 2 * N + 3 * k, 4 + 2 * N + 3 * k)
        A[rows, 3 * k : 3 * k + 6] = steps[:, None] * np.hstack([-F, np.eye(3)])
        b[rows] = steps * (B @ (tau[k], 1.0))
    scale = np.linalg.norm(A, axis=0)
    Q, R = np.linalg.qr(A / scale)
    root = np.linalg.inv(R)[-3:]
    return (root @ (Q.T @ b)) / scale[-3:], root @ root.T / np.outer(scale[-3:], scale[-3:])


@FILTER
@pytest.mark.parametrize("N", [1, 2, 3, 10, 40])
def test_the_last_state_is_the_batch_least_squares_estimate(track: Filter, N: int):
    # So fine an encoder that what a filter believes of the first position does not matter: a variance of one beside
    # the measurement's 1e-12 and 1e-10.
    noise = NoiseModel(r_q=1e-6, r_dq=1e-5, q_q=1e-7, q_dq=1e-6, q_tau=0.05)
    _, y, tau = simulate(N, noise, seed=N)
    made = track(arm.dynamics(TERMS, THETA, len(tau)), *y, tau, T_S, noise, FIRST_STD)
    state, covariance = batch(y, tau, noise)
    assert_allclose([made.q[-1], made.dq[-1]], state[:2], rtol=0, atol=1e-9)
    assert_allclose(made.tau_ext[-1], state[2], rtol=0, atol=1e-8 * FIRST_STD)
    assert made.tau_ext_std[-1] == pytest.approx(np.sqrt(covariance[2, 2]), rel=1e-8)


@FILTER
def test_innovations_are_as_large_as_stated(track: Filter):
    N, settled = 20_000, 10
    _, y, tau = simulate(N, NOISE, seed=0)
    nis = track(arm.dynamics(TERMS, THETA, len(tau)), *y, tau, T_S, NOISE, FIRST_STD).nis[settled:]
    low, high = chi2.interval(0.9999, 2 * len(nis))  # two measurements a sample, independent of those before
    assert low < nis.sum() < high


@FILTER
def test_errors_of_the_external_effort_are_as_large_as_stated(track: Filter):
    scores = []
    for seed in range(SEEDS):
        x, y, tau = simulate(150, NOISE, seed)
        made = track(arm.dynamics(TERMS, THETA, len(tau)), *y, tau, T_S, NOISE, FIRST_STD)
        scores.append((made.tau_ext[-1] - x[-1, 2]) / made.tau_ext_std[-1])
    # The standard error of a mean is 1/sqrt(n), that of a deviation 1/sqrt(2 n); four of each are let.
    assert np.mean(scores) == pytest.approx(0.0, abs=4 / np.sqrt(SEEDS))
    assert np.std(scores) == pytest.approx(1.0, abs=4 / np.sqrt(2 * SEEDS))


@FILTER
def test_a_constant_effort_that_no_sensor_measures_is_found_within_its_stated_deviation(track: Filter):
    steady = NOISE._replace(q_tau=1e-6)
    x, y, tau = simulate(3000, steady, seed=1, walks=False)
    made = track(arm.dynamics(TERMS, THETA, len(tau)), *y, tau, T_S, steady, FIRST_STD)
    assert made.tau_ext_std[-1] < 0.02 * x[-1, 2]
    assert abs(made.tau_ext[-1] - x[-1, 2]) < 4 * made.tau_ext_std[-1]


@FILTER
@pytest.mark.parametrize("pushed", [1.5, -1.5])
def test_the_external_effort_is_what_the_robot_exerts_on_its_environment(track: Filter, pushed: float):
    """A motor that pushes against a wall, and does not move for it, exerts its whole effort on the wall."""
    still = np.zeros(4000)
    made = track(arm.dynamics((inertia, viscous), THETA[:2], 4000), still, still, still + pushed, T_S, NOISE, FIRST_STD)
    # Forty seconds, and the filter forgets within a second what it believed at first.
    assert made.tau_ext[-1] == pytest.approx(pushed, abs=1e-6)


@FILTER
def test_what_the_joint_needs_itself_is_not_external(track: Filter):
    """The same joint held by its spring and its offset, free of the wall."""
    q = np.full(4000, 0.2)
    held = THETA[2] * q + THETA[3]
    made = track(arm.dynamics(TERMS, THETA, 4000), q, 0 * q, held, T_S, NOISE, FIRST_STD)
    assert made.tau_ext[-1] == pytest.approx(0.0, abs=1e-6)


@FILTER
@given(
    seed=st.integers(0, 2**32 - 1),
    M=st.floats(1e-4, 10),
    r_q=st.floats(1e-6, 1),
    r_dq=st.floats(1e-6, 1),
)
def test_variances_stay_positive_and_numbers_finite(track: Filter, seed: int, M: float, r_q: float, r_dq: float):
    random = np.random.default_rng(seed)
    y, tau = random.normal(size=(2, 200)), random.normal(size=200)
    noise = NoiseModel(r_q, r_dq, 0.0, 1e-6, 1e-3)
    made = track(arm.dynamics((inertia, viscous), np.array([M, 0.1]), 200), *y, tau, T_S, noise, 1.0)
    assert (made.tau_ext_std > 0).all()
    assert [column.shape for column in made] == [(200,)] * len(made)
    assert all(np.isfinite(column).all() for column in made)
