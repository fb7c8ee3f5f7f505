"""The dynamics of the links, against a Lagrangian that shares nothing with them, and against their own laws."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.maths.mechanics import rigid_body
from pipeline.maths.mechanics.bodies import from_parameters
from pipeline.maths.mechanics.drives import Drives, seen_at_joint
from pipeline.robots.davinci_chain import BODIES, CHAIN, DRIVES
from tests.robot import thesis_matrices as thesis

SIZES = pytest.mark.parametrize("n", [3, 6, 7])


def motions(n: int, count: int = 100) -> np.ndarray:
    """q, dq and ddq (3, count, n)."""
    return np.random.default_rng(n).uniform(-1.5, 1.5, (3, count, n))


@SIZES
def test_mass_matrix_coriolis_and_gravity_are_those_of_an_independent_lagrangian(n):
    q, dq, _ = motions(n)
    np.testing.assert_allclose(rigid_body.mass_matrix(CHAIN, BODIES, q), thesis.mass(q), rtol=0, atol=1e-12)
    np.testing.assert_allclose(rigid_body.gravity(CHAIN, BODIES, q), thesis.gravity(q), rtol=0, atol=1e-12)
    np.testing.assert_allclose(rigid_body.coriolis(CHAIN, BODIES, q, dq), thesis.coriolis(q, dq), rtol=0, atol=1e-10)


@SIZES
def test_the_mass_matrix_is_symmetric_and_positive_definite(n):
    M = rigid_body.mass_matrix(CHAIN, BODIES, motions(n)[0])
    np.testing.assert_array_equal(M, M.swapaxes(1, 2))
    assert np.linalg.eigvalsh(M).min() > 1e-7  # the jaws' own inertia is 3e-7 kg m^2


@SIZES
def test_the_rate_of_the_mass_matrix_less_twice_coriolis_is_skew(n):
    q, dq, _ = motions(n)
    M_dot = np.einsum("nijk,nk->nij", thesis.gradient(lambda at: rigid_body.mass_matrix(CHAIN, BODIES, at), q), dq)
    S = M_dot - 2 * rigid_body.coriolis_matrix(CHAIN, BODIES, q, dq)
    np.testing.assert_allclose(S + S.swapaxes(1, 2), 0, atol=1e-12)


@SIZES
def test_the_coriolis_matrix_is_made_of_christoffel_s_symbols(n):
    q, dq, _ = motions(n, 20)
    dM = thesis.gradient(lambda at: rigid_body.mass_matrix(CHAIN, BODIES, at), q)
    symbols = (np.einsum("nijk->nijk", dM) + np.einsum("nikj->nijk", dM) - np.einsum("njki->nijk", dM)) / 2
    C = rigid_body.coriolis_matrix(CHAIN, BODIES, q, dq)
    np.testing.assert_allclose(C, np.einsum("nijk,nk->nij", symbols, dq), rtol=0, atol=1e-11)


@SIZES
def test_inverse_dynamics_is_the_sum_of_its_parts(n):
    q, dq, ddq = motions(n)
    M, C = rigid_body.mass_matrix(CHAIN, BODIES, q), rigid_body.coriolis_matrix(CHAIN, BODIES, q, dq)
    parts = (M @ ddq[..., None] + C @ dq[..., None])[..., 0] + rigid_body.gravity(CHAIN, BODIES, q)
    np.testing.assert_allclose(rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, ddq), parts, rtol=0, atol=1e-13)


@SIZES
def test_forward_dynamics_undoes_inverse_dynamics(n):
    q, dq, ddq = motions(n)
    drives = Drives(*np.random.default_rng(1).uniform(0.1, 2.0, (4, n)))
    tau = rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, ddq, drives)
    found = rigid_body.forward_dynamics(CHAIN, BODIES, q, dq, tau + 0.3, 0.3, drives)
    np.testing.assert_allclose(found, ddq, rtol=0, atol=1e-11)


def test_an_external_effort_is_what_the_arm_exerts_on_its_surroundings():
    q = np.array([0.1, 0.2, 0.03])
    held = rigid_body.gravity(CHAIN, BODIES, q)
    pushed = rigid_body.forward_dynamics(CHAIN, BODIES, q, 0 * q, held, np.array([0.0, 0.0, 1.0]))
    assert pushed[2] < 0  # pushing downwards, along +q3, it is pushed back


def test_the_arm_held_by_gravity_compensation_stays_where_it_is():
    q = motions(6)[0]
    ddq = rigid_body.forward_dynamics(CHAIN, BODIES, q, 0 * q, rigid_body.gravity(CHAIN, BODIES, q))
    np.testing.assert_allclose(ddq, 0, atol=1e-8)  # gravity rounds at 1e-15, over inertias of 3e-7


def test_an_arm_that_falls_freely_keeps_its_energy():
    q, dq = np.array([0.3, -0.4, 0.02]), np.array([0.5, 0.2, -0.1])

    def rates(_, x):
        return np.concatenate([x[3:], rigid_body.forward_dynamics(CHAIN, BODIES, x[:3], x[3:], np.zeros(3))])

    run = solve_ivp(rates, (0, 1), np.concatenate([q, dq]), method="DOP853", rtol=1e-11, atol=1e-12)
    total = sum(rigid_body.energy(CHAIN, BODIES, run.y[:3].T, run.y[3:].T))
    assert np.abs(total - total[0]).max() < 1e-9
    assert np.ptp(rigid_body.energy(CHAIN, BODIES, run.y[:3].T, run.y[3:].T).kinetic) > 1  # it did fall


def test_no_samples_give_no_results():
    none = np.zeros((3, 0, 6))
    assert rigid_body.inverse_dynamics(CHAIN, BODIES, *none).shape == (0, 6)
    assert rigid_body.mass_matrix(CHAIN, BODIES, none[0]).shape == (0, 6, 6)
    assert rigid_body.regressor(CHAIN, *none).shape == (0, 6, 100)


def test_power_is_the_rate_of_energy():
    q, dq, ddq = motions(6, 20)
    h = 1e-5
    ahead, behind = (
        sum(rigid_body.energy(CHAIN, BODIES, q + s * h * dq + h**2 / 2 * ddq, dq + s * h * ddq)) for s in (1, -1)
    )
    power = np.sum(rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, ddq) * dq, axis=1)
    np.testing.assert_allclose((ahead - behind) / (2 * h), power, rtol=1e-7, atol=1e-7)


@SIZES
def test_the_effort_is_linear_in_the_inertial_parameters(n):
    q, dq, ddq = motions(n)
    pi = np.random.default_rng(5).uniform(-1, 1, 100)
    bodies = from_parameters(pi, np.zeros(10, int))
    Y = rigid_body.regressor(CHAIN, q, dq, ddq)
    expected = rigid_body.inverse_dynamics(CHAIN, bodies, q, dq, ddq)
    np.testing.assert_allclose(Y @ pi, expected, rtol=0, atol=1e-11)


@SIZES
def test_base_parameters_give_the_same_effort_on_other_motions(n):
    base = rigid_body.base_parameters(rigid_body.regressor(CHAIN, *motions(n, 200)))
    other = np.random.default_rng(99).uniform(-2, 2, (3, 50, n))
    beta = base.combination @ BODIES.parameters(n)
    Y = rigid_body.regressor(CHAIN, *other)[..., base.columns]
    np.testing.assert_allclose(Y @ beta, rigid_body.inverse_dynamics(CHAIN, BODIES, *other), rtol=0, atol=1e-11)


def test_base_parameters_are_as_many_as_the_regressor_s_rank_and_well_conditioned():
    Y = rigid_body.regressor(CHAIN, *motions(3, 200))
    base = rigid_body.base_parameters(Y)
    assert len(base.columns) == np.linalg.matrix_rank(Y.reshape(-1, 100), rtol=1e-10)
    assert base.condition < 1e3
    np.testing.assert_array_equal(base.combination[:, base.columns], np.eye(len(base.columns)))
    assert "m of 6" in base.names(CHAIN.names[1:])


def test_parameters_and_bodies_are_two_ways_of_saying_the_same():
    again = from_parameters(BODIES.parameters(7), BODIES.counts_from)
    np.testing.assert_allclose(again.masses, BODIES.masses)
    np.testing.assert_allclose(again.centres[1:], BODIES.centres[1:], atol=1e-15)
    np.testing.assert_allclose(again.inertias, BODIES.inertias, atol=1e-15)


def test_the_second_jaw_counts_with_the_seventh_coordinate_only():
    slide = [rigid_body.mass_matrix(CHAIN, BODIES, np.zeros(n))[2, 2] for n in (3, 6, 7)]
    np.testing.assert_allclose(slide, [0.208, 0.208, 0.218])


def test_masses_known_badly_scale_every_effort_alike():
    q, dq, ddq = motions(6, 5)
    np.testing.assert_allclose(
        rigid_body.inverse_dynamics(CHAIN, BODIES.scaled(0.9), q, dq, ddq),
        0.9 * rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, ddq),
    )


def test_drives_add_reflected_inertia_and_friction():
    drives = Drives(np.array([200.0, 200, 1340]), np.full(3, 1e-6), DRIVES.viscous[:3], DRIVES.coulomb[:3])
    q, dq, ddq = motions(3, 5)
    tau = rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, ddq, drives)
    bare = rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, ddq)
    expected = np.array([0.04, 0.04, 1.7956]) * ddq + [1.0, 1.0, 1.0] * dq + [1.0, 0.1, 3.0] * np.sign(dq)
    np.testing.assert_allclose(tau - bare, expected, rtol=1e-12)
    M = rigid_body.mass_matrix(CHAIN, BODIES, q, drives) - rigid_body.mass_matrix(CHAIN, BODIES, q)
    np.testing.assert_allclose(M, np.broadcast_to(np.diag([0.04, 0.04, 1.7956]), M.shape), atol=1e-12)
    np.testing.assert_allclose(drives.motor_effort([200.0, 0, 1340]), [1, 0, 1])


def test_the_motor_s_friction_is_felt_at_the_joint_through_the_gear():
    viscous, coulomb = seen_at_joint([200.0, -10.0], 1e-5, 0.01)
    np.testing.assert_allclose(viscous, [0.4, 1e-3])
    np.testing.assert_allclose(coulomb, [2.0, 0.1])
