"""Parameters that a mechanism can have: least squares' own where these exist, else the nearest, and at what cost."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import minimize, nnls

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators import estimator
from davinci_forces.estimators.problem import Prior
from davinci_forces.maths.estimation import conic
from davinci_forces.maths.estimation.conic import ENTRIES, nearest, scale_unknowns
from davinci_forces.maths.estimation.least_squares import triangle
from davinci_forces.maths.mechanics.bodies import of_pseudo_inertias, pseudo_inertias
from davinci_forces.maths.models.model import ArmMotion, Mechanism, of_signs
from davinci_forces.records import Diagnostic, Fit, Motion
from davinci_forces.robots.dvrk_psm import ROBOT
from davinci_forces.robots.models import coupled_arm
from davinci_forces.stages.model import choose, fit
from tests import arm
from tests.contracts.test_estimators import NAMES, PHI, THETA, K, problem
from tests.test_estimation import trajectory

ARM = coupled_arm(ROBOT, [0, 1, 2], [(), (), ()])
RATE, N = 100.0, 3000


def wandering(seed=0) -> ArmMotion:
    """A motion of all joints through their range that tells all base parameters."""
    t, rng = np.arange(N) / RATE, np.random.default_rng(seed)
    w, phase = rng.uniform(0.5, 6.0, (2, 3, 5))
    size = np.array([0.5, 0.5, 0.04])[:, None] / 5
    angle = w[None] * t[:, None, None] + phase
    q, dq, ddq = ((size * x).sum(axis=2) for x in (np.sin(angle), w * np.cos(angle), -(w**2) * np.sin(angle)))
    return ArmMotion(q, dq, ddq, 1.0 / RATE, np.zeros(N, np.int64))


def real_bodies(seed=0) -> np.ndarray:
    """x of the arm: links that are clouds of points, and drives, cables and friction that exist."""
    rng, L = np.random.default_rng(seed), len(ARM.chain.links)
    points, masses = rng.normal(0.0, 0.1, (L, 8, 3)) + rng.normal(0.0, 0.1, (L, 1, 3)), rng.uniform(0.05, 0.3, (L, 8))
    one = np.concatenate([points, np.ones((L, 8, 1))], axis=2)
    links = of_pseudo_inertias(np.einsum("lk,lki,lkj->lij", masses, one, one))
    return np.r_[links.ravel(), rng.uniform(0.05, 0.2, 9), rng.uniform(0.1, 0.5, 6)]


def pose(theta: np.ndarray, noise=0.0, seed=0):
    """The triangle of the arm's efforts with parameters (p,), and its rows."""
    Phi = ARM.regressor(wandering()).Phi.reshape(3 * N, -1)
    tau = Phi @ theta + noise * np.random.default_rng(seed).normal(size=len(Phi))
    return triangle(Phi, tau, np.ones(len(tau))), Phi, tau


def smallest_eigenvalue(x: np.ndarray) -> float:
    """Of every link's pseudo-inertia, as a share of its largest."""
    L = ARM.mechanism.links
    values = np.linalg.eigvalsh(pseudo_inertias(x[: 10 * L].reshape(L, 10)))
    return float((values[:, 0] / np.maximum(values[:, -1], 1e-300)).min())


def impossible() -> np.ndarray:
    """Parameters that no arm has: the pitch's inertia is negative."""
    x = real_bodies()
    theta = ARM.mechanism.matrix @ x
    wrong = next(i for i, p in enumerate(ARM.parameters) if p.name == "Ixx of back_link")
    theta[wrong] = -2.0 * theta[wrong]
    return theta


# What there is to know


def test_the_parameters_of_a_model_are_made_of_its_links_drives_and_friction():
    """By the effort of bodies that weigh something, link by link."""
    x, motion, mechanism = real_bodies(), wandering(), ARM.mechanism
    L = mechanism.links
    from davinci_forces.maths.mechanics.rigid_body import regressor

    links = regressor(ARM.chain, *motion[:3])[:, :3] @ x[: 10 * L]
    rotor, spring, offset = x[10 * L : 10 * L + 9].reshape(3, 3)
    viscous, coulomb = x[10 * L + 9 :].reshape(3, 2).T
    added = rotor * motion.ddq + spring * motion.q + offset + viscous * motion.dq + coulomb * np.sign(motion.dq)
    tau = np.einsum("nmp,p->nm", ARM.regressor(motion).Phi, mechanism.matrix @ x)
    assert_allclose(tau, links + added, atol=1e-10)
    assert mechanism.positive[10 * L :].tolist() == [True] * 6 + [False] * 3 + [True] * 6
    assert not mechanism.positive[: 10 * L].any()


