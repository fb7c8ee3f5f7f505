"""The dynamics of the links, against a Lagrangian that shares nothing with them, and against their own laws."""

from dataclasses import replace

import numpy as np
import pytest

import davinci_forces
from davinci_forces.errors import BadRobot
from davinci_forces.maths.mechanics import rigid_body
from davinci_forces.maths.mechanics.bodies import Bodies, Drives
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.robots import dvrk_psm
from davinci_forces.robots.davinci import BODIES, CHAIN, DRIVES, ROBOT, in_table_frames
from tests.robot import lagrangian
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


def test_no_samples_give_no_results():
    none = np.zeros((3, 0, 6))
    assert rigid_body.inverse_dynamics(CHAIN, BODIES, *none).shape == (0, 6)
    assert rigid_body.mass_matrix(CHAIN, BODIES, none[0]).shape == (0, 6, 6)
    assert rigid_body.regressor(CHAIN, *none).shape == (0, 6, 90)


@SIZES
def test_the_effort_is_linear_in_the_inertial_parameters(n):
    q, dq, ddq = motions(n)
    pi = np.random.default_rng(5).uniform(-1, 1, 90)
    bodies = lagrangian.from_parameters(pi)
    Y = rigid_body.regressor(CHAIN, q, dq, ddq)
    expected = rigid_body.inverse_dynamics(CHAIN, bodies, q, dq, ddq)
    np.testing.assert_allclose(Y @ pi, expected, rtol=0, atol=1e-11)


def test_the_second_jaw_counts_with_the_seventh_coordinate_only():
    slide = [rigid_body.mass_matrix(CHAIN, BODIES, np.zeros(n))[2, 2] for n in (3, 6, 7)]
    np.testing.assert_allclose(slide, [0.208, 0.208, 0.218])


def test_masses_known_badly_scale_every_effort_alike():
    q, dq, ddq = motions(6, 5)
    np.testing.assert_allclose(
        rigid_body.inverse_dynamics(CHAIN, BODIES.with_density_factor(0.9), q, dq, ddq),
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


@SIZES
def test_inverse_dynamics_is_the_sum_of_its_parts(n):
    q, dq, ddq = motions(n)
    inertial = (rigid_body.mass_matrix(CHAIN, BODIES, q) @ ddq[..., None])[..., 0]
    parts = inertial + rigid_body.coriolis(CHAIN, BODIES, q, dq) + rigid_body.gravity(CHAIN, BODIES, q)
    np.testing.assert_allclose(rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, ddq), parts, rtol=0, atol=1e-13)


def branching(seed: int = 7) -> Chain:
    """A chain that no table describes: placements at random, of links that share coordinates, branch and slide."""
    random = np.random.default_rng(seed)
    parent = np.array([0, 1, 2, 2, 4, 0, 6])
    placement = np.tile(np.eye(4), (7, 1, 1))
    placement[:, :3, :3] = np.linalg.qr(random.normal(size=(7, 3, 3)))[0]
    placement[:, :3, :3] *= np.linalg.det(placement[:, :3, :3])[:, None, None]
    placement[:, :3, 3] = random.uniform(-0.5, 0.5, (7, 3))
    names = tuple("abcdefg")
    return Chain(
        links=names, parent=parent, placement=placement, slides=np.array([0, 1, 0, 0, 1, 0, 0], bool),
        coordinate=np.array([0, 1, 2, 1, 3, 2, 0]), names=("0", *names), body=np.arange(8),
        offset=np.tile(np.eye(4), (8, 1, 1)), before=np.append(0, parent), tip="g", n=4,
    )  # fmt: skip


# A coordinate may turn one link and slide another: c and b of `branching` share the second one.
OTHERS = {
    "dvrk": (dvrk_psm.PSM_CHAIN, lagrangian.random_bodies(11)),
    "placements": (branching(), lagrangian.random_bodies(7)),
}


@pytest.mark.parametrize(("chain", "bodies", "n"), [(*OTHERS[k], n) for k, n in
    (("dvrk", 3), ("dvrk", 5), ("dvrk", 6), ("placements", 2), ("placements", 4))])  # fmt: skip
