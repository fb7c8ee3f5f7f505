"""Tests of white noise, the causes that make innovations fail them, and what is said of each."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from davinci_forces.filters import ekf, tracker
from davinci_forces.filters.innovations import coloured
from davinci_forces.filters.innovations.innovations import correct_times, delays, innovations
from davinci_forces.filters.innovations.search import (
    CLOCK,
    COLOUR,
    CONTACT,
    ELSEWHERE,
    REVERSALS,
    SIZES,
    WALK,
    CauseSearch,
    Subject,
    Trial,
    search,
)
from davinci_forces.filters.problem import FilterInput
from davinci_forces.maths.models.independent import bias_coefficients, inertia_of
from davinci_forces.maths.signals import whiteness
from davinci_forces.maths.signals.standstill import is_far_from_reversals
from davinci_forces.records import JointModel
from davinci_forces.stages.forces import whiteness as explain
from tests import arm
from tests.report.report_records import record
from tests.test_averaging import entry
from tests.test_ekf import NOISE, T_S, matched, simulate, walk

N = 4000
NAME = "hand_pitch"


def noise(seed, *shape):
    return np.random.default_rng(seed).normal(size=shape)


def share_below(level, probabilities):
    return np.mean(np.asarray(probabilities) < level, axis=0)


def allowed(level, tried):
    """Four standard errors about the level, and the half per cent that Ljung and Box's approximation errs by."""
    return pytest.approx(level, abs=4 * np.sqrt(level * (1 - level) / tried) + 0.005)


@pytest.mark.parametrize("cuts", [(), (90, 300), (25, 60, 100, 330)], ids=["whole", "three pieces", "five pieces"])
def test_white_noise_fails_each_test_as_often_as_stated(cuts):
    made = [whiteness.tests(np.split(noise(seed, 600), cuts), 20) for seed in range(1500)]
    probabilities = [(box.probability, wave) for box, wave in made]
    for level in (0.01, 0.05):
        box, wave = share_below(level, probabilities)
        assert box == allowed(level, 1500)
        assert wave == allowed(level, 1500)


def test_the_tests_of_pieces_see_no_correlation_from_one_piece_to_the_next():
    """White noise, repeated: the second piece is the first, 100 samples later."""
    x = noise(0, 100)
    r = whiteness.autocorrelation([x, x, x], 20)
    by_hand = np.array([x[: 100 - k] @ x[k:] for k in range(21)]) / (x @ x)
    assert_allclose(r, by_hand, atol=1e-12)
    assert whiteness.autocorrelation([np.tile(x, 3)], 100)[100] > 0.6


def test_the_ljung_box_statistic_of_pieces_counts_the_pairs_within_them():
    from scipy.stats import chi2

    pieces = np.split(noise(0, 430), (15, 70, 200))  # the first is shorter than the largest lag
    r = whiteness.autocorrelation(pieces, 20)
    pairs = np.array([sum(max(len(x) - k, 0) for x in pieces) for k in range(1, 21)])
    box = whiteness.ljung_box(pieces, r, 20)
    by_hand = 430 * 432 * np.sum(r[1:] ** 2 / pairs)
    assert_allclose(box, (by_hand, chi2.sf(by_hand, 20)), rtol=1e-12)


def test_each_test_sees_its_own_departure():
    """Ljung and Box's a correlation at few lags, the periodogram one that is spread thinly over many."""
    thin = noise(1, 4000) + 0.35 * np.cumsum(noise(2, 4000)) / np.sqrt(4000) * 4
    box, wave = whiteness.tests([noise(1, 4000)], 20)
    assert min(box.probability, wave) > 0.01
    assert whiteness.tests([thin], 20)[1] < 0.001
    echo = noise(3, 4000)
    echo[12:] += 0.1 * echo[:-12]
    assert whiteness.tests([echo], 20)[0].probability < 0.001


def test_the_band_of_the_cumulative_periodogram_holds_what_it_says():
    made = [whiteness.cumulative_periodogram([noise(seed, 401)]) for seed in range(1000)]
    band = whiteness.distance_of(0.05, len(made[0].share))
    assert np.mean([m.distance > band for m in made]) == allowed(0.05, 1000)


def test_the_band_of_a_mean_square_holds_what_it_says():
    low, high = whiteness.mean_square_band(300)
    squares = np.mean(noise(4, 4000, 300) ** 2, axis=1)
    assert np.mean((squares < low) | (squares > high)) == allowed(0.05, 4000)


def test_shape_is_that_of_scipy():
    from scipy import stats

    x = noise(5, 500) + 0.05 * noise(5, 500) ** 2
    found = stats.jarque_bera(x)
    assert 1e-6 < found.pvalue < 0.99
    assert_allclose(whiteness.shape(x), (stats.skew(x), stats.kurtosis(x), found.pvalue), rtol=1e-9)


