"""Where a motion repeats, how far, and which of its periods to trust: stops, transients, steps of the clock."""

import re
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter, sosfiltfilt

from davinci_forces.errors import NotPeriodic
from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.periods import harmonics, period
from davinci_forces.maths.periods.agreement import differing_periods, stretch
from davinci_forces.maths.periods.repetition import repetition, vertex
from davinci_forces.maths.signals.faults import REACH, steps
from davinci_forces.records import Average, Diagnostic, Fit, Signal, Trajectory
from davinci_forces.stages.model import fit
from davinci_forces.stages.recordings import average, differentiate
from davinci_forces.study import LogEntry
from tests import arm

RATE = 100.0


def moved(u, still=None, name="hand_roll", T=10.0, seed=0, noise=1.0) -> Signal:
    """A joint that at each sample is where its excitation is at the time u [s]; `still` says where it stands."""
    rng, rest = np.random.default_rng(seed), np.zeros(len(u), dtype=bool) if still is None else still
    q, dq, ddq = arm.excitation(name, u, T)
    dq, ddq = np.where(rest, 0.0, dq), np.where(rest, 0.0, ddq)
    tau = regressor(arm.joint(name).terms, q, dq, ddq) @ arm.THETA[name] + noise * arm.NOISE[name] * rng.normal(
        size=len(u)
    )
    q, dq = q + 1e-4 * rng.normal(size=len(u)), dq + 1e-3 * rng.normal(size=len(u))
    t = np.arange(len(u)) / RATE
    zero = np.zeros(len(u), int)
    columns = {"t": t, "q": q, "dq": dq, "tau": tau, "segment": zero, "filled": zero}
    return Signal("run", name, "identification", RATE, "as recorded", "logged", 0, 0, **columns)


def stopped(at, goes_on=True, rest=2.4, periods=5, **about) -> Signal:
    """Periods of 10 s with a rest inside, after which the motion goes on, or has gone on in the meantime."""
    t = np.arange(round((10.0 * periods + rest) * RATE)) / RATE
    still = (t >= at) & (t < at + rest)
    u = np.where(t < at, t, np.where(still, at, t - rest if goes_on else t))
    return moved(u, still, **about)


def entry(**changes) -> LogEntry:
    return LogEntry(**{"name": "run", "files": ("x",), "role": "identification", "channels": (), **changes})


def run(*signals, **changes) -> tuple[list[Average], list[str]]:
    made = list(average.run(signals, entry(**changes), arm.ARM, harmonics=0, lowpass=17.0))
    said = [text for record in made if isinstance(record, Diagnostic) for text in record.text]
    return [record for record in made if isinstance(record, Average)], said


def fitted(mean: Average) -> Fit:
    made = differentiate.run(mean, arm.joint(mean.joint), harmonics=0)
    [trajectory] = [record for record in made if isinstance(record, Trajectory)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fit, "ESTIMATORS", fit.ESTIMATORS[:1])  # the others are not asked for
        return next(record for record in fit.run([trajectory], [], arm.ARM, lowpass=17.0) if isinstance(record, Fit))


def stepped(signal: Signal, at: float, by: float) -> Signal:
    """The same motion on a clock that jumps, which makes two segments of it."""
    after = signal.t >= at
    return replace(signal, gaps=1, t=signal.t + np.where(after, by, 0.0), segment=after.astype(int))


def waves(t, T, amplitudes=(1.0, 0.5, 0.3)):
    return sum(a * np.sin(2 * np.pi * (k + 1) * t / T + k) for k, a in enumerate(amplitudes))


@pytest.mark.parametrize("orders", [2, 5])
def test_harmonics_that_the_motion_has_are_kept_unless_a_number_is_stated(orders):
    t = np.arange(5000) / RATE
    signal = moved(t)
    q = 0.3 * waves(t, 10.0, (1.0, 0.5, 0.3, 0.0, 0.05)[:orders])
    [mean], _ = run(replace(signal, q=q + 1e-4 * np.random.default_rng(1).normal(size=len(t))))
    for stated, kept, warned in ((0, orders, 0), (2, 2, int(orders == 5))):
        made = list(differentiate.run(mean, arm.joint("hand_roll"), harmonics=stated))
        [trajectory] = [record for record in made if isinstance(record, Trajectory)]
        assert trajectory.harmonics == kept
        assert np.ptp(trajectory.q - mean.q) < (0.25 if warned else 2e-3)
        assert len([record for record in made if isinstance(record, Diagnostic)]) == warned