def test_any_chain_has_the_dynamics_of_its_lagrangian(chain: Chain, bodies: Bodies, n: int):
    q, dq, ddq = motions(n, 40)
    M, G = lagrangian.mass(chain, bodies, q), lagrangian.gravity(chain, bodies, q)
    V = lagrangian.coriolis(chain, bodies, q, dq)
    size = np.abs(V).max() + np.abs(G).max()
    np.testing.assert_allclose(rigid_body.mass_matrix(chain, bodies, q), M, rtol=0, atol=1e-13 * np.abs(M).max())
    np.testing.assert_allclose(rigid_body.gravity(chain, bodies, q), G, rtol=0, atol=1e-11 * size)
    np.testing.assert_allclose(rigid_body.coriolis(chain, bodies, q, dq), V, rtol=0, atol=1e-10 * size)
    tau = (M @ ddq[..., None])[..., 0] + V + G
    Y = rigid_body.regressor(chain, q, dq, ddq)
    np.testing.assert_allclose(Y @ bodies.parameters(n), tau, rtol=0, atol=1e-10 * np.abs(tau).max())


@SIZES
def test_power_is_the_rate_of_energy(n):
    q, dq, ddq = motions(n, 20)
    h = 1e-5

    def energy(s: float) -> np.ndarray:
        at, rates = q + s * h * dq + h**2 / 2 * ddq, dq + s * h * ddq
        return lagrangian.kinetic(CHAIN, BODIES, at, rates) + lagrangian.potential(CHAIN, BODIES, at)

    power = np.sum(rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, ddq) * dq, axis=1)
    np.testing.assert_allclose((energy(1) - energy(-1)) / (2 * h), power, rtol=1e-7, atol=1e-7)


def test_bodies_are_the_same_in_whatever_frames_they_are_given():
    given = in_table_frames()
    np.testing.assert_allclose(BODIES.masses, given.masses)
    for i, T in enumerate(CHAIN.of_links):
        np.testing.assert_allclose(T @ np.append(given.centres[i], 1.0), np.append(BODIES.centres[i], 1.0), atol=1e-16)
        R = T[:3, :3]
        np.testing.assert_allclose(R.T @ BODIES.inertias[i] @ R, given.inertias[i], atol=1e-15)


def test_parameters_and_bodies_are_two_ways_of_saying_the_same():
    again = lagrangian.from_parameters(BODIES.parameters(7))
    np.testing.assert_allclose(again.masses, BODIES.masses)
    np.testing.assert_allclose(again.centres, BODIES.centres, atol=1e-15)
    np.testing.assert_allclose(again.inertias, BODIES.inertias, atol=1e-15)


def test_forward_dynamics_inverts_inverse_dynamics():
    q, dq, ddq = motions(6)
    tau = rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, ddq)
    np.testing.assert_allclose(rigid_body.forward_dynamics(CHAIN, BODIES, q, dq, tau), ddq, rtol=0, atol=1e-6)


@SIZES
def test_the_coriolis_matrix_makes_the_derivative_of_m_less_twice_it_skew(n):
    q, dq, _ = motions(n, 20)
    C, h = rigid_body.coriolis_matrix(CHAIN, BODIES, q, dq), 1e-5
    np.testing.assert_allclose(
        np.einsum("sij,sj->si", C, dq), rigid_body.coriolis(CHAIN, BODIES, q, dq), rtol=0, atol=1e-12
    )
    ahead, behind = (rigid_body.mass_matrix(CHAIN, BODIES, q + sign * h * dq) for sign in (1, -1))
    S = (ahead - behind) / (2 * h) - 2 * C
    np.testing.assert_allclose(S, -S.swapaxes(1, 2), rtol=0, atol=1e-8)


def test_power_in_is_the_growth_of_energy_on_a_turned_base():
    arm = ROBOT.with_base((0.3, -0.4, 0.5))
    q, dq, tau = motions(3, 50)
    ddq, h = arm.forward_dynamics(q, dq, tau), 1e-5
    ahead, behind = (sum(arm.energy(q + s * dq + s**2 / 2 * ddq, dq + s * ddq)) for s in (h, -h))
    np.testing.assert_allclose((ahead - behind) / (2 * h), (tau * dq).sum(-1), rtol=0, atol=1e-6)


def test_potential_energy_rises_by_the_effort_that_holds_the_arm():
    q = motions(6, 20)[0]
    for i in range(6):
        step = 1e-5 * np.eye(6)[i]
        rise = ROBOT.energy(q + step, q)[1] - ROBOT.energy(q - step, q)[1]
        np.testing.assert_allclose(rise / 2e-5, ROBOT.gravity(q)[:, i], rtol=0, atol=1e-6)


def test_a_robot_says_what_it_does_not_know():
    with pytest.raises(BadRobot, match="geometry is not known"):
        replace(ROBOT, chain=None).tip([0, 0, 0])
    with pytest.raises(BadRobot, match="masses of its links are not known"):
        davinci_forces.robot("dvrk_psm").gravity([0, 0, 0])
