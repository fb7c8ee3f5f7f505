"""Friction: its levels, and the bristles that give way before they slide."""

import numpy as np
import pytest

from davinci_forces.maths.simulation.step import Friction, bristle, level

ONE = np.ones(1)


def friction(**changes: float) -> Friction:
    values = {
        "viscous": 0.5, "coulomb_up": 2.0, "coulomb_down": 1.5, "static_up": 3.0, "static_down": 2.5,
        "stribeck_velocity": 0.1, "bristle_stiffness": 1000.0, "bristle_damping": 0.0,
    }  # fmt: skip
    return Friction(**{name: value * ONE for name, value in {**values, **changes}.items()})


def test_friction_falls_from_the_static_to_the_coulomb_level_and_differs_by_direction():
    assert level(friction(), 0, 0.0) == 3.0
    assert level(friction(), 0, -1e-12) == pytest.approx(2.5)
    assert level(friction(), 0, 0.1) == pytest.approx(2.0 + 1.0 * np.exp(-1))
    assert level(friction(), 0, 10.0) == pytest.approx(2.0)
    assert level(friction(), 0, -10.0) == pytest.approx(1.5)


def test_steady_sliding_adds_the_viscous_part():
    assert steady(friction(), 0, np.array([-10.0, 10.0])) == pytest.approx([-1.5 - 5.0, 2.0 + 5.0])


def steady(friction: Friction, i: int, v: np.ndarray) -> np.ndarray:
    """The effort (K,) that keeps joint i sliding at constant velocities v (K,) that are not zero.  Fig 6.21"""
    return np.array([level(friction, i, x) * np.sign(x) + friction.viscous[i] * x for x in v.tolist()])


def slide(what: Friction, velocity: float, time: float, z: float = 0.0, h: float = 1e-4) -> tuple[float, float]:
    """Effort and deflection after sliding at a constant velocity."""
    effort = 0.0
    for _ in range(round(time / h)):
        constant, slope, decay = bristle(what, 0, velocity, z, h)
        effort = constant + slope * velocity
        z = (z + h * velocity) / decay
    return effort, z


@pytest.mark.parametrize("velocity", [-3.0, -0.01, 0.01, 0.05, 3.0])
def test_bristles_that_slide_steadily_push_with_the_level_of_their_velocity(velocity):
    effort, z = slide(friction(), velocity, 10.0)  # thirty time constants of the slowest
    assert effort == pytest.approx(level(friction(), 0, velocity) * np.sign(velocity), rel=1e-9)
    assert z == pytest.approx(effort / 1000.0, rel=1e-9)


def test_a_short_way_is_elastic_with_the_bristles_stiffness():
    way = 1e-5  # of a breakaway deflection of 3e-3: the spring is softened by way / 3e-3, a third of a per cent
    effort, _ = slide(friction(), 0.01, way / 0.01, h=1e-6)
    assert effort == pytest.approx(1000.0 * way, rel=5e-3)


def test_going_to_and_fro_costs_energy():
    what, z, work, h = friction(), 0.0, 0.0, 1e-4
    for velocity in (0.1 * np.cos(2 * np.pi * np.arange(0, 4, h))).tolist():
        constant, slope, decay = bristle(what, 0, velocity, z, h)
        work += (constant + slope * velocity) * velocity * h
        z = (z + h * velocity) / decay
    way = 4 * 0.2 / np.pi  # four periods of amplitude 0.1 / (2 pi)
    assert 1.5 * way < work < 3.0 * way  # between the least and the greatest level


@pytest.mark.parametrize("stiffness", [1.0, 1e4, 1e12])
def test_bristles_of_any_stiffness_stay_below_the_static_level(stiffness):
    what = friction(bristle_stiffness=stiffness)
    for velocity in (-1.0, 1e-3, 1.0):
        effort, _ = slide(what, velocity, 0.05, h=1e-3)
        assert abs(effort) <= 3.0 * (1 + 1e-12)