def test_of_a_joint_without_bodies_signs_are_known():
    from davinci_forces.robots.models import independent

    mechanism = independent(arm.joint("hand_roll")).mechanism
    assert_array_equal(mechanism.matrix, np.eye(4))
    assert mechanism.positive.tolist() == [True, False, True, True]
    assert not mechanism.links


# Where least squares can exist


@pytest.mark.parametrize("seed", range(3))
def test_bodies_that_exist_come_out_and_equal_least_squares(seed):
    theta = ARM.mechanism.matrix @ real_bodies(seed)
    R, Phi, tau = pose(theta, 1e-7, seed)
    made = nearest(R, ARM.mechanism)
    for other in (R.theta, theta):  # each parameter by what it makes of the effort, and all together
        assert np.linalg.norm(Phi @ (made.theta - other)) < 1e-6 * np.linalg.norm(tau)
        assert np.linalg.norm((made.theta - other) * R.scale) < 1e-6 * np.linalg.cond(R.U) * np.linalg.norm(tau)
    assert made.excess < 1e-12
    assert smallest_eigenvalue(made.x) >= -1e-9


def test_where_no_sign_is_wrong_consistent_parameters_are_least_squares_to_the_bit():
    p = replace(problem(seed=1), known=Prior(np.array([True, False, True, True])))
    assert_array_equal(estimator("consistent")(p).theta, estimator("lse")(p).theta)


# Where they cannot


def test_no_link_is_impossible_where_least_squares_find_one_that_is():
    theta = impossible()
    R, Phi, tau = pose(theta, 1e-3)
    made, mechanism = nearest(R, ARM.mechanism), ARM.mechanism
    assert made.excess > 1e-4  # they cannot be had for nothing
    assert smallest_eigenvalue(made.x) >= -1e-9
    assert (made.x[mechanism.positive] >= 0).all()
    assert_allclose(made.theta, mechanism.matrix @ made.x)
    after, before = (np.linalg.norm(tau - Phi @ x) for x in (made.theta, R.theta))
    assert made.excess == pytest.approx((after**2 - before**2) / np.linalg.norm(tau) ** 2, rel=1e-6)


@pytest.mark.parametrize("noise", [1e-3, 1.0])
def test_the_arm_is_the_nearest_by_the_conditions_of_karush_kuhn_and_tucker(noise):
    """The gradient by each pseudo-inertia is a positive semidefinite matrix at right angles to it."""
    R, *_ = pose(impossible(), noise)
    mechanism, size = ARM.mechanism, np.sqrt(R.y @ R.y + R.min_squares)
    made = nearest(R, mechanism)
    F = (R.U * R.scale) @ mechanism.matrix
    cones = scale_unknowns(F, mechanism)
    z = np.linalg.lstsq(cones.scale.toarray()[:, cones.seen], made.x / size, rcond=None)[0]
    gradient = (F @ cones.scale)[:, cones.seen].T @ (F @ made.x - R.y) / size  # by unknowns of about one size
    for link in range(cones.links):
        own = slice(10 * link, 10 * link + 10)
        Z, J = matrix(gradient[own]), matrix(z[own])
        assert np.linalg.eigvalsh(Z).min() > -1e-6
        assert abs(np.sum(Z * J)) < 1e-6
        assert np.linalg.eigvalsh(J).min() >= -1e-9 * np.linalg.eigvalsh(J).max()
    rest = np.arange(10 * cones.links, len(z))
    held = np.isin(rest, cones.positive)
    assert_allclose(gradient[rest[~held]], 0.0, atol=1e-7)
    assert (gradient[rest[held]] > -1e-7).all()
    assert_allclose(gradient[rest[held]] * z[rest[held]], 0.0, atol=1e-7)


