"""Periods and averages: the period is found, the periodic part survives, and what is reported is the spread."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from davinci_forces.errors import NotPeriodic
from davinci_forces.maths.periods import averaging, harmonics, period
from davinci_forces.maths.periods.repetition import repetition
from davinci_forces.records import Average, Diagnostic, PeriodResidual
from davinci_forces.stages.recordings import average
from davinci_forces.study import LogEntry
from tests import arm


def entry(**changes) -> LogEntry:
    return LogEntry(**{"name": "run", "files": ("x",), "role": "identification", "channels": (), **changes})


def run(signals, **changes):
    made = list(average.run(signals, entry(**changes), arm.ARM, harmonics=0, lowpass=17.0))
    return [r for r in made if isinstance(r, Average)], [r for r in made if isinstance(r, Diagnostic)]


@given(st.floats(1.7, 11.0), st.integers(0, 2**32 - 1), st.floats(0.0, 6.0))
def test_a_period_of_any_length_is_found_to_its_stated_uncertainty(length, seed, phase):
    rng = np.random.default_rng(seed)
    t = np.arange(round(6.3 * length * 100)) / 100
    amplitudes = np.array([1.0, 0.5, 0.7])
    angles = 2 * np.pi * np.outer(t, [1, 2, 3]) / length + phase
    x = np.sin(angles) @ amplitudes + 0.02 * rng.normal(size=len(t))
    match = repetition([x])
    assert match is not None
    found = period.refine(t, [x], match.lag / 100, 3)
    assert abs(found - length) < 6 * period.standard_error(t, [x], found, 3)


@pytest.mark.parametrize(
    ("amplitudes", "length"),
    [((0.1, 0, 0, 0, 0, 0.4), 10.0), ((0.05, 0, 0.5), 10.0), ((0.03, 0.0, 0.0, 0.9, 0.05), 6.4806)],
)
def test_a_motion_that_nearly_repeats_within_its_period_keeps_the_whole_of_it(amplitudes, length):
    t = np.arange(round(5.2 * length * 100)) / 100
    x = sum(a * np.sin(2 * np.pi * (k + 1) * t / length + k) for k, a in enumerate(amplitudes))
    x = x + 1e-3 * np.random.default_rng(0).normal(size=len(t))
    assert repetition([x]).lag / 100 == pytest.approx(length, rel=2e-3)


def test_noise_has_no_period():
    assert repetition([np.random.default_rng(0).normal(size=4000)]) is None


def test_the_stated_deviation_of_a_period_is_that_of_its_errors():
    t, length = np.arange(3000) / 100, 6.4806
    clean = np.sin(2 * np.pi * t / length) + 0.4 * np.cos(4 * np.pi * t / length)
    scores = []
    for seed in range(200):
        x = clean + 0.05 * np.random.default_rng(seed).normal(size=len(t))
        found = period.refine(t, [x], length, 2)
        scores.append((found - length) / period.standard_error(t, [x], found, 2))
    assert np.std(scores) == pytest.approx(1.0, abs=4 / np.sqrt(2 * 200))


@given(st.floats(37.2, 222.7), st.integers(2, 6))
def test_a_smooth_signal_averages_to_itself_whatever_the_period(samples, periods):
    """Samples fall beside the phases by up to half of one; nothing of the signal may leak into the variance."""
    t = np.arange(int(samples * periods) + 1) / 100.0
    length, K = samples / 100.0, int(samples)

    def wave(t):
        return 1.0 + np.sin(2 * np.pi * t / length) - 0.3 * np.cos(6 * np.pi * t / length)

    M = averaging.whole_periods(t, length, 100.0)
    used = t < M * length - 0.5 / 100.0
    folded = averaging.Phases(t[used], length, K).fold(wave(t[used]))
    assert_allclose(folded.mean, wave(np.arange(K) / K * length), atol=1e-9)
    assert_allclose(folded.var, 0.0, atol=1e-15)


def test_whole_samples_are_plainly_averaged():
    x = np.random.default_rng(0).normal(size=(7, 200))
    folded = averaging.Phases(np.arange(1400) / 100, 2.0, 200).fold(x.ravel())
    assert_allclose(folded.mean, x.mean(axis=0), atol=1e-12)
    assert_allclose(folded.var, x.var(axis=0, ddof=1), atol=1e-12)
    assert (folded.counts == 7).all()


@pytest.mark.parametrize("samples", [2000, 2137, 399])
def test_samples_on_the_phases_average_as_do_samples_next_to_them(samples):
    """Where no fit is needed the average is that with one; so it is of periods that are not all whole, or of none."""
    t, x = np.arange(samples) / 100, np.random.default_rng(3).normal(size=samples)
    beside = t + np.where(np.arange(samples) % 7 == 3, 1e-6, 0.0)  # s, of 0.01 s: more than a sample on a phase is off
    on, off = (averaging.Phases(times, 4.0, 400).fold(x) for times in (t, beside))
    assert averaging.Phases(t, 4.0, 400).on_them == (samples >= 400)
    assert not averaging.Phases(beside, 4.0, 400).on_them
    for name in averaging.Folded._fields:
        assert_allclose(getattr(on, name), getattr(off, name), atol=1e-3, err_msg=name)
    assert on.counts.sum() == samples
    assert_allclose(on.noise, x - on.mean[np.arange(samples) % 400], atol=1e-12)


def test_a_phase_without_a_sample_that_counts_has_the_fit_to_all_and_the_others_their_mean():
    """A joint rests during an eighth of each period; a fit to the rest of it alone would swing there."""
    t = np.arange(2000) / 100 + 0.3
    x = 2.0 + np.sin(2 * np.pi * t / 4.0) + 0.1 * np.random.default_rng(3).normal(size=len(t))
    phases = averaging.Phases(t, 4.0, 400)
    counted = phases.bins >= 50
    counted[:120] = False  # of the first period only the end, so the first that counts is at no first phase
    found = phases.mean_of(x, counted)
    true = 2.0 + np.sin(2 * np.pi * (phases.t[0] + np.arange(400) / 100) / 4.0)
    assert np.abs(found - true).max() < 0.3
    expected = [x[counted & (phases.bins == k)].mean() for k in range(50, 400)]
    assert_allclose(found[50:], expected, atol=1e-9)


@pytest.mark.parametrize("length", [2.0, 1.2345])
def test_the_variance_at_a_phase_is_over_one_sample_less_than_it_has_whether_samples_fall_on_phases_or_not(length):
    t = np.arange(1400) / 100
    x = np.sin(2 * np.pi * t / length) + np.random.default_rng(5).normal(size=len(t))
    phases = averaging.Phases(t, length, averaging.phases(length, 100))
    folded = phases.fold(x)
    assert phases.on_them == (length == 2.0)
    squares = np.bincount(phases.bins, folded.noise**2, phases.K)
    assert_allclose(folded.var * (folded.counts - 1), squares, rtol=1e-9)
    assert_allclose(np.bincount(phases.bins, folded.noise, phases.K), 0.0, atol=1e-9)


def test_noise_keeps_its_size_and_stays_white_at_a_period_of_no_whole_number_of_samples():
    t = np.arange(20_000) / 100
    x = np.random.default_rng(0).normal(size=len(t))
    folded = averaging.Phases(t, 1.2345, averaging.phases(1.2345, 100)).fold(x)
    degrees = len(t) - len(folded.mean)
    assert averaging.noise_std(folded) == pytest.approx(1.0, abs=4 / np.sqrt(2 * degrees))
    next_to = np.corrcoef(folded.noise[1:], folded.noise[:-1])[0, 1]
    assert abs(next_to) < 4 / np.sqrt(len(t))


def test_an_incomplete_last_period_is_left_out():
    [made], _ = run([arm.signal(periods=4.6)])
    assert made.periods == 4
    assert made.count.sum() == pytest.approx(4 * 1000, abs=1)


def test_a_wrong_stated_period_is_reported_and_not_used():
    [made], notes = run([arm.signal(period=6.4806)], period=1 / 0.18)
    assert made.period == pytest.approx(6.4806, abs=5 * made.period_std)
    assert made.stated_period == 1 / 0.18
    assert any("states a period of 5.55" in text and "6.4806" in text for note in notes for text in note.text)


def test_a_right_stated_period_is_not_remarked_on():
    _, notes = run([arm.signal()], period=10.0)
    assert not notes


def test_a_trajectory_whose_first_harmonic_is_nil_keeps_the_period_that_is_stated():
    [made], notes = run([arm.signal("instrument_slide")], period=5.0)
    assert made.period == pytest.approx(5.0, abs=1e-4)
    assert made.periods == 10
    assert not notes


@pytest.mark.parametrize("asked", [0, 2])
def test_a_motion_with_more_harmonics_than_its_joint_has_repeats_as_exactly(asked):
    """With the joint's two, the others would be taken for noise: the period off by 0.02 s, and periods left out."""
    length, noise = 6.4806, 1e-4
    t = np.arange(round(6 * length * 100)) / 100
    turn = 2 * np.pi / length * np.arange(1, 6)
    angle, size = np.outer(t, turn) + np.arange(5) ** 2, 0.5 / np.arange(1, 6)
    q, dq = np.sin(angle) @ size, np.cos(angle) @ (size * turn)
    random = np.random.default_rng(2).normal(size=(3, len(t)))
    zero = np.zeros(len(t), int)
    moved = replace(arm.signal("hand_roll"), t=t, q=q + noise * random[0], dq=dq + 1e-3 * random[1],
                    tau=0.3 * dq + 0.2 * np.sign(dq) + 0.01 * random[2], segment=zero, filled=zero)  # fmt: skip
    assert arm.ARM.joint("hand_roll").harmonics == 2
    made = list(average.run([moved], entry(), arm.ARM, harmonics=asked, lowpass=17.0))
    [found] = [record for record in made if isinstance(record, Average)]
    assert abs(found.period - length) < 6 * found.period_std < 6e-5
    assert (found.periods, found.t_start) == (6, 0.0)
    assert found.sigma_q == pytest.approx(noise, rel=0.2)


