"""The simulated haptic loop: what it becomes where parts of it are ideal, its filter, and where it is unstable."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from davinci_forces.filters import tracker
from davinci_forces.filters.problem import FilterInput
from davinci_forces.haptics import loop as haptic
from davinci_forces.haptics.maths.bimodal import THESIS_HAND, simulate_switching
from davinci_forces.haptics.maths.delay import harmonic, zero_order_hold
from davinci_forces.haptics.maths.simulated_loop import Clocks, FeltTissue, Grip, simulate
from davinci_forces.haptics.scenario import FIRM, SLIDE, AxisNoise, HapticScenario
from davinci_forces.maths.models.model import JointDynamics

K = 457.24
NOBODY = np.zeros((0, 2))
FULL = haptic.complete_scenario(HapticScenario())
IDEAL = replace(FULL, exact=True, filtered=False, damping=0.0, friction=0.0)
QUIET = replace(FULL, noise=AxisNoise(5e-7, 5e-4, 1e-6))
SLOW = ((0.0, -0.02), (4.0, 0.04), (8.0, -0.02))


def let_go(tick: float):
    """The hand let go 1 cm from a spring, its force continuous but for the ticks."""
    T = round(2.0 / tick)
    clocks, grip = Clocks(tick, 1, 1, 0, 0), Grip(*zero_order_hold(THESIS_HAND, tick), NOBODY)
    axis, tissue, noise = haptic._axis(IDEAL, -0.01), FeltTissue(K, 0.0, 0.0), np.zeros((T, 3))
    return simulate(grip, IDEAL.device, axis, tissue, clocks, np.zeros(T), noise, (-0.01, 0.0), lambda r: r.force)


def test_with_an_ideal_arm_and_ever_smaller_ticks_the_hand_moves_as_the_bimodal_model_does():
    exact, errors = simulate_switching(THESIS_HAND, K, (-0.01, 0.0), 2.0), []
    for tick in (1e-3, 5e-4):
        run = let_go(tick)
        errors.append(np.abs(np.interp(run.t, exact.t, exact.x) - run.x).max())
    assert errors[0] < 0.03 * 0.01
    assert 1.8 < errors[0] / errors[1] < 2.2  # a force that is held is half a tick late


@pytest.mark.parametrize("name", ["relaxed", "firm"])
def test_the_filter_in_the_loop_is_the_one_that_tracks_logs(name):
    hand = dict(FULL.hands)[name]
    scenario = replace(FULL, plan=SLOW, device=FULL.device._replace(force=0.0 if name == "relaxed" else 1.0))
    run = haptic.simulate_plan(scenario, hand)
    q, dq, tau, _ = run.readings.T
    nothing = np.zeros(len(q))
    joint = JointDynamics(np.full(len(q), SLIDE.inertia), haptic.coefficients(SLIDE), nothing)
    recorded = FilterInput(joint, q, dq, nothing, tau, 1.0 / scenario.rate, scenario.noise.tau)
    assert run.estimates.max() > 5.0
    assert_array_equal(run.estimates, tracker("ekf")(recorded, haptic.filter_noise(scenario)).tau_ext)


def test_the_harmonic_of_a_sine_is_its_amplitude():
    t = np.arange(1000) / 1000.0
    w = 2.0 * np.pi * 3.0
    assert_allclose(harmonic(t, 5.0 + 0.2 * np.cos(w * t) + 0.3 * np.sin(w * t), w), 0.2 - 0.3j, atol=1e-12)


def test_the_felt_peak_is_the_true_one_as_late_as_the_filter_and_the_link_are():
    run = haptic.simulate_plan(replace(QUIET, plan=SLOW, friction=0.0), FIRM)
    assert run.true.max() > 8.0
    assert_allclose(run.felt.max(), run.true.max(), rtol=0.05)
    rises, falls = ([float(run.t[np.flatnonzero(f > 4.0)[k]]) for f in (run.true, run.felt)] for k in (0, -1))
    assert 0.03 < rises[1] - rises[0] < 0.16  # 0.1 s of the filter for a push of 1 s, and half a message
    assert 0.03 < falls[1] - falls[0] < 0.16


def test_a_sensor_in_place_of_the_filter_is_felt_at_the_next_message():
    run = haptic.simulate_plan(replace(QUIET, plan=SLOW, filtered=False), FIRM)
    turn = round(1.0 / QUIET.rate / QUIET.tick)
    messages = run.true[::turn]
    assert_allclose(run.felt[::turn], messages, atol=1e-12)
    assert_allclose(run.felt[turn - 1 :: turn], messages, atol=1e-12)  # held until the next


def test_the_thesis_s_hand_is_thrown_out_of_reach_and_the_firm_one_is_not():
    runs = {name: haptic.experiment(FULL, name, hand) for name, hand in FULL.hands}
    assert runs["relaxed"].out_of_reach
    assert not runs["firm"].out_of_reach
    assert len(runs["firm"].t) == 3000
    assert np.abs(runs["relaxed"].hand_x).max() <= FULL.reach


def test_a_device_makes_no_more_force_than_it_can():
    weak = replace(FULL, device=FULL.device._replace(strongest=3.3), plan=SLOW)
    run = haptic.simulate_plan(weak, FIRM)
    assert_allclose(run.felt.max(), 3.3)
    assert run.true.max() > 3.3


def test_tissue_that_rubs_keeps_energy():
    def lost(friction: float) -> float:
        run = haptic.simulate_plan(replace(QUIET, plan=SLOW, friction=friction, damping=0.0), FIRM)
        return float(np.sum(run.true * np.gradient(run.q)))

    assert lost(0.2) > 0.01 > abs(lost(0.0))


def test_the_same_seed_gives_the_same_bytes_and_another_one_others():
    once, again, other = (haptic.simulate_plan(replace(FULL, seed=seed, plan=SLOW), FIRM) for seed in (3, 3, 4))
    assert all(a.tobytes() == b.tobytes() for a, b in zip(once, again, strict=True))
    assert not np.array_equal(once.felt, other.felt)