def test_the_largest_harmonic_that_is_not_kept_is_named_with_its_share_and_none_where_all_are_kept():
    amplitude = np.array([9.0, 4.0, 1.0, 2.0])  # the mean first
    kept = {number: harmonics.largest_omitted(amplitude, number) for number in (1, 2, 3)}
    assert kept == {1: (3, 0.5), 2: (3, 0.5), 3: (0, 0.0)}
    assert harmonics.largest_omitted(0.0 * amplitude, 1) == (0, 0.0)


def test_noise_is_no_harmonic_however_large():
    x = waves(np.arange(1000) / RATE, 10.0) + 0.3 * np.random.default_rng(2).normal(size=1000)
    amplitude = harmonics.amplitudes(x)
    assert amplitude[4:].max() > 0.03
    assert harmonics.last_above(amplitude) == 3


STOPS = pytest.mark.parametrize("goes_on", [True, False], ids=["goes on", "has gone on"])


@STOPS
@pytest.mark.parametrize("at", [0.0, 5.0, 10.0, 20.0, 25.0, 27.4, 30.0, 40.0, 45.0, 50.0])
def test_a_stop_costs_what_it_covers_and_one_remark(at, goes_on):
    [made], said = run(stopped(at, goes_on))
    assert made.period == pytest.approx(10.0, abs=min(0.001, 5 * made.period_std))
    assert made.periods == max(int(at // 10), int((50 - at) // 10), 2)
    assert made.sigma_tau == pytest.approx(arm.NOISE["hand_roll"], rel=4 / np.sqrt(2 * 1000 * (made.periods - 1)))
    assert len(said) == 1
    assert "as in a stop, a ramp or another motion" in said[0]


@STOPS
@pytest.mark.parametrize("at", [0.0, 12.0, 25.0, 50.0])
def test_parameters_are_within_three_standard_errors_beside_a_stop(at, goes_on):
    [made], _ = run(stopped(at, goes_on))
    found = fitted(made)
    assert np.all(np.abs(found.theta - arm.THETA["hand_roll"]) < 3 * found.theta_std)


@pytest.mark.parametrize("at", [0.0, 25.0, 50.0])
def test_a_stated_period_is_honoured_beside_a_stop(at):
    [made], said = run(stopped(at), period=10.0)
    assert made.period == 10.0
    assert made.period_std > 0
    assert not any("the study states" in text for text in said)


def test_a_stated_period_that_the_data_exclude_is_not_used_even_where_it_needs_no_remark():
    [made], said = run(moved(np.arange(5000) / RATE, T=9.997), period=10.0)
    assert made.period == pytest.approx(9.997, abs=5 * made.period_std)
    assert not said


@pytest.mark.parametrize(("at", "key"), [(0.0, "skip"), (50.0, "until"), (25.0, "until"), (20.0, "skip")])
def test_what_a_remark_says_to_write_leaves_nothing_to_remark_on(at, key):
    signal = stopped(at)
    [before], [text] = run(signal)
    value = float(text.partition(f"write {key} = ")[2].partition(" ")[0])
    kept = signal.t >= value - 1e-9 if key == "skip" else signal.t <= value + 1e-9
    [after], said = run(replace(signal, **{name: getattr(signal, name)[kept] for name in signal.columns()}))
    assert not said
    assert (after.periods, after.t_start) == (before.periods, before.t_start)
    assert after.period == pytest.approx(before.period, rel=1e-12)


@pytest.mark.parametrize(
    ("duration", "rest", "severity"),
    [(2.5, 0.0, "note"), (2.5, 1.3, "note"), (10.0, 9.0, "note"), (10.0, 15.0, "warning")],
)
def test_a_rest_and_a_run_in_as_excite_designs_it_cost_no_period_and_no_warning(duration, rest, severity):
    s = np.arange(round(duration * RATE)) / RATE / duration
    phase = duration * (s**4 * (2.5 - 3 * s + s**2) - 0.5)  # along the same path, from rest to full speed at 0
    u = np.concatenate([np.full(round(rest * RATE), phase[0]), phase, np.arange(5000) / RATE])
    signal = moved(3.1 + u)  # from this place on, the slow part of a run-in repeats best, if samples are averaged
    records = list(average.run([signal], entry(), arm.ARM, harmonics=0, lowpass=17.0))
    assert [record.periods for record in records if isinstance(record, Average)] == [5]
    assert [list(record.severity) for record in records if isinstance(record, Diagnostic)] == [[severity]]


@pytest.mark.parametrize("T", [7.37, 13.1, 30.2])
@pytest.mark.parametrize("periods", [2.0, 2.05, 2.6, 6.3, 200.0])
def test_two_whole_periods_are_enough(T, periods):
    t = np.arange(round(periods * T * RATE)) / RATE
    found = repetition([waves(t, T) + 0.01 * np.random.default_rng(0).normal(size=len(t))])
    assert found is not None
    assert found.lag / RATE == pytest.approx(T, rel=3e-4)
    assert (found.start, found.stop) == pytest.approx((0, len(t)), abs=0.1 * len(t))


def test_less_than_two_periods_are_not_averaged_and_refused_where_a_period_is_stated():
    with pytest.raises(NotPeriodic, match=r"19.00 s contain no motion that repeats at least twice.*skip and until"):
        run(moved(np.arange(1900) / RATE), period=10.0)
    [note] = average.run([moved(np.arange(1900) / RATE)], entry(), arm.ARM, harmonics=0, lowpass=17.0)
    assert note.text[0].endswith("nothing is averaged; parameters are fitted to its low-passed samples")


@pytest.mark.parametrize("T", [100.7, 1000.3, 9999.0, 33_333.3])
def test_the_period_of_a_long_log_is_found_however_many_there_are_and_no_multiple_of_it(T):
    t = np.arange(300_000)
    found = repetition([waves(t, T) + 0.01 * np.random.default_rng(1).normal(size=len(t))])
    assert found is not None
    assert found.lag == pytest.approx(T, rel=1e-3)


def test_memory_and_work_of_a_search_grow_as_the_log_does():
    def most(N):
        x = waves(np.arange(N), 1000.3)
        tracemalloc.start()
        repetition([x])
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    assert most(800_000) < 5 * 8 * 800_000 + 2 * most(50_000)


@pytest.mark.parametrize("seed", range(10))
def test_motion_at_random_does_not_repeat(seed):
    from scipy.signal import butter

    rng = np.random.default_rng(seed)
    assert repetition([sosfiltfilt(butter(2, 0.02, output="sos"), rng.normal(size=6000))]) is None
    assert repetition([np.cumsum(rng.normal(size=6000))]) is None


def test_a_period_that_changes_halfway_is_that_of_the_longer_part_and_said_to_be():
    t = np.arange(9000) / RATE
    u = np.where(t < 50.0, t, 50.0 + (t - 50.0) * 10.0 / 8.0)
    [made], [text] = run(moved(u))
    assert made.period == pytest.approx(10.0, abs=5 * made.period_std)
    assert made.periods == 5
    assert re.search(r"the 39\.\d\d s after 5\d\.\d\d s do not repeat, as in a stop", text)


@pytest.mark.parametrize("symbol", ["q", "dq", "tau"])
@pytest.mark.parametrize("periods", [4, 10])
def test_a_transient_at_the_start_is_left_out_whichever_quantity_shows_it(symbol, periods):
    """Of a size that its period's noise is some three times that of the others."""
    signal = moved(np.arange(1000 * periods) / RATE)
    size = {"q": 1e-4, "dq": 1e-3, "tau": arm.NOISE["hand_roll"]}[symbol]
    late = replace(signal, **{symbol: getattr(signal, symbol) + 12 * size * np.exp(-signal.t / 1.5)})
    [made], [text] = run(late)
    assert made.periods == periods - 1
    assert made.t_start == pytest.approx(10.0, abs=0.011)
    assert re.search(rf"differs from the others in {symbol} of hand_roll by \d+\.\d times what noise explains", text)
    averaged = f"Averages are of {periods - 1} whole periods, 10.00 to {10 * periods}.00 s"
    assert f"{averaged}; the chosen model is fitted to all motion. Only if something touched the arm" in text
    assert "write skip = 10 in study.toml" in text
    degrees = 1000 * (periods - 2)
    assert getattr(made, f"sigma_{symbol}") == pytest.approx(size, rel=4 / np.sqrt(2 * degrees))


def test_a_derived_velocity_that_errs_at_the_ends_leaves_out_no_period():
    signal = moved(np.arange(6000) / RATE)
    ends = np.exp(-signal.t / 1.5) + np.exp((signal.t - signal.t[-1]) / 1.5)
    [made], texts = run(replace(signal, velocity="derived", dq=signal.dq + 0.012 * ends))
    assert (made.periods, texts) == (6, [])


def test_what_does_not_fill_a_period_is_left_out_at_the_start_before_a_period_is():
    signal = moved(np.arange(5600) / RATE)
    late = replace(signal, tau=signal.tau + 5 * np.exp(-signal.t / 0.7))
    [made], [text] = run(late)
    assert made.periods == 5
    assert made.t_start == pytest.approx(6.0, abs=0.011)
    assert "the period from 0.00 to 10.00 s differs" in text
    assert "Averages are of 5 whole periods, 6.00 to 56.00 s" in text
    assert "write skip = 6 in study.toml" in text


def test_a_rest_and_a_slow_start_are_not_said_to_be_longer_than_they_are():
    """Rest of 2 s and a run-in of 3 s, then 5.7 periods: the whole ones are at the end."""
    t = np.arange(6200) / RATE
    signal, eased = moved(t), np.clip((t - 2.0) / 3.0, 0.0, 1.0)
    made, texts = run(replace(signal, q=eased * signal.q, dq=eased * signal.dq, tau=eased * signal.tau))
    assert [of.periods for of in made] == [5]
    [text] = texts
    [(duration, start)] = re.findall(r"the (\d\.\d\d) s before (\d\.\d\d) s do not repeat", text)
    assert 3.0 < float(start) < 5.05
    assert duration == start
    assert "differs" not in text or f"the period from {start} to {float(start) + 10:.2f} s differs" in text


def test_an_odd_period_among_others_is_named_and_kept():
    signal = moved(np.arange(8000) / RATE)
    push = np.where((signal.t > 33) & (signal.t < 36), 1.0, 0.0)
    [made], [text] = run(replace(signal, tau=signal.tau + push))
    assert made.periods == 8
    assert "the period from 30.00 to 40.00 s differs from the others in tau of hand_roll by" in text
    assert "is kept, because it is not at an end" in text
    assert text.endswith("Averages are of 8 whole periods, 0.00 to 80.00 s")
    assert "study.toml" not in text


@pytest.mark.parametrize(("rho", "periods"), [(0.0, 3), (0.0, 5), (0.9, 3), (0.9, 5), (0.99, 5)])
def test_correlated_noise_is_no_transient(rho, periods):
    """Slower noise is mistaken for one: three periods of a correlation of 0.99 hold some ten independent samples each,
    and one of them is left out in one recording of fifteen."""
    flagged = 0
    for seed in range(60):
        t = np.arange(1000 * periods) / RATE
        x = waves(t, 10.0) + 0.01 * coloured(np.random.default_rng(seed), len(t), rho)
        flagged += bool(differing_periods(t, [x], 10.0, RATE))
    assert flagged <= 2


def coloured(rng, N, rho):
    """Noise of unit variance and this correlation from sample to sample."""
    return lfilter([1], [1, -rho], rng.normal(size=N + 3000))[3000:] * np.sqrt(1 - rho**2)


def test_intervals_of_the_period_cover_whatever_the_colour_of_the_noise():
    """Pooled over colours and lengths; each setting by itself within what 100 draws allow around 88 to 100 %."""
    T, inside = 10.0, []
    for periods in (2, 3, 4.63, 10):
        for rho in (0.0, 0.9, 0.99):
            t = np.arange(int(periods * T * 50)) / 50
            for seed in range(100):
                rng = np.random.default_rng(seed)
                x = waves(t, T, (1.0, 0.4)) + 0.01 * coloured(rng, len(t), rho)
                length = period.refine(t, [x], T, 2)
                inside.append(abs(length - T) < 1.96 * period.standard_error(t, [x], length, 2))
    settings = np.mean(np.reshape(inside, (-1, 100)), axis=1)
    assert np.mean(inside) == pytest.approx(0.95, abs=0.02)
    assert settings.min() > 0.85


def test_noise_that_joints_share_is_not_counted_as_twice_the_knowledge():
    T, t, z = 10.0, np.arange(2500) / 50, []
    for seed in range(150):
        rng = np.random.default_rng(seed)
        shared = 0.01 * coloured(rng, len(t), 0.9)
        signals = [waves(t, T) + shared] * 4
        length = period.refine(t, signals, T, 3)
        z.append((length - T) / period.standard_error(t, signals, length, 3))
    assert np.std(z) < 1.25


@pytest.mark.parametrize("rho", [0.0, 0.99])
def test_an_interval_of_the_period_needs_neither_every_sample_nor_every_line_of_the_spectrum(rho, monkeypatch):
    """Of a prime number of samples some are left out; the slope has 3e-4 of its power at the lines that are."""
    T, t = 10.0, np.arange(100_003) / 50
    x = waves(t, T) + 0.01 * coloured(np.random.default_rng(0), len(t), rho)
    few = period.standard_error(t, [x], T, 3)
    monkeypatch.setattr(period, "LINES_BESIDE", len(t))
    monkeypatch.setattr("scipy.fft.prev_fast_len", lambda N, real: N)
    assert few == pytest.approx(period.standard_error(t, [x], T, 3), rel=0.01)


@pytest.mark.parametrize("by", [2.5, 3.0, 5.0, 1.7e9])
@pytest.mark.parametrize("at", [8.0, 23.45, 40.0])
def test_a_step_of_the_clock_costs_the_shorter_side_at_most(by, at):
    """As averaging sees it where reading could not mend it; 5 s are a whole period, across which the phase holds."""
    signal = moved(np.arange(5000) / RATE, T=5.0)
    tracemalloc.start()
    [made], said = run(stepped(signal, at, by))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert made.period == pytest.approx(5.0, abs=5 * made.period_std)
    found = fitted(made)
    assert np.all(np.abs(found.theta - arm.THETA["hand_roll"]) < 3 * found.theta_std)
    assert peak < 50e6
    if by != 5.0:
        [text] = said
        assert made.periods == int(max(at, 50 - at) // 5)
        gap = f"{by + 0.01:.4g} s at {at - 0.01:.2f} s"
        assert f"after the clock's gap of {gap}, the motion does not continue in phase" in text


def test_a_step_of_the_clock_that_leaves_less_than_two_periods_is_refused():
    signal = moved(np.arange(2500) / RATE)
    with pytest.raises(NotPeriodic):
        run(stepped(signal, 12.5, 3.0), period=10.0)


@pytest.mark.parametrize("name", ["hand_roll", "hand_pitch"])
@pytest.mark.parametrize("by", [0.05, 2.5, 3.0, 1.7e9])
def test_steps_are_told_from_gaps_wherever_the_joint_moves(name, by):
    signal = moved(np.arange(3000) / RATE, name=name)
    speed = np.abs(arm.excitation(name, signal.t, 10.0)[1])
    for i in range(100, 2900, 173):
        t = signal.t + np.where(np.arange(3000) < i, 0.0, by)
        found = steps(t, signal.q[None])
        if speed[i] > 0.1:
            [(at, jump)] = found
            assert at == i
            assert jump == pytest.approx(by, abs=1e-6 * max(1.0, 1e-7 * by / 1e-6))
        lost = np.delete(np.arange(3000), np.arange(i, min(i + 31, 2990)))
        assert not steps(signal.t[lost], signal.q[None, lost])


def test_nothing_is_said_of_a_gap_at_rest_or_at_an_end():
    signal = moved(np.arange(3000) / RATE)
    still = np.full((1, 3000), 0.3) + 1e-4 * np.random.default_rng(0).normal(size=3000)
    at_rest = [(i, still) for i in range(100, 2900, 100)]
    for i, x in (*at_rest, (REACH - 1, signal.q[None]), (3000 - REACH + 1, signal.q[None])):
        assert not steps(signal.t + np.where(np.arange(3000) < i, 0.0, 3.0), x)


@pytest.mark.parametrize("lost", [3, 5, 8, 12, 30])
def test_few_lost_samples_are_a_gap_even_where_a_noisy_motion_turns(lost):
    signal = moved(np.arange(5000) / RATE, T=5.0)
    q = signal.q + 1e-3 * np.random.default_rng(3).normal(size=5000)
    for i in range(100, 4900, 7):
        kept = np.delete(np.arange(5000), np.arange(i, i + lost))
        assert not steps(signal.t[kept], q[None, kept])


def test_one_joint_that_breaks_says_that_time_passed():
    roll, pitch = moved(np.arange(3000) / RATE), moved(np.arange(3000) / RATE, name="hand_pitch")
    broken = pitch.q + np.where(np.arange(3000) < 1200, 0.0, 0.05)
    t = roll.t + np.where(np.arange(3000) < 1200, 0.0, 3.0)
    assert steps(t, np.array([roll.q, pitch.q]))
    assert not steps(t, np.array([roll.q, broken]))


def test_a_joint_at_rest_at_zero_beside_one_that_moves_is_no_division_by_zero():
    signal = arm.signal("hand_roll", noise=0)
    t = signal.t + np.where(np.arange(len(signal.t)) < 1000, 0.0, 3.0)
    with np.errstate(all="raise"):
        assert steps(t, np.array([signal.q, 0 * signal.q])) == steps(t, signal.q[None])


def test_a_glitch_is_not_the_end_of_a_motion():
    t = np.arange(4000) / RATE
    x = waves(t, 8.0)
    x[[333, 2900, 2901, 3500]] += 0.5
    span, _ = stretch(t, [x], 8.0, slice(800, 2400), 3)
    assert (span.start, span.stop) == (0, 4000)


def test_no_motion_is_followed_across_a_gap_beyond_which_its_phase_is_not_known():
    """Even where it happens to be right there: so many periods later, it can only be by chance."""
    t = np.arange(6000) / RATE
    x = waves(t, 8.0) + 1e-3 * np.random.default_rng(0).normal(size=6000)
    length = period.refine(t[:3000], [x[:3000]], 8.0, 3)
    for gap, bridged in ((1000, True), (100_000_000, False)):
        late = t + np.where(t < 30.0, 0.0, gap * length)
        span, _ = stretch(late, [x], 8.0, slice(0, 3000), 3)
        assert (span.stop > 3000) == bridged


@pytest.mark.parametrize(("start", "stop"), [(700, 5200), (123, 4001), (0, 5555), (1900, 3800)])
def test_a_stretch_ends_to_the_sample_where_the_motion_is_a_hundredth_away(start, stop):
    t = np.arange(6000) / RATE
    clean = waves(t, 8.0)
    held = np.where(t < t[start], clean[start], np.where(t < t[stop], clean, clean[stop]))
    away = np.abs(held - clean) > 0.01 * clean[start:stop].std()
    x = held + 1e-4 * np.random.default_rng(0).normal(size=6000)
    span, length = stretch(t, [x], 8.0, slice(2000, 3600), 3)
    before, after = np.flatnonzero(away[:start]), stop + np.flatnonzero(away[stop:])
    assert span.start == pytest.approx(before[-1] + 1 if len(before) else 0, abs=3)
    assert span.stop == pytest.approx(after[0], abs=3)
    assert length == pytest.approx(8.0, abs=5 * period.standard_error(t[span], [x[span]], length, 3))


@pytest.mark.parametrize("at", [-0.9, -0.2, 0.0, 0.4])
def test_the_lowest_point_between_neighbours_is_that_of_the_parabola_through_them(at):
    y = [2.0 * (x - at) ** 2 + 0.5 for x in (-1.0, 0.0, 1.0)]
    assert vertex(*y) == (pytest.approx(at), pytest.approx(0.5))


def test_the_lowest_point_is_no_further_than_the_neighbours_and_none_where_a_parabola_has_none():
    shift, lowest = vertex(4.0, 2.0, 0.5)  # the parabola is lowest at 3.5
    assert (shift, lowest) == (1.0, pytest.approx(0.5))
    assert vertex(1.0, 2.0, 1.0) == (0.0, 2.0)
    assert vertex(2.0, 0.1, 0.2)[1] == 0.0  # a squared difference is not negative