def matrix(entries: np.ndarray) -> np.ndarray:
    """The symmetric matrix of the solver's entries: <A, B> is the product of both."""
    out = np.zeros((4, 4))
    for k, (i, j) in enumerate(ENTRIES):
        out[i, j] = out[j, i] = entries[k] / (1.0 if i == j else np.sqrt(2.0))
    return out


@pytest.mark.parametrize("seed", range(4))
def test_one_link_is_the_same_as_by_descent_over_its_square_root(seed):
    """J = C C' with nothing held back, by SLSQP from several starts: no cone, no solver of ours."""
    rng = np.random.default_rng(seed)
    Phi, tau = rng.normal(size=(40, 10)), rng.normal(size=40)
    made = nearest(triangle(Phi, tau, np.ones(40)), Mechanism(np.eye(10), 1, np.zeros(10, bool)))
    rows, columns = np.tril_indices(4)

    def squares(c):
        C = np.zeros((4, 4))
        C[rows, columns] = c
        return float(np.sum((tau - Phi @ of_pseudo_inertias((C @ C.T)[None])[0]) ** 2))

    tries = (minimize(squares, rng.normal(size=10), method="SLSQP", options={"maxiter": 2000, "ftol": 1e-14}).fun
             for _ in range(8))  # fmt: skip
    assert float(np.sum((tau - Phi @ made.theta) ** 2)) == pytest.approx(min(tries), rel=1e-6)
    assert made.excess > 1e-3


def test_signs_alone_are_non_negative_least_squares():
    p = replace(problem(seed=1), tau=PHI @ np.array([-0.05, 0.0103, -0.2, 0.21968]), known=Prior(np.ones(4, bool)))
    found, free = (estimator(name)(p) for name in ("consistent", "lse"))
    assert_allclose(found.theta, nnls(PHI, p.tau)[0], atol=1e-6)
    assert found.theta[0] == found.theta[2] == 0.0  # a bound that holds is met exactly
    assert (found.theta >= 0).all()
    assert (free.theta < 0).any()


def test_the_stated_errors_are_those_of_least_squares():
    p = replace(problem(seed=1), known=Prior(np.ones(4, bool)))
    p = replace(p, tau=p.tau - PHI @ (THETA * [2.0, 0.0, 0.0, 0.0]))
    found, free = (estimator(name)(p) for name in ("consistent", "lse"))
    assert free.theta[0] < 0 <= found.theta[0]
    assert_array_equal(found.theta_std, free.theta_std)


def test_a_scale_of_the_effort_scales_the_parameters_and_nothing_else():
    R, Phi, tau = pose(impossible(), 1e-3)
    other = triangle(Phi, 1e-3 * tau, np.ones(len(tau)))
    one, small = (nearest(each, ARM.mechanism).theta for each in (R, other))
    assert np.linalg.norm(Phi @ (one - 1e3 * small)) < 1e-6 * np.linalg.norm(tau)


def test_held_parameters_are_no_further_from_the_truth_than_free_ones():
    """The truth being a real arm's; measured in effort, in which they are nearest."""
    theta = ARM.mechanism.matrix @ real_bodies(1)
    for seed in range(5):
        R, Phi, _ = pose(theta, 1.0, seed)
        made = nearest(R, ARM.mechanism)
        off, free = (np.linalg.norm(Phi @ (x - theta)) for x in (made.theta, R.theta))
        assert off <= free * (1 + 1e-6)
        assert made.excess > 0


def test_what_the_solver_does_not_reach_is_refused_with_how_far_it_came(monkeypatch):
    def hasty(tolerance):
        settings = careful(tolerance)
        settings.max_iter = 2
        return settings

    careful = conic.settings
    monkeypatch.setattr(conic, "settings", hasty)
    R, *_ = pose(impossible(), 1e-3)
    with pytest.raises(NotIdentifiable, match=r"the conic program was not solved \(MaxIterations after 2 steps\)"):
        nearest(R, ARM.mechanism)


