"""Friction over velocity: what the rest of a model leaves of the effort, in both directions and on both branches."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.signals.velocity_map import over_velocity
from davinci_forces.records import Fit, FrictionMap, Signal
from davinci_forces.stages.model import choose, fit
from tests import arm
from tests.test_estimation import trajectory

T = np.arange(2000) / 200.0


def charts(signal: Signal, fitted: Signal, role: str = "identification") -> list[FrictionMap]:
    fits = [r for r in fit.run([trajectory(fitted)], [], arm.ARM, lowpass=17.0) if isinstance(r, Fit)]
    return list(choose.apply(arm.motion(replace(signal, role=role)), fits, arm.ARM, lowpass=17.0))


def test_means_are_those_of_the_samples_in_a_range_and_on_a_branch():
    dq, ddq = np.sin(T), np.cos(T)
    found = over_velocity(dq, ddq, np.column_stack([dq, dq * ddq]))
    assert len(found.dq) == 4 * 20
    assert_allclose(found.mean[:, 0], found.dq)
    assert (np.sign(found.mean[:, 1]) == np.where(found.gaining, 1, -1)).all()
    assert (np.diff(found.dq[found.gaining]) > 0).all()


def test_ranges_with_few_samples_are_left_out():
    dq = np.repeat([0.1, -0.9, 0.5], [50, 4, 5])
    assert_allclose(over_velocity(dq, np.ones_like(dq), dq[:, None]).dq, [0.1, 0.5])
    assert len(over_velocity(np.zeros(3), np.zeros(3), np.zeros((3, 2))).dq) == 0


def test_the_friction_that_was_put_in_is_what_is_left():
    (found,) = charts(*[arm.signal("hand_roll", noise=0.0)] * 2)
    _, _, viscous, coulomb = arm.THETA["hand_roll"]
    away = np.abs(found.dq) > 0.1  # near standstill the low-pass rounds the step off
    assert away.sum() > 40
    expected = viscous * found.dq + coulomb * np.sign(found.dq)
    assert_allclose(found.tau_friction[away], expected[away], atol=0.02 * coulomb)
    assert_allclose(found.tau_friction_hat[away], expected[away], atol=0.01 * coulomb)


def test_friction_of_one_direction_is_seen_as_such_beside_a_symmetric_model():
    signal = arm.signal("hand_roll", noise=0.0)
    harder = Signal(**{**vars(signal), "tau": signal.tau + 0.1 * (signal.dq > 0)})
    (found,) = charts(harder, signal)
    more = found.tau_friction - found.tau_friction_hat
    away = np.abs(found.dq) > 0.1
    assert_allclose(more[away & (found.dq > 0)], 0.1, atol=0.01)
    assert_allclose(more[away & (found.dq < 0)], 0.0, atol=0.01)


def constant_velocity(speed: float) -> Signal:
    """To and fro at one speed, turning within a moment."""
    dq = speed * np.tanh(20.0 * np.sin(2 * np.pi * T / 5.0))
    q, ddq = np.cumsum(dq) / 200.0, np.gradient(dq, T)
    tau = regressor(arm.joint("hand_roll").terms, q, dq, ddq) @ arm.THETA["hand_roll"]
    zero = np.zeros(len(T), int)
    return Signal("run", "hand_roll", "friction", 200.0, "as recorded", "logged", 0, 0, T, q, dq, tau, zero, zero)


@pytest.mark.parametrize("speed", [0.05, 0.4])
def test_runs_at_constant_velocity_show_friction_at_that_velocity(speed):
    (found,) = charts(constant_velocity(speed), arm.signal("hand_roll", noise=0.0), "friction")
    _, _, viscous, coulomb = arm.THETA["hand_roll"]
    assert found.role == "friction"
    for side in (1.0, -1.0):
        fastest = np.argmax(side * found.dq)
        assert side * found.dq[fastest] == pytest.approx(speed, rel=0.05)
        assert side * found.tau_friction[fastest] == pytest.approx(viscous * speed + coulomb, rel=0.02)


def test_logs_of_other_roles_and_joints_at_rest_tell_nothing_of_friction():
    signal = arm.signal("hand_roll")
    assert charts(signal, signal, "validation") == []
    assert charts(Signal(**{**vars(signal), "at_rest": 1}), signal) == []
