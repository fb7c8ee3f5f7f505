"""Every filter: what is external and what is not, and numbers that stay numbers.

Those that state a model of chance, on a joint that is linear in its state: there each is the batch solution, and as
good as it says.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.stats import chi2, multivariate_normal

from davinci_forces.filters import FILTERS, diverges, filter_parts, kalman, title, tracker
from davinci_forces.filters.problem import Filter, FilterInput, LongInput, NoiseModel
from davinci_forces.filters.sample import INITIAL_VARIANCE_RATIO
from davinci_forces.maths import arrays
from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.models.model import JointDynamics
from davinci_forces.maths.models.terms import inertia, offset, stiffness, viscous
from tests import arm

T_S = 0.01
TERMS, THETA = (inertia, viscous, stiffness, offset), np.array([0.5, 0.3, 2.0, 0.4])
FIRST_STD = 2.0  # of the external effort, before the first sample
NOISE = NoiseModel(r_q=1e-3, r_dq=8e-3, q_q=1e-5, q_dq=1e-4, q_tau=0.05)
SEEDS = 100

FILTER = pytest.mark.parametrize("track", [tracker(name) for name in FILTERS], ids=FILTERS)
STEPPED = pytest.mark.parametrize("name", ["ekf", "ekf_euler"])
STATED = pytest.mark.parametrize("name", ["ekf", "ekf_euler", "rts"])  # of the model of chance that is simulated


def recording(joint: JointDynamics, q, dq, tau, initial_std=FIRST_STD) -> FilterInput:
    """What a filter is given of a joint whose acceleration nobody measured."""
    return FilterInput(joint, q, dq, np.zeros(len(q)), tau, T_S, initial_std)


def swaying(N: int) -> JointDynamics:
    """A joint whose inertia others change as they move, and whose motor holds a known effort of theirs."""
    joint = arm.dynamics(TERMS, THETA, N)
    t = T_S * np.arange(N)
    return joint._replace(inertia=joint.inertia * (1 + 0.4 * np.sin(2 * t)), known=0.8 * np.cos(5 * t))


def transition(joint: JointDynamics, k: int, tau: float, name: str) -> tuple[np.ndarray, np.ndarray]:
    """F and u of x[k+1] = F x[k] + u, with the state x = [q, dq, tau_ext], of first or of second order in T_s."""
    M, (_, v, c, f) = joint.inertia[k], THETA
    A = np.array([[0, 1, 0], [-c / M, -v / M, -1 / M], [0, 0, 0]])
    h = 0.0 if name == "ekf_euler" else 0.5 * T_S**2
    driven = np.array([0, (tau - joint.known[k] - f) / M, 0])
    return np.eye(3) + T_S * A + h * A @ A, (T_S * np.eye(3) + h * A) @ driven


def process(noise: NoiseModel, name: str) -> np.ndarray:
    """Q: of second order, what an acceleration adds to the velocity it adds to the position, half a sample long."""
    if name == "ekf_euler":
        return np.diag(np.square(noise[2:]))
    along = np.array([0.5 * T_S, 1.0, 0.0]) * noise.q_dq
    return np.outer(along, along) + np.diag([noise.q_q**2, 0.0, noise.q_tau**2])


def simulate(N: int, noise: NoiseModel, seed: int, name="ekf", walks=True):
    """True states (N, 3), measurements (2, N) and effort (N,), with the noises that the filter is told of.

    The external effort starts as uncertain as the filter is told, unless it does not walk: it is then 0.7.
    """
    random, joint = np.random.default_rng(seed), swaying(N)
    tau = np.sin(3 * T_S * np.arange(N))
    x = np.empty((N, 3))
    x[0] = 0.1, -0.2, FIRST_STD * random.normal() if walks else 0.7
    root = np.linalg.cholesky(process(noise, name) + 1e-30 * np.eye(3))
    w = random.normal(size=(N, 3)) @ root.T * (1.0, 1.0, float(walks))
    for k in range(N - 1):
        F, u = transition(joint, k, tau[k], name)
        x[k + 1] = F @ x[k] + u + w[k]
    return x, (x[:, :2] + random.normal(size=(N, 2)) * (noise.r_q, noise.r_dq)).T, tau


def batch(y: np.ndarray, tau: np.ndarray, noise: NoiseModel, name: str) -> tuple[np.ndarray, np.ndarray]:
    """All states (N, 3) and their deviations (N, 3), by weighted least squares on all measurements and steps at once.

    Of the first position and velocity is known what is measured, hardly.
    """
    N, joint = y.shape[1], swaying(y.shape[1])
    A, b = np.zeros((3 + 2 * N + 3 * (N - 1), 3 * N)), np.zeros(3 + 2 * N + 3 * (N - 1))
    A[:3, :3] = np.diag([*(1 / np.array(noise[:2]) / np.sqrt(INITIAL_VARIANCE_RATIO)), 1 / FIRST_STD])
    b[:2] = A[[0, 1], [0, 1]] * y[:, 0]
    weights, steps = 1 / np.array(noise[:2]), np.linalg.inv(np.linalg.cholesky(process(noise, name)))
    for k in range(N):
        rows = slice(3 + 2 * k, 5 + 2 * k)
        A[rows, 3 * k : 3 * k + 2], b[rows] = np.diag(weights), weights * y[:, k]
    for k in range(N - 1):
        rows, (F, u) = slice(3 + 2 * N + 3 * k, 6 + 2 * N + 3 * k), transition(joint, k, tau[k], name)
        A[rows, 3 * k : 3 * k + 6] = steps @ np.hstack([-F, np.eye(3)])
        b[rows] = steps @ u
    scale = np.linalg.norm(A, axis=0)
    Q, R = np.linalg.qr(A / scale)
    root = np.linalg.inv(R) / scale[:, None]
    return (root @ (Q.T @ b)).reshape(N, 3), np.linalg.norm(root, axis=1).reshape(N, 3)


FINE = NoiseModel(r_q=1e-6, r_dq=1e-5, q_q=1e-7, q_dq=1e-6, q_tau=0.05)


@STEPPED
@pytest.mark.parametrize("N", [1, 2, 3, 10, 40])
def test_the_last_state_is_the_batch_least_squares_estimate(name: str, N: int):
    _, y, tau = simulate(N, FINE, seed=N, name=name)
    made = tracker(name)(recording(swaying(N), *y, tau), FINE)
    states, deviations = batch(y, tau, FINE, name)
    assert_allclose([made.q[-1], made.dq[-1]], states[-1, :2], rtol=0, atol=1e-9)
    assert_allclose(made.tau_ext[-1], states[-1, 2], rtol=0, atol=1e-8 * FIRST_STD)
    assert made.tau_ext_std[-1] == pytest.approx(deviations[-1, 2], rel=1e-8)


@pytest.mark.parametrize("N", [1, 2, 3, 10, 40])
def test_every_smoothed_state_is_the_batch_least_squares_estimate(N: int):
    _, y, tau = simulate(N, FINE, seed=N)
    made = tracker("rts")(recording(swaying(N), *y, tau), FINE)
    states, deviations = batch(y, tau, FINE, "rts")
    assert_allclose(np.transpose([made.q, made.dq]), states[:, :2], rtol=0, atol=1e-9)
    assert_allclose(made.tau_ext, states[:, 2], rtol=0, atol=1e-8 * FIRST_STD)
    # A variance of 4 before anything is measured, less all but 10^-7 of it: seven digits, and what P costs beside.
    assert_allclose(made.tau_ext_std, deviations[:, 2], rtol=1e-4)


def textbook(y: np.ndarray, tau: np.ndarray, model: kalman.States) -> tuple[np.ndarray, float]:
    """tau_ext, its deviation and both innovations (4, N) of a filter in matrices, and the log-likelihood."""
    n, joint, total, rows = len(model.x), swaying(y.shape[1]), 0.0, []
    x, P, H = np.array(model.x), model.P, np.zeros((2, n))
    H[0, list(model.in_q)] = H[1, list(model.in_dq)] = 1.0
    for k in range(y.shape[1]):
        i, S = y[:, k] - H @ x, H @ P @ H.T + np.diag(model.R)
        K = np.linalg.solve(S, H @ P).T
        total += multivariate_normal.logpdf(i, cov=S)
        x, P = x + K @ i, (np.eye(n) - K @ H) @ P @ (np.eye(n) - K @ H).T + K @ np.diag(model.R) @ K.T
        rows.append([x[2], np.sqrt(P[2, 2]), *i])
        F, (of_motion, u) = model.Phi.copy(), transition(joint, k, tau[k], "ekf_euler" if model.order == 1 else "ekf")
        F[:2, :3] = of_motion[:2]
        F[1, 3:] = -0.5 * T_S * (model.order - 1) / joint.inertia[k] * model.Phi[2, 3:]
        x, P = F @ x + np.append(u, np.zeros(n - 3)), F @ P @ F.T + model.Q
    return np.transpose(rows), total


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("n", [3, 4, 5])
def test_the_filter_of_any_number_of_states_is_the_textbooks(n: int, order: int):
    _, y, tau = simulate(300, NOISE, seed=1)
    run = recording(swaying(300), *y, tau)
    model = kalman.states(run, NOISE, n)._replace(order=order)
    if n > 3:
        model.Phi[2:, 2:] += np.triu(np.linspace(-0.1, 0.02, (n - 2) ** 2).reshape(n - 2, n - 2))
        model.P[3:, 3:], model.Q[3:, 3:] = 0.5 * np.eye(n - 3), 1e-3 * np.eye(n - 3)
    if n > 4:
        model = model._replace(in_q=(0, 3), in_dq=(1, 4), R=0.5 * model.R)
    [(_, made)], (expected, total) = kalman.run_blocks(run, model), textbook(y, tau, model)
    assert_allclose(made[2:6], expected, rtol=1e-6, atol=1e-9)
    assert kalman.log_likelihood(run, model, 0) == pytest.approx(total, rel=1e-8)


@STEPPED
def test_innovations_are_as_large_as_stated(name: str):
    N, settled = 20_000, 10
    _, y, tau = simulate(N, NOISE, 0, name)
    nis = tracker(name)(recording(swaying(N), *y, tau), NOISE).nis[settled:]
    low, high = chi2.interval(0.9999, 2 * len(nis))  # two measurements a sample, independent of those before
    assert low < nis.sum() < high


@STATED
def test_errors_of_the_external_effort_are_as_large_as_stated(name: str):
    scores, at = [], 75
    for seed in range(SEEDS):
        x, y, tau = simulate(150, NOISE, seed, name)
        made = tracker(name)(recording(swaying(150), *y, tau), NOISE)
        scores.append((made.tau_ext[at] - x[at, 2]) / made.tau_ext_std[at])
    # The standard error of a mean is 1/sqrt(n), that of a deviation 1/sqrt(2 n); four of each are let.
    assert np.mean(scores) == pytest.approx(0.0, abs=4 / np.sqrt(SEEDS))
    assert np.std(scores) == pytest.approx(1.0, abs=4 / np.sqrt(2 * SEEDS))


@STATED
def test_a_constant_effort_that_no_sensor_measures_is_found_within_its_stated_deviation(name: str):
    steady = NOISE._replace(q_tau=1e-6)
    x, y, tau = simulate(3000, steady, seed=1, name=name, walks=False)
    made = tracker(name)(recording(swaying(3000), *y, tau), steady)
    assert made.tau_ext_std[-1] < 0.02 * x[-1, 2]
    assert abs(made.tau_ext[-1] - x[-1, 2]) < 4 * made.tau_ext_std[-1]


def ramp_error(name: str) -> float:
    """By how much an external effort that rises by 1 a second is missed in the end, position and velocity exact."""
    t = T_S * np.arange(4000)
    still = np.zeros(len(t))
    joint = arm.dynamics((inertia, viscous), THETA[:2], len(t))
    return float((tracker(name)(recording(joint, still, still, t), NOISE).tau_ext - t)[-1])


def test_a_ramp_is_followed_only_by_the_filter_that_has_its_rate_and_by_the_smoother():
    assert ramp_error("ekf") < -0.01
    assert ramp_error("momentum") < -0.01
    # The motor holds its effort over a sample, in which the external effort goes on rising: half a sample is missed.
    assert ramp_error("rate") == pytest.approx(-0.5 * T_S, rel=0.05)
    t = T_S * np.arange(4000)
    still, joint = np.zeros(len(t)), arm.dynamics((inertia, viscous), THETA[:2], len(t))
    smooth = tracker("rts")(recording(joint, still, still, t), NOISE).tau_ext
    assert smooth[2000] == pytest.approx(t[2000], abs=1e-6)  # as much behind as ahead


def test_the_rates_own_walk_is_as_large_as_stated():
    """A rate that gains q_tau / T_s a sample, on a joint at rest that its motor holds against it."""
    N, scores, joint = 400, [], arm.dynamics((inertia, viscous), THETA[:2], 400)
    step = NOISE.q_tau / T_S * 0.02
    noise = NOISE._replace(q_tau=0.02 * NOISE.q_tau)
    for seed in range(SEEDS):
        random = np.random.default_rng(seed)
        rate = np.cumsum(step * random.normal(size=N)) + FIRST_STD * random.normal()
        tau_ext = np.cumsum(rate) * T_S
        y = random.normal(size=(2, N)) * [[noise.r_q], [noise.r_dq]]
        made = tracker("rate")(recording(joint, *y, tau_ext), noise)
        scores.append((made.tau_ext[-1] - tau_ext[-1]) / made.tau_ext_std[-1])
    assert np.std(scores) == pytest.approx(1.0, abs=4 / np.sqrt(2 * SEEDS))


def test_the_momentum_observers_deviation_is_that_of_its_noise():
    N, joint = 40_000, arm.dynamics((inertia, viscous), THETA[:2], 40_000)
    noise, random = NOISE._replace(q_dq=2e-3), np.random.default_rng(0)
    effort = THETA[0] * noise.q_dq / T_S * random.normal(size=N)
    made = tracker("momentum")(recording(joint, np.zeros(N), noise.r_dq * random.normal(size=N), effort), noise)
    # The viscous effort of the velocity's noise is small beside that of the effort.
    assert made.tau_ext[1000:].std() == pytest.approx(made.tau_ext_std[-1], rel=0.05)


def with_presliding(joint: JointDynamics) -> JointDynamics:
    """A joint whose presliding friction is a part of its known effort, here of none: no filter adds it again."""
    return joint._replace(coefficients=(*joint.coefficients[:6], 5.0))


def test_the_momentum_observers_deviation_is_exact_for_noise_of_the_effort_alone():
    """Of a first-order lag over white noise, over so many samples that its deviation is known to half a per cent."""
    N = 400_000
    noise, joint = NOISE._replace(q_dq=2e-3, r_dq=1e-9, q_tau=0.02), arm.dynamics((inertia,), THETA[:1], N)
    effort = THETA[0] * noise.q_dq / T_S * np.random.default_rng(1).standard_normal(N)
    made = tracker("momentum")(recording(joint, np.zeros(N), np.zeros(N), effort), noise)
    assert made.tau_ext[1000:].std() == pytest.approx(made.tau_ext_std[-1], rel=0.015)


def test_the_momentum_observer_takes_the_sign_of_a_slow_velocity_as_it_is():
    joint, theta = arm.joint("hand_roll"), arm.THETA["hand_roll"]
    q, dq = 0.003 * T_S * np.arange(300), np.full(300, 0.003)
    tau = regressor(joint.terms, q, dq, np.zeros(300)) @ theta
    made = tracker("momentum")(recording(with_presliding(arm.dynamics(joint.terms, theta, 300)), q, dq, tau), NOISE)
    assert_allclose(made.tau_ext, 0.0, atol=1e-12)


def test_measurement_noise_that_grows_is_noticed_only_by_the_filter_that_adapts():
    """Of a velocity whose noise grows tenfold halfway, its innovations stay as large as it says."""
    N, random, joint = 8000, np.random.default_rng(0), arm.dynamics((inertia, viscous), THETA[:2], 8000)
    louder = np.where(np.arange(N) < N // 2, 1.0, 10.0)
    y = random.normal(size=N) * NOISE.r_q, random.normal(size=N) * NOISE.r_dq * louder
    late = slice(N // 2 + 1000, None)
    adapting, other = (tracker(name)(recording(joint, *y, np.zeros(N)), NOISE).nis for name in ("ekf_adaptive", "ekf"))
    assert adapting[late].mean() == pytest.approx(2.0, abs=0.15)
    assert other[late].mean() > 10.0


def test_every_filter_says_what_a_report_calls_it():
    assert len({title(name) for name in FILTERS}) == len(FILTERS)


@FILTER
@pytest.mark.parametrize("pushed", [1.5, -1.5])
def test_the_external_effort_is_what_the_robot_exerts_on_its_environment(track: Filter, pushed: float):
    """A motor that pushes against a wall, and does not move for it, exerts its whole effort on the wall."""
    still = np.zeros(4000)
    joint = arm.dynamics((inertia, viscous), THETA[:2], 4000)
    made = track(recording(joint, still, still, still + pushed), NOISE)
    # Forty seconds, and the filter forgets within a second what it believed at first.
    assert made.tau_ext[-1] == pytest.approx(pushed, abs=1e-6)


@FILTER
def test_what_the_joint_needs_itself_is_not_external(track: Filter):
    """The same joint held by its spring and its offset, free of the wall."""
    q = np.full(4000, 0.2)
    held = THETA[2] * q + THETA[3]
    made = track(recording(arm.dynamics(TERMS, THETA, 4000), q, 0 * q, held), NOISE)
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
    made = track(recording(arm.dynamics((inertia, viscous), np.array([M, 0.1]), 200), *y, tau, 1.0), noise)
    assert (made.tau_ext_std > 0).all()
    assert [column.shape for column in made] == [(200,)] * len(made)
    assert all(np.isfinite(column).all() for column in made)


def test_without_noise_measured_minus_model_is_what_was_exerted_however_slow_the_joint_is():
    joint, theta = arm.joint("hand_roll"), arm.THETA["hand_roll"]
    q, dq, ddq = arm.excitation("hand_roll", T_S * np.arange(1000))
    tau = regressor(joint.terms, q, dq, ddq) @ theta + 0.3
    exact = FilterInput(with_presliding(arm.dynamics(joint.terms, theta, 1000)), q, dq, ddq, tau, T_S, FIRST_STD)
    tracked = tracker("direct")(exact, NOISE)
    assert_allclose(tracked.tau_ext, 0.3, atol=1e-12)
    assert_allclose(tracked.tau_ext_std, theta[0] * NOISE.q_dq / T_S)  # of an effort that errs like this acceleration


def test_noise_that_doubles_is_followed_with_the_time_constant_of_the_window():
    """C = 4 - 3 exp(-t / 1 s) in units of the noise before, and squared innovations 4 / C of what they should be."""
    N, step, late = 1600, 1000, 0.5
    joint = arm.dynamics(TERMS, THETA, N)
    quiet = NoiseModel(r_q=1e-3, r_dq=8e-3, q_q=0.0, q_dq=1e-6, q_tau=1e-5)
    tau, size, nis = np.full(N, THETA[-1]), np.where(np.arange(N) < step, 1.0, 2.0), []
    at = slice(step + round(late / T_S) - 5, step + round(late / T_S) + 6)
    for seed in range(SEEDS):
        noise = size * np.random.default_rng(seed).standard_normal((2, N))
        measured = recording(joint, quiet.r_q * noise[0], quiet.r_dq * noise[1], tau, initial_std=1e-3)
        nis.append(tracker("ekf_adaptive")(measured, quiet).nis[at].mean())
    assert np.mean(nis) / 2.0 == pytest.approx(4.0 / (4.0 - 3.0 * np.exp(-late)), rel=0.06)


@pytest.mark.parametrize(("share", "diverging"), [(0.8, False), (1.2, True)])
def test_a_filter_diverges_where_two_squared_innovations_are_beyond_a_multiple_of_the_two_they_should_be(
    share, diverging
):
    assert diverges(np.ones(50), 2.0 * 50.0 * share) == diverging
    assert diverges(np.where(np.arange(50) == 7, np.nan, 1.0), 2.0)


@pytest.mark.parametrize("name", FILTERS)
def test_a_filter_gives_the_same_bits_in_blocks_as_over_the_whole(monkeypatch, name: str):
    """Of a recording at 1 kHz, in four blocks of which the last is shorter."""
    rng, t, noise = np.random.default_rng(1), np.arange(3500) / 1000.0, NoiseModel(1e-4, 1e-3, 0.0, 1e-2, 0.05)
    q, dq, ddq = np.sin(t), np.cos(t), -np.sin(t)
    mass, known = 0.4 + 0.1 * np.sin(3.0 * t), 0.2 * np.cos(t)
    tau = mass * ddq + 0.3 * dq + 0.2 * np.sign(dq) + known + 0.1 * rng.normal(size=len(t))
    joint = JointDynamics(mass, (0.0, 0.01, 0.0, 0.0, 0.3, 0.2, 0.0), known)
    measured = q + 1e-4 * rng.normal(size=len(t)), dq + 1e-3 * rng.normal(size=len(t))
    whole = FilterInput(joint, *measured, ddq, tau, 1e-3, 0.1)
    tracked = tracker(name)(whole, noise)
    monkeypatch.setattr(arrays, "BLOCK_SAMPLES", 1000)
    long = LongInput(whole.samples, whole.T_s, whole.initial_std, whole.part)
    for column, expected in zip(filter_parts(name, [long], noise), tracked, strict=True):
        np.testing.assert_array_equal(column, expected)