def test_the_cross_correlation_is_the_one_by_hand_with_what_came_before():
    u = noise(6, 300)
    x = np.concatenate([np.zeros(7), u[:-7]]) + 0.1 * noise(7, 300)
    r = whiteness.cross_correlation(x, u, 20)
    a, b = x - x.mean(), u - u.mean()
    by_hand = [a[k:] @ b[: len(b) - k] for k in range(21)]
    assert_allclose(r, np.array(by_hand) / np.linalg.norm(a) / np.linalg.norm(b), atol=1e-12)
    assert np.argmax(r) == 7
    assert_array_equal(whiteness.cross_correlation(x, np.ones(300), 20), np.zeros(21))


def test_innovations_are_those_of_the_filter_and_each_as_large_as_stated():
    recording, _ = matched(NAME, N=N)
    own, made = innovations(recording, NOISE), tracker("ekf")(recording, NOISE)
    assert_array_equal(own.q, made.innovation_q)
    assert_array_equal(own.dq, made.innovation_dq)
    low, high = whiteness.mean_square_band(N - 200)
    for x, std in ((own.q, own.q_std), (own.dq, own.dq_std)):
        assert low * 0.97 < np.mean((x / std)[200:] ** 2) < high * 1.03


def test_without_memory_the_coloured_filter_is_the_plain_one():
    recording, _ = matched("hand_roll", N=500)
    plain, own = coloured.Noise(NOISE, coloured.UNCOLOURED), tracker("ekf")(recording, NOISE)
    tracked = coloured.track(recording, plain)
    assert_allclose(tracked.innovation_q, own.innovation_q, atol=1e-11)
    assert_allclose(tracked.innovation_dq, own.innovation_dq, atol=1e-10)
    assert coloured.log_likelihood(recording, plain) == pytest.approx(ekf.log_likelihood(recording, NOISE), rel=1e-9)


def autoregressive(seed, phi, size):
    from scipy.signal import lfilter

    return lfilter([np.sqrt(1 - phi**2) * size], [1, -phi], noise(seed, N))


