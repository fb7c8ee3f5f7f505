"""How much of an effort free motion explains: all of a model's own, less of a push or of another payload."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.maths.contact.unexplained import (
    MAX_POINTS,
    SAMPLES_SMOOTHED,
    Course,
    has_outliers,
    smoothed_course,
    unexplained_share,
)

STEP = 0.01
T = STEP * np.arange(3000)


def course(seed=0, scale=1.0, noise=0.02, external=0.0) -> Course:
    """A joint with gravity, friction and inertia along a motion of two incommensurable frequencies."""
    q = scale * (0.4 * np.sin(1.1 * T) + 0.2 * np.sin(2.7 * T))
    dq, ddq = np.gradient(q, STEP), np.gradient(np.gradient(q, STEP), STEP)
    tau = 2.0 * np.sin(q) + 0.5 * dq + 0.8 * np.tanh(dq / (0.02 * np.abs(dq).max())) + 0.3 * ddq + external
    return Course(q, dq, ddq, tau + noise * np.random.default_rng(seed).standard_normal(len(T)))


def test_a_smoothed_course_is_that_of_the_signals_and_their_derivative():
    t = STEP * np.arange(200)
    made = smoothed_course(3.0 * t, 3.0 * t, np.full(200, 2.0), STEP)
    inner = slice(SAMPLES_SMOOTHED // 2, 200 - SAMPLES_SMOOTHED // 2)
    assert_allclose([made.q, made.dq], [3.0 * t[inner]] * 2)
    assert_allclose(made.ddq, 3.0)
    assert_allclose(made.tau, 2.0)


def test_the_mean_of_samples_takes_their_noise_to_its_root_and_a_short_course_is_left_as_it_is():
    noise = np.random.default_rng(0).standard_normal(9000)
    smooth = smoothed_course(noise, noise, noise, STEP).tau
    assert smooth.std() == pytest.approx(1.0 / np.sqrt(SAMPLES_SMOOTHED), rel=0.1)
    short = noise[: 2 * SAMPLES_SMOOTHED]
    assert_allclose(smoothed_course(short, short, short, STEP).tau, short)
    assert_allclose(smoothed_course(short[:1], short[:1], short[:1], STEP).ddq, 0.0)


def test_a_long_course_is_thinned_evenly():
    t = STEP * np.arange(2 * MAX_POINTS + 100)
    made = smoothed_course(t, t, t, STEP)
    assert MAX_POINTS / 2 < len(made.q) <= MAX_POINTS
    assert_allclose(np.diff(made.q), np.diff(made.q)[0])
    assert_allclose([made.dq, made.tau], [made.q] * 2)
    assert_allclose(made.ddq, 1.0)


def test_free_motion_leaves_the_noise_unexplained_and_no_outliers():
    assert not has_outliers(course())
    assert unexplained_share(course(1), [course()]) == 0.0
    assert not has_outliers(course(noise=0.0)._replace(tau=np.zeros(len(T))))


@pytest.mark.parametrize(("size", "seen"), [(0.3, False), (6.0, True)])
def test_a_push_in_a_tenth_of_a_log_is_an_outlier_if_it_is_most_of_what_the_effort_varies_by(size, seen):
    push = size * ((T > 12.0) & (T < 15.0))
    assert has_outliers(course(external=push)) == seen


def test_what_another_course_does_not_explain_is_a_share_of_the_effort():
    random = 1.5 * np.random.default_rng(5).standard_normal(len(T))
    loaded = course(1, external=random)
    share = unexplained_share(loaded, [course()])
    assert share == pytest.approx(1.5 / loaded.tau.std(), rel=0.05)
    assert unexplained_share(loaded, [loaded]) == 0.0  # the model leaves as much of the course it was fitted to


def test_only_samples_within_what_the_others_reached_are_judged():
    assert unexplained_share(course(1, scale=4.0), [course()]) == 0.0  # most of it is beyond
    beyond = np.abs(course().q) > 0.9 * np.abs(course(scale=0.8).q).max()
    wider = course(1, external=np.where(beyond, 40.0, 0.0))
    assert unexplained_share(wider, [course(scale=0.7)]) == 0.0  # where it is loaded, no other course was