def test_the_joints_of_a_log_share_one_period_and_one_at_rest_is_noted():
    from dataclasses import replace

    roll, pitch = arm.signal("hand_roll"), arm.signal("hand_pitch")
    still = replace(
        arm.signal("instrument_slide", noise=0),
        at_rest=1,
        q=np.zeros(len(roll)) + 1e-6,
        t=roll.t,
        dq=roll.dq * 0,
        tau=roll.tau,
        segment=roll.segment,
        filled=roll.filled,
    )
    made, notes = run([roll, pitch, still])
    assert [a.joint for a in made] == ["hand_roll", "hand_pitch"]
    assert made[0].period == made[1].period
    assert "instrument_slide does not move: at rest" in str(notes[0].text)


@pytest.mark.parametrize(
    ("signals", "says"),
    [
        ([arm.signal("hand_roll", noise=0, periods=0.01)], "no joint moves"),
    ],
)
def test_a_log_in_which_nothing_moves_is_refused_by_name(signals, says):
    with pytest.raises(NotPeriodic, match=says):
        run(signals)


def test_a_log_that_does_not_repeat_is_not_averaged_and_says_so():
    made, [note] = run([arm.signal(periods=1.4)])
    assert made == []
    assert "run: 14.00 s contain no motion that repeats at least twice, so nothing is averaged" in note.text[0]