@cache
def truth(seed=0, q_tau=NOISE.q_tau, coulomb=0.0, pushed=0.0):
    """True effort, and measurements of a joint without noise of its measurements; it turns round every 1.6 s.

    The push is random and quick, in the third quarter of the run.
    """
    used, theta = arm.joint(NAME).terms, arm.THETA[NAME].copy()
    theta[-1] = coulomb
    tau_ext = walk(N, q_tau, seed + 1000)
    quarter = slice(N // 2, 3 * N // 4)
    tau_ext[quarter] += pushed * noise(seed + 7, N // 4)
    w = 2.0
    t = np.arange(N) * T_S
    tau = tau_ext + 3 * inertia_of(used, theta) * np.sin(w * t) + bias_coefficients(used, theta)[0]
    tau = tau + coulomb * np.sign(-np.cos(w * t))
    clean = NOISE._replace(r_q=0.0, r_dq=0.0)
    return tau, simulate(used, theta, tau_ext, tau, clean, seed, x=(0.1, -3.0 / w), finer=8)


def measured(seed=0, v_q=None, v_dq=None, late=None, coulomb=0.0, **about):
    """A recording, as the filter takes it that knows of no Coulomb friction."""
    tau, (q, dq) = truth(seed, coulomb=coulomb, **about)
    ddq = np.gradient(dq, T_S)
    if late is not None:
        q, dq = q + dq * late, dq + ddq * late
    v_q = NOISE.r_q * noise(seed + 50, N) if v_q is None else v_q
    v_dq = NOISE.r_dq * noise(seed + 51, N) if v_dq is None else v_dq
    return recording(q + v_q, dq + v_dq, ddq, tau)


def recording(q, dq, ddq, tau, factor=1.0):
    theta = arm.THETA[NAME].copy()
    theta[-1] = 0.0
    theta[3] *= factor  # viscous friction
    return FilterInput(arm.dynamics(arm.joint(NAME).terms, theta, len(tau)), q, dq, ddq, tau, T_S, 1.0)


EVERYWHERE = np.ones(N, bool)
TOUCHED = EVERYWHERE.copy()
TOUCHED[N // 2 : 3 * N // 4] = False


def subject(run, noise=NOISE, free=EVERYWHERE, far=EVERYWHERE, **others):
    return Subject({"": run, **others}, noise, free, far)


def without(found):
    return [set(trial.without) for trial in found.explaining]


def test_a_matched_run_is_white_and_nothing_is_looked_for():
    found = search(subject(measured(), free=TOUCHED))
    assert len(found.trials) == 1
    assert (found.outcome, found.verdict) == ("white", "white")


def test_a_walk_faster_than_the_data_ask_is_named_and_so_is_one_that_is_too_slow():
    run = measured()
    fast = search(subject(run, NOISE._replace(q_tau=30 * NOISE.q_tau)))
    slow = search(subject(run, NOISE._replace(q_tau=NOISE.q_tau / 30)))
    assert without(fast)[0] == {WALK}
    assert without(slow)[0] == {WALK}
    assert "a random walk faster than the data show" in fast.verdict
    assert "a random walk slower than the data show" in slow.verdict
    assert fast.outcome == "mended"


def test_contact_is_named_where_it_was_and_not_where_another_window_is_left_out():
    run = measured(pushed=1.0)
    found = search(subject(run, free=TOUCHED))
    assert {CONTACT} in without(found)
    assert found.verdict.startswith("white outside contact")
    assert found.outcome == "left out"
    elsewhere = np.roll(TOUCHED, N // 2)
    assert not any(CONTACT in names for names in without(search(subject(run, free=elsewhere))))


def test_no_contact_is_blamed_in_a_log_that_nothing_touched():
    """What is left out there are rests and transients."""
    found = search(subject(measured(pushed=1.0), free=TOUCHED))
    model = record(JointModel, 10)
    for about, words in ((entry(role="validation"), "rests and transients"), (entry(contact=((1.0, 2.0),)), CONTACT)):
        said = explain.explanation(model, found, about, 0.0)
        assert said.verdict.startswith(f"white outside {words}")
        assert [name for name in said.without if words in name]
        assert (CONTACT in said.verdict) == (words == CONTACT)


def test_reversals_are_named_where_friction_jumps_at_them():
    run = measured(coulomb=1.0)
    found = search(subject(run, far=is_far_from_reversals(truth(coulomb=1.0)[1][1], T_S)))
    assert {REVERSALS} in without(found)
    assert "white outside reversals" in found.verdict


def test_fewer_samples_are_no_cause():
    """Coloured throughout, so little that a fifth of the samples cannot tell it."""
    run = measured(v_dq=autoregressive(3, 0.12, NOISE.r_dq))
    some = np.arange(N) % 200 < 40
    passes = subject(run, far=some)
    assert passes.trial(()).lowest < 0.01 < passes.trial((REVERSALS,)).lowest
    assert not passes.fails_elsewhere((REVERSALS,))
    assert not any(REVERSALS in names for names in without(search(subject(run, far=some))))


def test_as_many_other_times_are_tried_as_are_judged(monkeypatch):
    run, offsets = measured(), []
    some = np.arange(N) % 200 < 40
    passes = subject(run, far=some)
    monkeypatch.setattr(np, "roll", lambda x, by, roll=np.roll: offsets.append(by) or roll(x, by))
    passes.fails_elsewhere((REVERSALS,))
    each = offsets[::2]  # both samples and motion are moved
    assert len(each) == len(set(each)) == ELSEWHERE
    assert each[0] == round(N * 0.6180339887498949)


def test_a_run_that_fails_by_chance_has_no_cause():
    """One in thirty does; of the first forty this one would pass without a window in which nothing happened."""
    run = measured(seed=27)
    passes = subject(run, free=TOUCHED)
    assert passes.trial(()).lowest < 0.01 < passes.trial((CONTACT,)).lowest
    found = search(subject(run, free=TOUCHED))
    assert found.explaining == []
    assert found.verdict.startswith("not white, but only slightly")


def test_noise_of_another_size_is_named():
    found = search(subject(measured(), NOISE._replace(r_q=NOISE.r_q / 6, r_dq=NOISE.r_dq * 6)))
    assert {SIZES} in without(found)
    assert not any({COLOUR, CLOCK} & names for names in without(found))
    assert "noise of another size than assumed" in found.verdict


def test_coloured_measurement_noise_is_named_and_its_memory_found():
    run = measured(v_q=autoregressive(4, 0.7, NOISE.r_q), v_dq=autoregressive(5, 0.5, NOISE.r_dq))
    found = search(subject(run))
    assert without(found) == [{COLOUR}]
    assert found.verdict == "white except for coloured measurement noise"
    told = coloured.fit_noise(run, NOISE, walks=False, coloured=True)
    assert_allclose(told.phi, (0.7, 0.5), atol=0.1)
    assert_allclose((told.white.r_q, told.white.r_dq), (NOISE.r_q, NOISE.r_dq), rtol=0.1)


def test_a_wrong_model_is_named_where_another_would_do_and_not_where_the_other_is_as_wrong():
    right = measured(q_tau=1e-4)
    wrong = right._replace(joint=recording(*right[1:5], factor=3.0).joint)
    noises = NOISE._replace(q_tau=1e-4)
    named = search(subject(wrong, noises, **{"the true one": right}))
    assert {"the true one"} in without(named)
    assert "the model (the true one explains it)" in named.verdict
    as_wrong = search(subject(wrong, noises, another=wrong))
    assert not any("another" in names for names in without(as_wrong))


FINE = 1e-4  # noise of a position, beside which the clock is what the filter's noise is tuned to


def three_joints(late):
    runs = [measured(seed=seed, v_q=FINE * noise(seed + 50, N), late=late) for seed in range(3)]
    own = [(truth(seed)[1][1], np.gradient(truth(seed)[1][1], T_S)) for seed in range(3)]
    told = delays([dq for dq, _ in own], [innovations(run, NOISE).q for run in runs])
    return runs[0], correct_times(runs[0], *own[0], told[0]), told[0]


def test_the_other_joints_tell_an_uneven_clock_and_it_is_named():
    late = 2e-3 * np.where(np.arange(N) % 4 == 0, 1.0, -1 / 3)
    run, even, told = three_joints(late)
    fast = np.abs(truth(0)[1][1]) > 1.0  # at a standstill no joint can tell
    assert np.corrcoef(told[fast], late[fast])[0, 1] ** 2 > 0.64  # most of it, and the filter has taken the rest up
    found = search(subject(run, **{CLOCK: even}))
    # What the others tell has their noise in it, so a little of the correlation stays.
    assert set(found.nearest().without) == {CLOCK}
    assert found.share(found.nearest()) > 0.95
    assert "uneven sampling times" in found.verdict


def test_the_share_of_a_cause_is_that_of_the_excess_however_small():
    whole = Trial((), N, (0.5, 0.5), (0.5, 0.5), excess=4e-3, walk=1.0)
    less = whole._replace(without=(SIZES,), excess=1e-3)
    assert CauseSearch([whole, less], []).share(less) == pytest.approx(0.75)
    assert CauseSearch([whole._replace(excess=0.0), less], []).share(less) == 0.0


def test_a_joint_has_no_say_in_its_own_delays():
    velocities = noise(1, 3, 500)
    first = velocities * noise(2, 500) + 0.1 * noise(3, 3, 500)
    other = np.vstack([first[:1] + 0.1 * noise(4, 1, 500), first[1:]])
    one, two = delays(list(velocities), list(first)), delays(list(velocities), list(other))
    assert_array_equal(one[0], two[0])
    assert not np.array_equal(one[1], two[1])
    [alone] = delays(list(velocities[:1]), list(first[:1]))
    assert_array_equal(alone, np.zeros(500), strict=True)


def test_an_even_clock_is_not_blamed():
    _, _, told = three_joints(np.zeros(N))
    assert told.std() < 1e-4


def test_what_no_cause_explains_is_said_to_be_unexplained():
    """A line in the spectrum of the position, which none of the causes makes."""
    line = 2 * NOISE.r_q * np.sin(2.2 * np.arange(N))
    found = search(subject(measured(v_q=NOISE.r_q * noise(8, N) + line)))
    assert found.explaining == []
    assert found.outcome == "unexplained"
    assert found.verdict.startswith("not white: ")


def test_samples_far_from_reversals_have_no_change_of_sign_near():
    t = np.arange(1000) * T_S
    dq = np.cos(2 * np.pi * t / 4.0)
    far = is_far_from_reversals(dq, T_S)
    turns = np.array([1.0, 3.0, 5.0, 7.0, 9.0])
    since = t[:, None] - turns
    jumping = is_far_from_reversals(np.where(t < 5.0, 1.0, -1.0), T_S)  # which is never slow
    assert_array_equal(np.flatnonzero(~jumping), np.arange(500 - 5, 500 + 25 + 1))
    assert not far[np.any((since > -0.04) & (since < 0.24), axis=1)].any()
    assert far[np.all((since < -0.15) | (since > 0.35), axis=1)].all()


def test_runs_are_tested_that_last_six_transients_or_else_the_longest():
    subject = Subject({NAME: SimpleNamespace(T_s=0.01)}, None, None, None)
    free = np.zeros(3000, bool)
    free[10:590], free[700:1310], free[1400:2300] = True, True, True  # 5.8 s, 6.1 s and 9.0 s
    assert subject.runs(free) == [slice(700, 1310), slice(1400, 2300)]
    free[700:] = False
    assert subject.runs(free) == [slice(10, 590)]
    assert subject.runs(np.zeros(10, bool)) == [slice(0, 0)]
