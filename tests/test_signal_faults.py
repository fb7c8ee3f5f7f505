"""Faults in signals: what repeats and jumps, what is saturated, and what steps as a controller starts or stops."""

import numpy as np
import pytest

from davinci_forces.maths.signals.faults import beyond_steps, count_saturated, find_stuck

T_S = 0.01
T = T_S * np.arange(1000)


def test_a_value_that_repeats_and_then_jumps_is_stuck_from_its_first_to_its_last_sample():
    x = np.sin(T)
    stuck = x.copy()
    stuck[300:400] = stuck[300]
    [(start, end, jump)] = find_stuck(T, stuck)
    assert (start, end) == (T[300], T[399])
    assert jump == pytest.approx(x[400] - x[300])
    assert find_stuck(T, x) == []


def test_a_joint_at_rest_that_moves_on_without_a_jump_is_not_stuck():
    assert find_stuck(T, np.sin(np.clip(T, 0.0, 3.0) + np.clip(T - 6.0, 0.0, None))) == []
    assert find_stuck(T, np.zeros(len(T))) == []


def test_a_value_that_repeats_for_a_few_samples_is_coarse_and_not_stuck():
    stuck = np.sin(T)
    stuck[300:310] = stuck[300]
    assert find_stuck(T, stuck) == []


def test_runs_at_the_largest_and_the_smallest_value_are_saturated_and_single_samples_are_not():
    x = np.sin(T)
    assert count_saturated(x) == 0
    assert count_saturated(np.clip(x, -0.9, 2.0)) == np.sum(x <= -0.9)
    both = np.clip(x, -0.9, 0.9)
    assert count_saturated(both) == np.sum(np.abs(x) >= 0.9)
    assert count_saturated(np.clip(x, 0.0, 2.0)) == 0  # an effort of exactly 0 is that of a drive that is off


def stepping(start=0, stop=1000, size=3.0):
    """Noise of a model with an effort that is switched on and off."""
    residual = 0.1 * np.random.default_rng(0).standard_normal(1000)
    residual[:start] -= size
    residual[stop:] += size
    return residual


@pytest.mark.parametrize(("start", "stop"), [(60, 1000), (0, 900), (80, 950)])
def test_what_comes_before_a_step_at_the_start_or_after_one_at_the_end_is_beyond(start, stop):
    beyond = beyond_steps(stepping(start, stop), np.ones(1000, bool), np.zeros(1000), 10)
    width = 10  # of both means
    assert not beyond[start + 2 * width * (start > 0) : stop - 2 * width * (stop < 1000)].any()
    assert beyond[:start].all()
    assert beyond[stop:].all()


def test_steps_that_friction_explains_or_that_the_middle_of_a_log_has_too_are_none():
    everywhere, nothing = np.ones(1000, bool), np.zeros(1000)
    assert not beyond_steps(stepping(60), everywhere, np.full(1000, 3.5), 10).any()
    assert beyond_steps(stepping(60), everywhere, np.full(1000, 1.5), 10).any()
    middle = stepping(60)
    middle[500:] += 3.0
    assert not beyond_steps(middle, everywhere, nothing, 10).any()
    assert not beyond_steps(stepping(60), np.arange(1000) > 80, nothing, 10).any()  # the step is not scored
    assert not beyond_steps(stepping(), everywhere, nothing, 10).any()
    assert not beyond_steps(stepping()[:15], everywhere[:15], nothing[:15], 10).any()