def test_a_stated_period_that_the_data_do_not_have_is_refused():
    with pytest.raises(NotPeriodic, match=r"the study states a period of 3\.0 s"):
        run([arm.signal(periods=1.4)], period=3.0)


def test_what_averaging_removes_is_the_noise():
    made = list(average.run([arm.signal(seed=3)], entry(), arm.ARM, harmonics=0, lowpass=17.0))
    [noise] = [r for r in made if isinstance(r, PeriodResidual)]
    [mean] = [r for r in made if isinstance(r, Average)]
    assert mean.sigma_tau == pytest.approx(arm.NOISE["hand_roll"], rel=4 / np.sqrt(2 * 9000))
    assert abs(noise.tau_noise.mean()) < 1e-12


def test_a_multiple_of_the_period_is_reported_and_not_used():
    [made], notes = run([arm.signal(period=5.0)], period=10.0)
    assert made.period == pytest.approx(5.0, abs=1e-3)
    assert any("repeat every 5.0000 s" in text for note in notes for text in note.text)


def test_a_joint_that_does_not_repeat_is_left_out_by_name_and_the_others_go_on():
    walk = np.cumsum(np.random.default_rng(0).normal(size=10_000)) / 100
    roll, pitch = arm.signal("hand_roll"), replace(arm.signal("hand_pitch"), q=walk)
    made, notes = run([roll, pitch])
    assert [a.joint for a in made] == ["hand_roll"]
    assert any("hand_pitch does not repeat, unlike the other joints" in text for note in notes for text in note.text)


