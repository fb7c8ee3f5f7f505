"""What an attached mass asks of the joints, against its potential energy and Newton's law along a motion."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.identification.loads import loads_per_kilogram
from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.contact.weighing import mirror_position, moved_with, unit_load
from davinci_forces.maths.mechanics.kinematics import frames, remote_centre, tip
from davinci_forces.robots import davinci, dvrk_psm

CHAINS = {"davinci": davinci.ROBOT.chain, "dvrk_psm": dvrk_psm.ROBOT.chain}
LINKS = [(name, link) for name, chain in CHAINS.items() for link in chain.links[:9]]
AT = np.array([0.03, -0.024, 0.35])


def place(chain, link, q):
    """Where the mass is (..., 3): carried along by the link from where it is at q = 0."""
    T = frames(chain, q)[..., chain.names.index(link), :, :]
    still = frames(chain, np.zeros(q.shape[-1]))[chain.names.index(link)]
    start = np.linalg.solve(still, np.append(remote_centre(chain) + AT, 1.0))
    return (T @ start)[..., :3]


def slopes(f, x, h=1e-5):
    """Central differences by each coordinate, stacked last."""
    return np.stack([(f(x + h * e) - f(x - h * e)) / (2 * h) for e in np.eye(x.shape[-1])], axis=-1)


@pytest.mark.parametrize(("name", "link"), LINKS)
def test_a_mass_at_rest_asks_for_the_slope_of_its_potential_energy(name, link):
    chain, still = CHAINS[name], np.zeros((20, 3))
    q = np.random.default_rng(1).uniform(-0.5, 0.5, (20, 3))
    slope = GRAVITY * slopes(lambda x: place(chain, link, x)[..., 2], q)
    assert_allclose(unit_load(chain, link, AT, q, still, still), slope, atol=1e-8)


@pytest.mark.parametrize(("name", "link"), LINKS)
def test_a_mass_that_is_carried_along_asks_for_its_weight_and_acceleration(name, link):
    """J' (a + g up), a by differences in time along a smooth motion."""
    chain, t, h = CHAINS[name], np.linspace(0.0, 3.0, 25), 1e-4
    size, rate = np.array([0.4, 0.3, 0.05]), np.array([2.0, 3.0, 5.0])

    def q(t):
        return size * np.sin(np.multiply.outer(t, rate) + 0.3)

    dq, ddq = size * rate * np.cos(np.multiply.outer(t, rate) + 0.3), -(rate**2) * q(t)
    before, here, after = (place(chain, link, q(t + d)) for d in (-h, 0.0, h))
    felt = (before - 2 * here + after) / h**2 + (0.0, 0.0, GRAVITY)
    J = slopes(lambda x: place(chain, link, x), q(t))
    assert_allclose(unit_load(chain, link, AT, q(t), dq, ddq), np.einsum("tik,ti->tk", J, felt), atol=2e-6)


@pytest.mark.parametrize("name", CHAINS)
def test_what_moves_with_the_pitch_turns_about_the_remote_centre(name):
    chain = CHAINS[name]
    link, q = moved_with(chain, 1), np.array([[0.0, 0.4, 0.0], [0.3, -0.5, 0.02]])
    distance = np.linalg.norm(place(chain, link, q) - remote_centre(chain), axis=-1)
    assert_allclose(distance, np.linalg.norm(AT))
    assert link == {"davinci": "5", "dvrk_psm": "end_link"}[name]


def test_a_parallel_bar_carries_a_mass_without_turning_it():
    """The bar keeps its direction under the pitch, so where on it the mass sits along it does not change the load."""
    chain, rng = CHAINS["dvrk_psm"], np.random.default_rng(2)
    q, dq, ddq = rng.uniform(-0.5, 0.5, (3, 10, 3))
    q[:, 0] = dq[:, 0] = ddq[:, 0] = 0.0
    one, other = (unit_load(chain, "upper_bar", (0.0, y, 0.1), q, dq, ddq)[:, 1] for y in (-0.3, 0.1))
    assert_allclose(one, other, atol=1e-12)
    turning = unit_load(chain, "end_link", (0.0, -0.3, 0.1), q, dq, ddq)[:, 1]
    assert np.abs(turning - one).max() > 0.1


def test_the_slide_carries_a_mass_on_the_carriage_and_none_on_the_end_link():
    chain, still = CHAINS["dvrk_psm"], np.zeros((1, 3))
    assert_allclose(unit_load(chain, moved_with(chain, 2), AT, still, still, still)[0, 2], -GRAVITY)
    assert_allclose(unit_load(chain, "end_link", AT, still, still, still)[0, 2], 0.0, atol=1e-12)


def test_the_other_side_of_a_link_is_as_high_and_as_far_out():
    assert_allclose(mirror_position(AT), [-0.03, 0.024, 0.35])


def test_a_coordinate_that_moves_nothing_towards_the_tip_carries_nothing():
    with pytest.raises(ValueError, match="coordinate 9 does not move"):
        moved_with(CHAINS["dvrk_psm"], 9)


@pytest.mark.parametrize("name", CHAINS)
def test_a_mass_without_a_place_hangs_at_the_tip(name):
    robot, still = {"davinci": davinci.ROBOT, "dvrk_psm": dvrk_psm.ROBOT}[name], np.zeros((20, 3))
    robot = replace(robot, joints=robot.joints[:3])
    q = np.random.default_rng(2).uniform(-0.5, 0.5, (20, 3))
    stated, _ = loads_per_kilogram(robot.chain, robot, "", None, (q, still, still))
    slope = GRAVITY * slopes(lambda x: tip(robot.chain, x)[..., 2], q)
    assert_allclose(stated, slope, atol=1e-8)
