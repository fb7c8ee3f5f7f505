"""The run-in: from rest, without a jump, into the periodic trajectory, within the limits."""

import numpy as np
import pytest

from davinci_forces.maths.excitation.fourier import Fourier, motion, run_in, shortest_run_in

SERIES = Fourier(0.05, (0.2, 0.2), (0.1, 0.3), 10.0)


@pytest.mark.parametrize("duration", [2.5, 7.3, 10.0])
def test_a_run_in_starts_at_rest_and_ends_in_the_periodic_motion(duration):
    start, end = (np.array(run_in(SERIES, np.array([t]), duration))[:, 0] for t in (-duration, 0.0))
    assert start[1:].tolist() == [0.0, 0.0]
    assert end == pytest.approx(np.array(motion(SERIES, np.array([0.0])))[:, 0], abs=1e-12)


def test_velocity_and_acceleration_of_a_run_in_are_the_derivatives_of_its_position():
    t, h = np.linspace(-3.9, -0.1, 200), 1e-5
    ahead, here, behind = (run_in(SERIES, t + shift, 4.0) for shift in (h, 0.0, -h))
    for derivative in (1, 2):
        slope = (ahead[derivative - 1] - behind[derivative - 1]) / (2 * h)
        assert here[derivative] == pytest.approx(slope, abs=1e-8)


def test_the_shortest_run_in_that_keeps_the_limits_of_acceleration_is_taken():
    limits, durations = (-0.6, 0.6), np.linspace(0.5, 10, 100)
    peaks = [np.abs(run_in(SERIES, np.linspace(-d, 0, 20_000), d)[2]).max() for d in durations]
    first = next(d for d, peak in zip(durations, peaks, strict=True) if peak <= 0.6)
    assert durations[0] < first < durations[-1]
    just = 1.0001 * peaks[durations.tolist().index(first)]  # a limit that this run-in keeps by a hair
    assert shortest_run_in([SERIES], [(-just, just)], durations) == first
    assert shortest_run_in([SERIES], [limits], durations) == first
    assert shortest_run_in([SERIES, SERIES], [(-9.0, 9.0), limits], durations) == first


def test_where_no_run_in_keeps_the_limits_there_is_none():
    assert shortest_run_in([SERIES], [(-0.6, 0.6)], np.array([0.1, 0.2])) is None


def test_a_trajectory_that_leaves_the_limits_by_itself_can_still_be_run_into():
    assert shortest_run_in([SERIES], [(-0.01, 0.01)], np.linspace(2.5, 10, 31)) is not None