def test_a_transient_in_one_period_is_remarked_on():
    roll = arm.signal("hand_roll")
    _, notes = run([replace(roll, q=roll.q + 0.002 * np.exp(-roll.t))])
    assert any(
        "the period from 0.00 to 10.00 s differs from the others" in text for note in notes for text in note.text
    )


def test_a_gap_lowers_the_counts_of_the_phases_that_it_covers():
    roll = arm.signal("hand_roll", periods=6)
    kept = (roll.t < 22) | (roll.t > 45)
    columns = {name: getattr(roll, name)[kept] for name in roll.columns()}
    columns["segment"] = (columns["t"] > 45).astype(int)
    [made], _ = run([replace(roll, gaps=1, **columns)])
    assert made.periods == 6
    assert made.count.max() <= 4
    assert made.count.min() >= 3


def test_leaving_a_group_out_is_averaging_the_others():
    t = np.arange(3000) / 100
    x = np.random.default_rng(0).normal(size=3000)
    for out, rest in enumerate(averaging.left_out(t, x, 5.0, 500, (t // 5).astype(int))):
        kept = x.reshape(6, 500)[[m for m in range(6) if m != out]]
        assert_allclose(rest.mean, kept.mean(axis=0), atol=1e-9)
        assert_allclose(rest.var, kept.var(axis=0, ddof=1), atol=1e-9)


@pytest.mark.parametrize("periods", [4, 5])
def test_the_alternating_mean_is_as_large_as_the_noise_in_the_mean(periods):
    """Of 2000 phases: the variance of a mean of so many samples, also where one of them has no opposite."""
    noise = np.random.default_rng(periods).normal(size=(periods, 2000))
    phased = averaging.Phases(np.arange(noise.size) * 0.01, 20.0, 2000)
    folded = averaging.Folded(noise.mean(0), noise.var(0), np.full(2000, periods), (noise - noise.mean(0)).ravel())
    made = averaging.alternating_mean(folded, phased)
    signs = np.where(np.arange(periods) % 2, -1.0, 1.0)[:, None]
    np.testing.assert_allclose(np.corrcoef(made, (signs * (noise - noise.mean(0))).sum(0))[0, 1], 1.0, rtol=1e-12)
    assert np.var(made) == pytest.approx(1 / periods, rel=4 * np.sqrt(2 / 2000))


def test_logs_of_other_roles_are_not_averaged():
    assert run([arm.signal()], role="validation") == ([], [])


@pytest.mark.parametrize(("samples", "rate", "start"), [(5000, 100.0, 0.0), (1300, 7.3, 40.0), (256, 5.0, -3.0)])
def test_evenly_sampled_harmonics_are_those_of_any_times(samples, rate, start):
    """The blocks that differ by a turn give what the normal equations of all samples do."""
    t = start + np.arange(samples) / rate
    omega, H = 2 * np.pi / 10.3, 9
    x = np.sin(omega * t) + np.random.default_rng(1).normal(size=samples)
    F = harmonics.basis(t, omega, H)
    even = harmonics.Harmonics(t, omega, H)
    c = even.project(x)
    assert harmonics.even_step(t) == pytest.approx(1 / rate)
    assert_allclose(c, np.linalg.lstsq(F, x, rcond=None)[0], atol=1e-12)
    assert_allclose(even.evaluate(c), F @ c, atol=1e-11)


def test_times_with_a_gap_or_a_shift_are_not_even():
    t = np.arange(5000) / 100
    for late in (t + 1e-5 * (np.arange(5000) > 4000), t + 1e-8 * np.sin(t), np.delete(t, slice(700, 720)), t[:200]):
        assert harmonics.even_step(late) == 0.0


@pytest.mark.parametrize(("errors", "excluded"), [(3.0, False), (5.0, True)])
def test_data_exclude_a_stated_period_where_chance_would_in_none_of_a_thousand_studies(errors, excluded):
    """Beyond three standard errors chance leads in one log of 370, beyond five in none of a million."""
    estimate = period.Period(2.0, 1e-5)
    used, remarks = average.reconcile_period(estimate, entry(period=2.0 + errors * 1e-5))
    assert used.length == (2.0 if excluded else 2.0 + errors * 1e-5)
    assert not remarks  # a period that is wrong by so little costs nothing
    assert average.reconcile_period(estimate, entry(period=2.1))[1]