def test_links_may_miss_parameters_by_a_small_part_of_their_errors_and_by_no_more():
    A, wrong = ARM.mechanism.matrix, impossible()
    possible = nearest(pose(wrong)[0], ARM.mechanism).theta
    theta, price = possible + 1e-4 * (wrong - possible), np.ones(A.shape[1] - 10 * ARM.mechanism.links)
    links = conic.complete(theta, np.full(len(theta), 1e-3), ARM.mechanism, price, None)
    assert 1e-6 < np.abs(A @ links - theta).max() < 0.01 * 1e-3
    for std in (1e-4, np.nan):
        with pytest.raises(NotIdentifiable, match="no links were found that have these parameters"):
            conic.complete(theta, np.full(len(theta), std), ARM.mechanism, price, None)


# The stages


def smoothed(tau: np.ndarray) -> list[Motion]:
    """The records of a log in which the three joints move so."""
    motion = wandering()
    about = dict.fromkeys(("sigma_q", "sigma_dq", "sigma_tau"), 1e-4) | {"log": "one", "rate": RATE, "at_rest": 0}
    about |= {"role": "identification", "velocity": "logged", "cutoff": 17.0, "effort_lag": 0.0}
    t, segment = np.arange(N) / RATE, np.zeros(N, int)
    return [
        Motion(joint=joint.name, t=t, q=motion.q[:, i], dq=motion.dq[:, i], ddq=motion.ddq[:, i], tau=tau[:, i],
               q_measured=motion.q[:, i], dq_measured=motion.dq[:, i], segment=segment, standing=segment,
               filled=segment, **about)
        for i, joint in enumerate(ROBOT.joints[:3])
    ]  # fmt: skip


@pytest.fixture(scope="module")
def chosen():
    tau = np.einsum("nmp,p->nm", ARM.regressor(wandering()).Phi, impossible())
    tau = tau + 1e-3 * np.random.default_rng(0).normal(size=tau.shape)
    return list(choose.run(smoothed(tau), [], ROBOT, fit="coupled.consistent", lowpass=17.0))


def test_the_arm_has_a_fit_of_its_own_by_this_estimator(chosen):
    fits = {(r.group, r.model, r.estimator): r for r in chosen if isinstance(r, Fit)}
    for group, model, how in list(fits):
        if model != "independent":
            assert (group, model, "consistent") in fits, (group, model, how)
    held, free = fits["arm", "coupled", "consistent"], fits["arm", "coupled", "ridge"]
    assert held.mse > free.mse
    assert_array_equal(held.theta_std, free.theta_std)
    assert [p for p in held.published() if p.key.startswith("fit.arm.coupled.consistent.ixx_of_back_link")]


def test_what_it_costs_the_arm_is_said_joint_by_joint(chosen):
    said = [text for r in chosen if isinstance(r, Diagnostic) for text in r.text]
    (text,) = [text for text in said if text.startswith("arm: no mechanism has the parameters of the fit coupled.r")]
    for joint in ROBOT.joints[:3]:
        assert re.search(rf"[\d.]+ N( m)? of {joint.name} \([+-][\d.e+-]+ %\)", text)


def test_what_it_costs_a_joint_is_said_where_least_squares_find_what_no_mechanism_has():
    signal = arm.signal("hand_roll")
    theta = np.array([-0.2, *THETA[1:]])
    q, dq, ddq = arm.excitation("hand_roll", signal.t)
    from davinci_forces.maths.models.independent import regressor

    tau = regressor(arm.joint("hand_roll").terms, q, dq, ddq) @ theta
    noise = 0.01 * np.random.default_rng(0).normal(size=len(tau))
    made = list(fit.run([trajectory(replace(signal, tau=tau + noise))], [], arm.ARM, lowpass=17.0))
    fits = {r.estimator: r for r in made if isinstance(r, Fit)}
    said = [text for r in made if isinstance(r, Diagnostic) for text in r.text]
    (text,) = [text for text in said if "lse estimates a negative inertia, which no mechanism has" in text]
    for name in ("consistent", "lse"):
        assert f"{np.sqrt(fits[name].mse):.3g}" in text
    plain = fit.run([trajectory(signal)], [], arm.ARM, lowpass=17.0)
    assert not [t for r in plain if isinstance(r, Diagnostic) for t in r.text if "no mechanism" in t]


def test_signs_that_a_joint_does_not_know_are_not_held():
    made = nearest(triangle(PHI, -PHI @ THETA, np.ones(K)), of_signs(np.zeros(len(NAMES), bool)))
    assert_allclose(made.theta, -THETA, atol=1e-9)
