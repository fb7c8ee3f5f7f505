"""A hand against tissue whose force comes late, or late and held: on both sides of the border."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.errors import BadRequest
from davinci_forces.haptics.maths.bimodal import THESIS_HAND, Hand
from davinci_forces.haptics.maths.delay import (
    damping_needed,
    delay_limit,
    max_stable,
    sampled_limit,
    settles,
    zero_order_hold,
)

DELAYS = (0.005, 0.05, 0.3)


def delayed_hold(hand: Hand, delay: float, rate: float):
    """x_(k+1) = Phi x_k + early u_(k-n) + late u_(k-n-1): the previous force acts for the rest of the delay."""
    samples = int(delay * rate + 1e-9)
    Phi, whole = zero_order_hold(hand, 1.0 / rate)
    _, early = zero_order_hold(hand, 1.0 / rate - max(delay - samples / rate, 0.0))
    return Phi, early, whole - early, samples


def spectral_radius(hand: Hand, k_t: float, delay: float, rate: float) -> float:
    """The largest modulus of the roots of the sampled hand in contact: it is stable below 1."""
    Phi, early, late, samples = delayed_hold(hand, delay, rate)
    n = samples + 1  # forces that are remembered
    A = np.zeros((2 + n, 2 + n))
    A[:2, :2] = Phi
    A[2, 0] = -k_t
    A[3:, 2:-1] = np.eye(n - 1)
    A[:2, 1 + n] += late
    if samples:
        A[:2, n] += early
    else:
        A[:2, 0] -= k_t * early
    return float(np.abs(np.linalg.eigvals(A)).max())


@pytest.mark.parametrize("hand", [THESIS_HAND, Hand(0.1, 0.02, 3000.0), Hand(2.0, 40.0, 50.0)])
@pytest.mark.parametrize(("delay", "rate"), [(0.0, 100.0), (0.053, 100.0), (0.02, 30.0), (0.2, 250.0)])
def test_the_limit_of_a_held_force_is_the_first_at_which_a_root_leaves_the_unit_circle(hand, delay, rate):
    limit = sampled_limit(hand, delay, rate)
    below = [spectral_radius(hand, k_t, delay, rate) for k_t in np.linspace(1e-3, 0.999, 60) * limit]
    assert max(below) < 1.0 < spectral_radius(hand, 1.001 * limit, delay, rate)


def test_small_delays_and_periods_cost_what_the_textbook_says():
    """b > K_T (T/2 + d), for a hand that is slow beside both."""
    for delay, rate in ((0.001, 1000.0), (0.0, 2000.0), (0.0005, 4000.0)):
        assert_allclose(sampled_limit(THESIS_HAND, delay, rate) * (0.5 / rate + delay), THESIS_HAND.b, rtol=2e-3)
    assert_allclose(delay_limit(THESIS_HAND, 1e-4) * 1e-4, THESIS_HAND.b, rtol=1e-4)


@pytest.mark.parametrize("hand", [THESIS_HAND, Hand(0.1, 0.02, 3000.0), Hand(1.0, 0.1, 400.0)])
def test_a_force_held_ever_more_often_is_a_delayed_one(hand):
    """A hand that is hardly damped meets the limit after whole turns of its delay."""
    for delay in (0.05, 0.17):
        assert_allclose(sampled_limit(hand, delay, 5000.0), delay_limit(hand, delay + 1e-4), rtol=1e-3)


@pytest.mark.parametrize("delay", DELAYS)
def test_the_damping_that_is_needed_puts_the_limit_at_the_tissue(delay):
    needed = damping_needed(THESIS_HAND, 457.24, lambda hand: delay_limit(hand, delay))
    assert_allclose(delay_limit(THESIS_HAND._replace(b=needed), delay), 457.24, rtol=1e-6)


def test_a_delay_of_too_many_samples_is_refused_with_a_remedy():
    with pytest.raises(BadRequest, match=r"20 s is 20000 samples of 1000 Hz.*leave the rate out"):
        sampled_limit(THESIS_HAND, 20.0, 1000.0)


def test_the_search_finds_the_first_instability_and_not_the_end_of_an_island_beyond():
    for guess in (0.6, 0.97, 1.3):
        assert_allclose(max_stable(lambda value: value < 1.0 or 1.9 < value < 2.1, guess), 1.0, rtol=0.005)
    assert np.isnan(max_stable(lambda value: True, 1.0))
    assert np.isnan(max_stable(lambda value: False, 1.0))


def test_a_swing_that_grows_and_shrinks_does_not_settle_and_one_that_shrinks_does():
    wave = np.tile([-1.0, 1.0], 250)
    for sizes, steady in (((0.6, 0.51, 0.56, 0.5), False), ((0.6, 0.56, 0.53, 0.5), True), ((9, 9, 9, 0.01), True)):
        x = np.concatenate([size * wave for size in sizes])
        assert settles(x, 0.1) == steady
