"""The search for a trajectory: a minimum among jumps and kinks, and numbers that always keep the limits."""

import platform
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from davinci_forces.maths.excitation.fourier import Fourier, motion, ranges
from davinci_forces.maths.excitation.joint import delay, extremes, from_standstill, scale_to_limits
from davinci_forces.maths.excitation.search import best_of_starts, descend

LIMITS = ((-0.3, 0.5), (-1.0, 0.2), (-np.inf, 2.0))
numbers = st.lists(st.floats(-1e3, 1e3).filter(lambda c: c == 0 or abs(c) > 1e-3), min_size=3, max_size=11).filter(
    lambda z: len(z) % 2 == 1 and any(z[1:])
)


def stairs(z):
    """A valley with a kink, which steps of a thousandth cut across; its lowest step is at 1, 2, 3."""
    away = np.abs(z - np.array([1.0, 2.0, 3.0])).sum(axis=1)
    return np.maximum(away, 3 * np.abs(z[:, 0] - z[:, 1] + 1)) + np.round(away, 3) % 0.002


def minimise_stairs(starts, seed):
    return best_of_starts(lambda random: descend(stairs, 3, random), starts, seed)


def test_a_minimum_among_jumps_and_kinks_is_found():
    best, values = minimise_stairs(8, 0)
    assert np.abs(stairs(best[None]) - 0).max() < 1e-5
    assert values.min() == stairs(best[None])[0]


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other libraries keep freed memory by other rules")
def test_a_search_keeps_its_memory_between_its_steps():
    """In a new process, whose memory is as it begins: without `RETAINED`, each of 97 calls faults in 5000 pages."""
    code = """
import resource
import numpy as np
from davinci_forces.maths.excitation.search import best_of_starts, descend
large = lambda z: sum(x.mean(axis=1) for x in [np.repeat(abs(z), 4000, axis=1) for _ in range(8)])
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
best_of_starts(lambda random: descend(large, 4, random), 1, 0)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(run.stdout) < 10_000


def test_more_starts_begin_with_the_same_ones():
    (_, few), (_, more), (_, others) = (minimise_stairs(n, seed) for n, seed in ((2, 5), (4, 5), (2, 6)))
    assert few.tolist() == more[:2].tolist()
    assert others.tolist() != few.tolist()


def test_where_nothing_is_worth_anything_the_search_ends_without_a_warning():
    assert descend(lambda z: np.full(len(z), np.inf), 3, np.random.default_rng(0))[1] == np.inf


@given(numbers, st.floats(0.5, 20))
def test_any_numbers_are_a_trajectory_within_the_limits(z, period):
    x = scale_to_limits(np.array([z]), LIMITS, period)[0]
    for (low, high), (lowest_, highest) in zip(LIMITS, ranges(Fourier.from_coefficients(x, period)), strict=True):
        room = 1e-6 * max(abs(low) if np.isfinite(low) else 0.0, abs(high))
        assert low - room <= lowest_
        assert highest <= high + room


@pytest.mark.parametrize("mean", [-np.pi / 2, 0.0, np.pi / 2])
def test_harmonics_of_size_one_touch_a_limit_and_the_mean_goes_through_the_slack(mean):
    c = np.array([[0.3, -0.2, 0.5, 0.1]])
    lowest_, highest = extremes(c, 7.0)
    size = max((highest[0] - lowest_[0]) / 0.8, lowest_[1] / -1.0, highest[1] / 0.2, highest[2] / 2.0)
    x = scale_to_limits(np.column_stack([[mean], c / size]), LIMITS, 7.0)[0]
    q, dq, ddq = ranges(Fourier.from_coefficients(x, 7.0))
    used = max((q[1] - q[0]) / 0.8, dq[0] / -1.0, dq[1] / 0.2, ddq[1] / 2.0)
    assert used == pytest.approx(1, abs=2e-7)
    where = (q[0] + 0.3) / (0.8 - (q[1] - q[0]))
    assert where == pytest.approx((1 + np.sin(mean)) / 2, abs=1e-4)


def test_extremes_on_the_grid_are_the_exact_ones_to_a_ten_millionth():
    c = np.random.default_rng(0).normal(size=(200, 6))
    lowest_, highest = extremes(c, 3.0)
    exact = np.array([ranges(Fourier.from_coefficients(np.array([0.0, *one]), 3.0)) for one in c])
    size = np.abs(exact).max(axis=2)
    assert (np.abs(lowest_.T - exact[:, :, 0]) < 1e-7 * size).all()
    assert (np.abs(highest.T - exact[:, :, 1]) < 1e-7 * size).all()


def test_harmonics_stand_still_when_time_starts_but_for_the_phase_that_is_left():
    z = np.random.default_rng(1).normal(size=(5, 7))
    known, phase = from_standstill(z, 300)
    assert np.abs(known[:, 1::2].sum(axis=1)).max() < 1e-12
    assert phase == pytest.approx(np.pi / 300 * z[:, 5] ** 3)
    for before, after, late in zip(known, delay(known, phase), phase, strict=True):
        t = np.linspace(0, 8, 50)
        moved = motion(Fourier.from_coefficients(after, 8.0), t)
        for values, same in zip(
            moved, motion(Fourier.from_coefficients(before, 8.0), t - late * 8 / (2 * np.pi)), strict=True
        ):
            assert values == pytest.approx(same, abs=1e-12)
