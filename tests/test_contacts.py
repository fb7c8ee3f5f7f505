"""Contacts and the free space that they are judged by, on efforts whose peak, mean and level are known."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import lfilter

from davinci_forces.maths.contact import detection
from davinci_forces.maths.contact.detection import (
    FALSE_ALARMS,
    Event,
    alarm_level,
    events,
    free_motion_statistics,
    mean_size,
    narrower_means,
)
from davinci_forces.maths.periods.shift import likeness, most_different
from davinci_forces.maths.signals.smoothing import lowpass, lowpass_segments, noise_std, share_passed
from davinci_forces.maths.signals.whiteness import acf1_std, autocorrelation, moment_std, shape
from davinci_forces.maths.signals.windows import free_space
from davinci_forces.maths.uncertainty import bootstrap
from davinci_forces.maths.uncertainty.bootstrap import (
    blocks,
    error_of_mean,
    error_of_pooled_mean,
    error_of_quantile,
    model_error,
    root_mean_square,
    standard_error,
)
from davinci_forces.maths.uncertainty.error_band import day_offset, levels
from davinci_forces.records import Contact, Diagnostic, Threshold, Track
from davinci_forces.report.sections.contacts import largest
from davinci_forces.stages.forces import assess, measure
from tests import arm
from tests.report.report_records import free_space as free_space_record
from tests.test_averaging import entry

RATE = 100.0
T = np.arange(4000) / RATE


def track(tau_ext, std=0.1, joint="hand_roll", log="push", role="contact", at_rest=0, standing=None, **more) -> Track:
    zero = np.zeros_like(T)
    efforts = {
        "tau_ext": tau_ext,
        "tau_ext_direct": tau_ext,
        "tau_ext_smooth": tau_ext,
        "tau_ext_std": zero + std,
        "tau_ext_smooth_std": zero + std,
    }
    standing = np.full(len(T), at_rest) if standing is None else standing.astype(int)
    more = {"dq": zero} | more
    columns = dict.fromkeys(Track.columns(), zero) | {"t": T, "dq": more.pop("dq"), "standing": standing, **efforts}
    scalars = dict.fromkeys(Track.scalars(), 0.0) | {"at_rest": at_rest, "rate": RATE, "filter": "ekf"} | more
    return Track(**columns, **scalars | {"log": log, "joint": joint, "role": role, "model": "m", "estimator": "e"})


def measured(track_, thresholds, about):
    """What the stage makes of a track."""
    return list(measure.run(track_, thresholds, about, arm.ARM))


def noise(seed=0, std=0.1):
    return std * np.random.default_rng(seed).normal(size=len(T))


def test_levels_of_white_noise_are_those_of_the_normal_distribution():
    found = levels(noise(), np.full(len(T), 0.1))
    # The density at the 99 % level is 0.0578 / 0.2 of |x|: a quantile's standard error is sqrt(p (1 - p) / N) over it.
    assert found.free_rms == pytest.approx(0.1, abs=4 * 0.1 / np.sqrt(2 * len(T)))
    assert found.free_level == pytest.approx(0.196, abs=0.012)
    assert found.detection_level == pytest.approx(0.2576, abs=0.02)
    assert found.coverage == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / len(T)))
    assert found.coverage_std == pytest.approx(np.sqrt(0.95 * 0.05 / len(T)), rel=0.5)
    assert found.free_rms_std == pytest.approx(0.1 / np.sqrt(2 * len(T)), rel=0.5)


def test_a_band_that_is_half_as_wide_covers_two_thirds():
    assert levels(noise(), np.full(len(T), 0.05)).coverage == pytest.approx(0.673, abs=0.03)


def test_the_block_bootstrap_knows_that_correlated_samples_say_less():
    """An autoregression of 0.95 has a mean as uncertain as 1/39 of the samples would leave it."""
    rng, x = np.random.default_rng(3), np.zeros(20_000)
    for k in range(1, len(x)):
        x[k] = 0.95 * x[k - 1] + rng.normal()
    means = [float(x[part].mean()) for part in blocks(len(x))]
    true = np.sqrt((1 + 0.95) / (1 - 0.95) / len(x)) / np.sqrt(1 - 0.95**2)
    found = standard_error(lambda parts: float(np.mean(parts)), means)
    assert error_of_mean(means) == pytest.approx(found, rel=1e-12)
    assert found == pytest.approx(true, rel=4 / np.sqrt(2 * len(means)))


def test_standard_errors_of_errors_and_moments_are_what_they_scatter_by():
    """Autoregressions of .6, over 200 seeds: what is stated, against what comes out."""
    e, y = (lfilter([1.0], [1.0, -0.6], np.random.default_rng(s).normal(size=(200, 2000)))[:, 100:] for s in (1, 2))
    pairs = {
        "rmse": [root_mean_square(x) for x in e],
        "relative": [root_mean_square(x, 3.0 * scale) for x, scale in zip(e, y, strict=True)],
        "model error": [model_error(x, 0.5) for x in e],
        "acf1": [(r := float(autocorrelation([x], 1)[1]), acf1_std(r, len(x))) for x in e],
        "skewness": [(shape(x)[0], moment_std(3, 0.6, len(x))) for x in e],
        "kurtosis": [(shape(x)[1], moment_std(4, 0.6, len(x))) for x in e],
    }
    for name, numbers in pairs.items():
        value, std = np.array(numbers).T
        # The standard deviation of 200 is known to 5 %; 20 blocks of 95 samples miss 4 % of the correlation.
        assert np.sqrt(np.mean(std**2)) == pytest.approx(value.std(), rel=4 * 0.05), name


@pytest.mark.parametrize("samples", [2, 33, 1000, 4321])
def test_standard_errors_of_many_draws_at_once_are_those_of_one_draw_after_the_other(samples):
    x = np.random.default_rng(samples).standard_normal(samples).round(2)
    parts = [x[part] for part in blocks(samples)]
    for share in (0.5, 0.95, 0.99):
        found = standard_error(lambda drawn, share=share: float(np.quantile(np.concatenate(drawn), share)), parts)
        assert error_of_quantile(x, share) == pytest.approx(found, rel=1e-12)
    found = standard_error(lambda drawn: float(np.sqrt(np.mean(np.concatenate(drawn) ** 2))), parts)
    assert error_of_pooled_mean(x**2, function=np.sqrt) == pytest.approx(found, rel=1e-12)
    assert np.isnan(error_of_pooled_mean(x[:1]))
    assert np.isnan(error_of_quantile(x[:1], 0.5))


def summarise(t, effort, window, free, rise, constant=None):
    """The summary of a window, where free motion tells what noise adds to narrower means."""
    return detection.summarise(t, effort, window, free, rise, narrower_means(t, effort[2], free, rise), constant)


def test_a_triangle_has_its_peak_mean_and_impulse():
    push = 3.0 * np.clip(1 - np.abs(T - 10.0), 0, None)
    free = free_space(T, [(9.0, 11.0)], RATE)
    found = summarise(
        T, (noise(std=0.02) + push, np.full(len(T), 0.05), noise(std=0.02) + push), (9.0, 11.0), free, rise=0.0
    )
    assert found.peak == pytest.approx(3.0, abs=4 * 0.02)
    assert found.mean == pytest.approx(1.5, abs=0.02)
    assert found.impulse == pytest.approx(3.0, abs=0.04)
    # The largest of 201 samples of noise is 2.8 of its deviations on average; the effort's own deviation counts, too.
    assert found.peak_std == pytest.approx(np.hypot(0.05, 2.8 * 0.02), rel=0.1)
    assert found.mean_std == pytest.approx(0.02 / np.sqrt(201), rel=0.5)
    assert found.impulse_std == pytest.approx(2.0 * found.mean_std)


@pytest.mark.parametrize("rate", [20.0, 50.0, 1000.0])
@pytest.mark.parametrize("start", [9.5, 9.513])
def test_an_impulse_does_not_depend_on_the_rate_or_on_where_the_window_meets_the_samples(rate: float, start: float):
    t = np.arange(0.0, 20.0, 1.0 / rate)
    push = np.where(np.abs(t - 10.0) < 0.25, np.cos(np.pi * (t - 10.0) / 0.5), 0.0)
    for effort, impulse in ((push, 1.0 / np.pi), (np.full(len(t), 2.0), 2.0)):  # .5 s of a half-sine, a constant
        summary = summarise(t, (effort, 0.0 * t, effort), (start, start + 1.0), t < 5.0, rise=0.1)
        assert summary.impulse == pytest.approx(impulse, rel=0.01)


def test_the_mean_of_unevenly_spaced_samples_is_over_time():
    """A ramp from 0 to 2 within [10, 12] s, of which the first half has ten times as many samples."""
    t = np.concatenate([np.arange(0.0, 11.0, 0.01), np.arange(11.0, 14.0, 0.1)])
    ramp = np.clip(t - 10.0, 0.0, 2.0)
    found = summarise(t, (ramp, 0.0 * t, ramp), (10.0, 12.0), t < 5.0, rise=0.0)
    assert found.mean == pytest.approx(1.0, abs=0.003)
    late = summarise(t, (ramp, 0.0 * t, ramp), (10.0, 11.95), t < 5.0, rise=0.0)  # ends between two samples
    assert late.mean == pytest.approx(0.975, abs=0.005)


def rounded_triangle(std=0.0):
    """A triangle of slope 3 under two-sided exponential weights with a rise of .2 s, which take .3; and as measured."""
    weights = np.exp(-np.abs(np.arange(-200, 201)) / RATE / 0.1)
    push = 3.0 * np.clip(1 - np.abs(T - 10.0), 0, None)
    return np.convolve(push, weights / weights.sum(), "same"), push + noise(std=std)


def test_what_a_smoother_rounds_off_a_peak_is_in_its_standard_error():
    """Noise as large as this allows no narrower mean: half of the tip, with half of it as its error."""
    smooth, direct = rounded_triangle(std=5.0)
    found = summarise(
        T, (smooth, np.full(len(T), 0.01), direct), (9.0, 11.0), free_space(T, [(9.0, 11.0)], RATE), rise=0.2
    )
    assert 3.0 - found.largest == pytest.approx(0.3, rel=0.05)
    assert found.peak - found.largest == pytest.approx(0.15, rel=0.1)
    assert found.peak_std == pytest.approx(3.0 - found.peak, rel=0.1)
    assert found.t_peak == pytest.approx(10.0)


@pytest.mark.parametrize(("std", "error"), [(0.0, 0.05), (0.05, 0.15)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_peak_is_that_of_the_measured_effort_as_far_as_its_noise_allows(sign, std, error):
    smooth, direct = rounded_triangle(std)
    effort = (sign * smooth, np.full(len(T), 0.01), sign * direct)
    found = summarise(T, effort, (9.0, 11.0), free_space(T, [(9.0, 11.0)], RATE), rise=0.2)
    assert found.peak_std < error
    assert abs(found.peak - sign * 3.0) < 1.5 * found.peak_std


def test_a_bias_in_free_space_makes_means_uncertain_however_long_they_are():
    free = np.ones(len(T), bool)
    assert mean_size(noise() + 0.5, free, 1000) == pytest.approx(0.5, abs=0.02)
    assert np.isnan(mean_size(noise(), ~free, 10))
    assert summarise(T, (noise(), noise() ** 2, noise()), (100.0, 101.0), free, 0.0) is None


def test_free_space_leaves_out_what_still_settles():
    free = free_space(np.append(T, T + 60.0), [(9.0, 11.0)], RATE)
    t = np.append(T, T + 60.0)
    for start, end in ((0.0, 0.99), (9.0, 12.0), (60.0, 60.99)):
        assert not free[(t >= start) & (t <= end)].any()
    assert free[(t > 1.0) & (t < 9.0)].all()
    assert free[(t > 61.01) & (t < 90.0)].all()


def test_a_contact_stands_out_when_its_peak_exceeds_the_level_of_unseen_free_space():
    windows = ((9.0, 11.0), (20.0, 21.0))
    push = np.where((T >= 9) & (T <= 11), 2.0, 0.0)
    spaces = [
        *assess.run(track(noise(1), log="check", role="validation"), entry(role="validation"), arm.ARM),
        *assess.run(track(noise(2, 5.0), log="fitted", role="identification"), entry(role="identification"), arm.ARM),
        *assess.run(track(noise(3, 9.0), joint="hand_pitch", role="validation"), entry(role="validation"), arm.ARM),
    ]
    [contact] = measured(track(noise(0) + push), assess.gather(spaces), entry(role="contact", contact=windows))
    assert contact.level_from == "check"  # neither what was fitted nor another joint
    assert list(contact.above) == [1, int(abs(contact.peak[1]) > contact.detection_level)]
    assert contact.peak[0] == pytest.approx(2.0, abs=0.5)
    assert contact.mean[0] == pytest.approx(2.0, abs=0.05)
    keys = {number.key for number in contact.published()}
    assert {"contact.push.hand_roll.1.peak", "contact.push.hand_roll.2.impulse"} <= keys


def test_a_push_that_is_held_reads_its_level_in_the_middle_of_the_contact():
    """A push of 5 for 4 s, ramps of .5 s included, in a stated window that is far wider, and one that nobody stated."""
    held = 5.0 * np.clip(np.minimum(T - 10.0, 14.0 - T) / 0.5, 0.0, 1.0)
    space, *_ = assess.run(track(noise(1), log="check", role="validation"), entry(role="validation"), arm.ARM)
    for windows in ((), ((8.0, 17.0),)):
        about = entry(role="contact", contact=windows)
        [contact] = measured(track(noise() + held), assess.gather([space]), about)
        assert contact.middle_mean[0] == pytest.approx(5.0, abs=3 * contact.middle_mean_std[0])
        assert 0.0 < contact.middle_mean_std[0] < 0.1
        assert contact.mean[0] < 4.6
        assert abs(contact.peak[0] - 5.0) > 3 * contact.middle_mean_std[0]


def test_the_error_of_the_middle_of_a_triangle_contains_those_of_onset_and_release():
    """Of a push that is held the middle does not depend on them; of a triangle it does."""
    edges, none = Event(19.0, 0.2, 21.0, 0.1), Event(19.0, 0.0, 21.0, 0.0)
    held, triangle = 3.0 * (np.abs(T - 20.0) < 1.5), 3.0 * np.clip(1 - np.abs(T - 20.0), 0, None)
    free = np.abs(T - 20.0) > 2.0
    for push, by_onset, by_release in ((held, 0.0, 0.0), (triangle, 0.072, 0.037)):  # half of the change of the mean
        of = track(noise(std=0.02) + push, std=0.02)
        value, std = measure.middle_effort(of, edges, free, 0.0 * T)
        known, least = measure.middle_effort(of, none, free, 0.0 * T)
        assert value == known
        assert np.sqrt(std**2 - least**2) == pytest.approx(np.hypot(by_onset, by_release), abs=0.01)


def test_a_peak_is_no_smaller_than_the_means_which_nothing_smooths():
    """A tap of a fifth of a second, of which the smoother leaves a part."""
    tap = noise() + 3.0 * np.exp(-(((T - 20.0) / 0.12) ** 2))
    space, *_ = assess.run(track(noise(1), log="check", role="validation"), entry(role="validation"), arm.ARM)
    smoothed = replace(track(noise() + tap / 2), tau_ext_direct=tap)
    [contact] = measured(smoothed, assess.gather([space]), entry(role="contact", contact=((19.8, 20.2),)))
    assert contact.mean[0] < contact.middle_mean[0] == contact.peak[0]


def test_the_last_half_second_of_a_log_is_no_touch_and_raises_no_level():
    """There the low-pass of the motion errs; a second earlier the same effort is a touch."""
    rush = noise() + np.where(np.arange(len(T)) >= len(T) - 20, 3.0, 0.0)
    for tau_ext, counts in ((rush, False), (np.roll(rush, -100), True)):
        about = track(tau_ext, role="validation", dq=np.ones(len(T)))
        space, _, *said = assess.run(about, entry(role="validation"), arm.ARM)
        assert bool(said) == counts
        assert (space.free_max > 2.0) == counts


@pytest.mark.parametrize(("role", "end", "is_told"), [("validation", 39.0, True), ("validation", 12.0, False),
                                                      ("contact", 39.0, False)])  # fmt: skip
def test_a_log_of_validation_whose_offset_is_of_all_its_samples_tests_too_little(role, end, is_told):
    about = entry(role=role, free=((0.0, end),))
    made = assess.run(track(noise(), role=role, dq=np.ones(len(T))), about, arm.ARM)
    said = [text for record in made if isinstance(record, Diagnostic) for text in record.text]
    assert any("`free` covers 98% of the log" in text for text in said) == is_told


def test_no_level_is_that_of_a_joint_at_rest_or_of_a_contact_log_without_windows():
    assert not list(assess.run(track(noise(), at_rest=1), entry(role="contact", contact=((9.0, 11.0),)), arm.ARM))
    assert not list(assess.run(track(noise()), entry(role="contact"), arm.ARM))
    space, _ = assess.run(track(noise()), entry(role="validation"), arm.ARM)
    about = entry(role="contact", contact=((9.0, 11.0),))
    assert measured(track(noise()), assess.gather([space]), about)
    [hidden] = measured(track(noise(), at_rest=1, static_friction=0.8), assess.gather([space]), about)
    assert "the joint is at rest, so static friction hides a contact of up to 0.8 N m" in hidden.text[0]
    push = np.where((T >= 9.0) & (T <= 11.0), 3.0, 0.0)
    _, contact = measured(track(noise() + push, at_rest=1, static_friction=0.8), assess.gather([space]), about)
    assert (len(contact), contact.found[0], contact.above[0]) == (1, 1, 1)


def test_an_impulse_holds_what_the_smoother_spreads_out_of_the_window():
    """Half a wave as long as the smoother's rise: smoothed, a fourth of its impulse lies outside the window."""
    push = 8.0 * np.where((T >= 20.0) & (T <= 20.2), np.sin(np.pi * (T - 20.0) / 0.2), 0.0)
    direct = push + noise(std=0.05)
    found = summarise(T, (smoothed(push, 0.2), 0.0 * T, direct), (20.0, 20.2), T < 15.0, rise=0.2)
    assert found.impulse == pytest.approx(8.0 * 0.2 * 2 / np.pi, abs=3 * found.impulse_std)
    assert found.impulse_std < 0.01


def test_few_free_windows_widen_the_error_of_a_mean_as_student_says():
    few, many = (summarise(T, (noise(),) * 3, (30.0, 33.0), end > T, rise=0.0) for end in (6.0, 29.0))
    size = [mean_size(noise(), end > T, 301) for end in (6.0, 29.0)]
    assert few.mean_std / size[0] == pytest.approx(12.706 / 1.96, rel=1e-3)  # one window, and no whole second one
    assert many.mean_std / size[1] == pytest.approx(2.262 / 1.96, rel=1e-3)  # nine


def test_noise_is_told_from_the_error_of_a_model():
    """Of white noise and a slow error, each is found, in the presence of a few jumps."""
    segment, error = np.zeros(len(T), int), 0.05 * np.sin(2 * np.pi * 0.4 * T)
    jumps = np.where(np.arange(len(T)) % 500 == 0, 1.0, 0.0)
    residual = noise(std=0.2) + error
    assert noise_std(residual + jumps, segment, RATE, 17.0) == pytest.approx(0.2, rel=0.05)
    slow = lowpass_segments(residual, segment, RATE, 17.0)
    found, std = model_error(slow, 0.2 * np.sqrt(share_passed(RATE, 17.0)))
    assert found == pytest.approx(0.05 / np.sqrt(2), abs=4 * std)
    assert std < 0.02
    none, bound = model_error(
        lowpass_segments(noise(std=0.2), segment, RATE, 17.0), 0.2 * np.sqrt(share_passed(RATE, 17.0))
    )
    assert none <= 3 * bound


def test_the_share_that_passes_is_that_of_white_noise():
    x = np.random.default_rng(0).normal(size=200_000)
    assert lowpass(x, RATE, 17.0).var() == pytest.approx(share_passed(RATE, 17.0), rel=0.02)
    assert share_passed(RATE, 45.0) == 1.0


@pytest.mark.parametrize(("shift", "same"), [(0.0, True), (3.7, True), (None, False)])
def test_the_same_path_is_recognised_wherever_it_starts(shift, same):
    t, length = np.arange(3000) / RATE, 6.5
    phase = 2 * np.pi / length

    def path(at):
        return np.sin(phase * at) + 0.5 * np.cos(2 * phase * at + 1) + 0.3 * np.sin(5 * phase * at)

    q = path(t + shift) if shift is not None else np.sin(phase * 1.31 * t) + 0.5 * np.cos(2.1 * phase * t)
    found = likeness(t, q, path(np.arange(650) / 650 * length), length)
    assert found > 0.99 if same else found < 0.8


def test_paths_that_differ_most_stand_for_all():
    """Of many logs on three paths, one each; where there is room, every one."""
    phase = 2 * np.pi * np.arange(200) / 200
    paths = [(phase, np.sin(k * phase + shift), 2 * np.pi) for shift in (0.0, 1.0) for k in (1, 1, 2, 3)]
    chosen, likeness_of_the_rest = most_different(paths, 3)
    assert [i % 4 for i in chosen] == [0, 2, 3]
    assert likeness_of_the_rest > 0.999
    assert most_different(paths, 2)[1] < 0.1
    assert most_different(paths, 20) == (list(range(8)), 1.0)


def test_a_contact_is_judged_by_the_threshold_of_its_joint_and_filter():
    about = entry(role="contact", contact=((9.0, 11.0),))
    theirs = [
        Threshold("hand_pitch", "rts", 1.0, 0.1, 9.0, 0.9, "a", 1, 0.95, 0.01, 0.2),
        Threshold("hand_roll", "ekf", 1.0, 0.1, 9.0, 0.9, "b", 1, 0.95, 0.01, 0.2),
    ]
    push = np.where((T >= 9.0) & (T <= 11.0), 1.0, 0.0)
    assert not measured(track(noise()), theirs, about)
    own = Threshold("hand_roll", "rts", 0.01, 0.001, 9.0, 0.9, "c", 1, 0.95, 0.01, 0.2)
    for effort, above in ((noise() + push, 1), (noise(), 0)):  # the interval of noise holds zero
        [contact] = measured(track(effort), [*theirs, own], about)
        assert (contact.level_from, contact.detection_level, *contact.above) == ("c", 0.01, above)


def test_a_track_knows_when_it_was_not_touched_in_its_own_words():
    moving = replace(track(noise()), log="x", q=np.sin(T), dq=np.cos(T))
    names = ("free_rms", "free_level", "detection_level", "coverage")
    quartiles = ("band_width", *(f"coverage_q{i}" for i in range(1, 5)))
    smoothed, filtered = assess.run(moving, entry(role="validation"), arm.ARM)
    assert [n.key for n in smoothed.published()] == [f"effort.x.hand_roll.{name}" for name in names + quartiles]
    assert [n.key for n in filtered.published()] == [f"ekf.x.hand_roll.{name}" for name in names]


def test_results_are_the_smoothers_and_the_filters_stand_beside_them():
    """Levels, coverage, threshold and contact by the smoother, where the filter's effort and deviation differ."""
    push = np.where((T >= 20) & (T <= 22), 2.0, 0.0)
    of_filter = {"tau_ext": noise(1, 0.5), "tau_ext_std": np.full(len(T), 0.1)}
    both = replace(track(noise(2)), **of_filter)
    smoothed, filtered = assess.run(both, entry(role="validation"), arm.ARM)
    assert (smoothed.free_rms, filtered.free_rms) == (pytest.approx(0.1, rel=0.1), pytest.approx(0.5, rel=0.1))
    assert smoothed.coverage > 0.9 > 0.5 > filtered.coverage
    [threshold] = assess.gather([smoothed, filtered])
    assert threshold.detection_level == smoothed.detection_level
    assert (threshold.coverage, threshold.coverage_std) == (smoothed.coverage, smoothed.coverage_std)
    assert threshold.band_width == pytest.approx(1.96 * 0.1, rel=1e-3)
    pushed = replace(track(push), **of_filter)
    [contact] = measured(pushed, [threshold], entry(role="contact", contact=((20.0, 22.0),)))
    assert (contact.peak[0], contact.mean[0]) == (2.0, pytest.approx(2.0))
    assert contact.peak_std[0] == pytest.approx(0.1)


def test_free_windows_of_a_contact_log_give_its_levels_and_what_is_between_them_does_not():
    """The push would raise every level; without windows nobody knows where it is."""
    pushed = track(slow_noise(0.05) + np.where((T >= 20) & (T <= 22), 2.0, 0.0))
    assert not list(assess.run(pushed, entry(role="contact"), arm.ARM))
    smoothed, _ = assess.run(pushed, entry(role="contact", free=((25.0, 38.0), (2.0, 18.0))), arm.ARM)
    assert (smoothed.log, smoothed.free_rms) == ("push", pytest.approx(0.05, rel=0.3))
    inside = ((T >= 3) & (T <= 17)) | ((T >= 26) & (T <= 37))
    assert smoothed.tested == pytest.approx(inside.sum(), abs=4)
    stated = entry(role="contact", contact=((20.0, 22.0),))
    assert stated.possible_contact == stated.contact
    both = replace(stated, free=((2.0, 18.0), (25.0, 38.0)))
    assert both.possible_contact == replace(both, contact=()).possible_contact
    assert entry(role="validation", free=((2.0, 5.0),)).possible_contact == ()


def test_coverage_by_quartile_of_speed_leaves_standstill_out():
    """A band that is half as wide in fast motion covers 67 % there; samples at rest count in no quartile."""
    moves = T < 30
    q, dq = (np.where(moves, x, 0.0) for x in (np.cos(2 * T), -2 * np.sin(2 * T)))
    std = np.where(np.abs(dq) > np.median(np.abs(dq[moves])), 0.05, 0.1)
    still = (~moves).astype(int)
    of = replace(track(noise(), role="validation"), q=q, dq=dq, tau_ext_smooth_std=std, unscored=still)
    smoothed, _ = assess.run(of, entry(role="validation"), arm.ARM)
    assert smoothed.quartile_coverage == pytest.approx([0.95, 0.95, 0.673, 0.673], abs=0.05)
    assert smoothed.quartile_coverage_std == pytest.approx(
        np.sqrt([0.0475, 0.0475, 0.22, 0.22]) / np.sqrt(725), rel=0.6
    )


def slow_noise(std=0.05, seed=0, N=4000, cutoff=1.0):
    """What a smoother leaves of free motion: normal, and slower than `cutoff` [Hz]."""
    x = lowpass(np.random.default_rng(seed).normal(size=N + 2000), RATE, cutoff)[1000:-1000]  # without its ends
    return std * x / x.std()


def test_free_motion_crosses_the_alarm_level_as_seldom_as_it_says():
    """Ten hours of normal noise: one upward crossing of either sign in ten minutes each, by Rice's formula."""
    x = slow_noise(1.0, 0, 3_600_000)
    space = free_motion_statistics(x, np.ones(len(x), bool), RATE)
    level = alarm_level(space.rms, 0.0, space.crossings)
    crossings = np.sum((x[:-1] < level) & (x[1:] >= level))
    expected = len(x) / RATE * FALSE_ALARMS
    assert abs(crossings - expected) < 4 * np.sqrt(expected)
    assert alarm_level(0.1, 5.0, 0.3) == 5.0  # the largest that occurred


@pytest.mark.parametrize("seed", range(5))
def test_a_ramp_and_a_step_begin_where_they_began(seed):
    """A triangle from 9 to 11 s and a step from 20 to 23 s, as a smoother of a rise of 0.3 s spreads them."""
    push = 3.0 * np.clip(1 - np.abs(T - 10.0), 0, None) - np.where((T >= 20) & (T <= 23), 2.0, 0.0)
    spread = np.exp(-0.5 * ((np.arange(-100, 101) / RATE) / (0.3 / np.sqrt(2 * np.pi))) ** 2)
    smooth = np.convolve(push, spread / spread.sum(), "same") + slow_noise(0.03, seed)
    first, second = events(T, smooth, np.full(len(T), 0.03), 0.3, rise=0.3)
    for found, true in zip((first.onset, first.release, second.onset, second.release), (9, 11, 20, 23), strict=True):
        assert found == pytest.approx(true, abs=0.1)
    assert second.onset_std < 0.05  # a step has hardly a shape; the rest is noise, and how far it may lengthen a rise
    assert first.onset_std == pytest.approx(0.25 / np.sqrt(3), rel=0.25)  # by the shape of a rise of one second


def test_what_nearly_touches_is_one_contact_and_what_changes_sign_is_two():
    x = np.where((T >= 5) & (T < 6), 1.0, 0.0) + np.where((T >= 6.1) & (T < 7), 1.0, 0.0)
    x -= np.where((T >= 7) & (T < 8), 1.0, 0.0) + np.where((T >= 12) & (T < 13), 1.0, 0.0)
    found = list(events(T, x, np.full(len(T), 0.1), 0.5, rise=0.0))
    assert [round(e.onset, 1) for e in found] == [5.0, 7.0, 12.0]


def test_a_contact_that_no_window_states_is_found_and_said_to_be():
    push = np.where((T >= 20) & (T <= 22), 2.0, 0.0) + np.where((T >= 9) & (T <= 11), 1.5, 0.0)
    quiet_threshold = [Threshold("hand_roll", "rts", 0.3, 0.03, 0.5, 0.05, "c", 1, 0.95, 0.01, 0.2)]
    about = entry(role="contact", contact=((9.0, 11.0), (30.0, 31.0)))
    [contact] = measured(track(push + noise(std=0.01)), quiet_threshold, about)
    assert contact.stated.tolist() == [1, 1, 0]
    assert contact.found.tolist() == [1, 0, 1]
    assert contact.onset[2] == pytest.approx(20.0, abs=0.05)
    assert (contact.onset[1], contact.release[1]) == (30.0, 31.0)
    [free] = measured(track(push, role="validation"), quiet_threshold, entry(role="validation"))
    assert free.stated.tolist() == [0, 0]
    assert not measured(track(noise(std=0.01), role="validation"), quiet_threshold, entry(role="validation"))


@pytest.mark.parametrize(("peak", "pause", "turn", "stated", "contacts"), [
    (0.3, 1.0, 20.5, False, 0), (0.3, 1.0, 20.5, True, 1), (0.5, 1.0, 20.5, False, 1), (0.3, 0.4, 20.5, False, 1),
    (0.3, 1.0, 22.0, False, 1),
])  # fmt: skip
def test_what_static_friction_explains_while_a_joint_slowly_reverses_is_no_contact(peak, pause, turn, stated, contacts):
    """An effort at 20.2 to 20.8 s counts above a friction of 0.4, if the joint moves or creeps, or if it is stated."""
    effort = noise(std=0.01) + np.where((T >= 20.2) & (T <= 20.8), peak, 0.0)
    quiet = [Threshold("hand_roll", "rts", 0.05, 0.005, 0.1, 0.01, "c", 1, 0.95, 0.01, 0.2)]
    dq = np.where(np.abs(T - 20.5) <= 0.5 * pause, 0.001, 1.0) * np.sign(turn - T)
    about = entry(role="contact", contact=((20.2, 20.8),) if stated else ())
    records = measured(track(effort, std=0.01, dq=dq, static_friction=0.4), quiet, about)
    assert len([record for record in records if isinstance(record, Contact)]) == contacts
    notes = [text for record in records if isinstance(record, Diagnostic) for text in record.text]
    assert len(notes) == 1 - contacts
    assert all("an effort at 20." in note and "of up to 0.3" in note and "0.4 N m" in note for note in notes)


def test_the_offset_of_free_windows_has_a_standard_error_and_a_drift():
    found = day_offset(T, 0.3 + noise(1), [(0.0, 10.0), (20.0, 30.0)])
    assert found.value == pytest.approx(0.3, abs=4 * 0.1 / np.sqrt(2000))
    assert found.std == pytest.approx(0.1 / np.sqrt(2000), rel=0.6)
    assert not found.drifts
    assert day_offset(T, 0.3 + 0.1 * T, [(0.0, 10.0), (20.0, 30.0)]).drifts
    assert day_offset(T, 0.3 + noise(1), []) == (0.0, 0.0, 0.0, 0.0)


def test_leaving_out_units_gives_the_standard_error_of_a_mean_of_units():
    random, unit = np.random.default_rng(5), np.repeat(np.arange(8), 50)
    x = random.normal(size=8)[unit]  # all that differs is between units
    without = np.array([[x[unit != number].mean()] for number in range(8)])
    assert bootstrap.of_left_out(without) == pytest.approx(x[::50].std(ddof=1) / np.sqrt(8))
    assert np.isnan(bootstrap.of_left_out(without[:1])).all()


def test_the_pdf_prints_the_contacts_that_are_largest_beside_their_joints_level():
    """On joints with other units, in the order of the table."""
    sizes = {"hand_roll": np.linspace(0.1, 1.2, 12), "instrument_slide": np.linspace(-1.0, -24.0, 24)}
    contacts = [
        Contact(
            log="push", joint=joint, filter="ekf", level_from="x", detection_level=np.abs(peak).max() / 2,
            alarm_level=0.1, **dict.fromkeys(Contact.columns(), np.ones(len(peak))) | {"peak": peak},
        )
        for joint, peak in sizes.items()
    ]  # fmt: skip
    printed = largest(contacts)
    assert len(printed) == 20
    assert printed == tuple(sorted([*range(5, 12), *range(12 + 11, 12 + 24)]))


@pytest.mark.parametrize(("dip", "contacts"), [(0.8, 1), (0.1, 2), (-1.0, 3)])
def test_two_peaks_are_one_contact_unless_the_effort_falls_between_them(dip, contacts):
    """The level is crossed between them in any case, and a push to the other side is another contact."""
    corners = [(0.0, 0.0), (3.0, 0.0), (4.0, 1.0), (5.0, dip), (6.0, 1.0), (7.0, 0.0), (10.0, 0.0)]
    x = np.interp(T, *zip(*corners, strict=True))
    found = list(events(T, x, np.full(len(T), 0.01), 0.9, rise=0.0))
    assert len(found) == contacts
    assert all(a.release <= b.onset + 1e-9 for a, b in pairwise(found))


@pytest.mark.parametrize("level", [0.02, 0.1, 0.5])
@pytest.mark.parametrize("power", [1.0, 1.5, 2.0])
def test_the_stated_error_holds_the_beginning_of_a_push_however_softly_it_begins(power, level):
    """Half a wave of a sine, to a power, from 9 to 11 s."""
    push = np.where(np.abs(T - 10.0) <= 1.0, np.clip(np.cos(np.pi / 2 * (T - 10.0)), 0.0, None) ** power, 0.0)
    [event] = events(T, smoothed(3.0 * push, 0.2), np.full(len(T), 0.005), level, rise=0.2)
    assert abs(event.onset - 9.0) < 2.0 * event.onset_std
    assert abs(event.release - 11.0) < 2.0 * event.release_std
    assert event.onset_std < 0.15


def test_a_step_begins_where_it_began():
    [event] = events(
        T, smoothed(np.where((T >= 10.0) & (T < 12.5), 2.0, 0.0), 0.2), np.full(len(T), 1e-3), 0.1, rise=0.2
    )
    assert (event.onset, event.release) == pytest.approx((10.0, 12.5), abs=0.01)  # a sample
    assert event.onset_std < 0.01


def test_the_stated_errors_hold_the_ends_of_pushes_with_short_flanks_and_a_level_that_changes():
    """Of flanks from 0.02 to 0.3 s, no constant level, and a smoother of 0.2 s: 95 % of the intervals hold the ends."""
    random, z = np.random.default_rng(4), []
    for _ in range(200):
        up, down, level, slope = *random.choice([0.02, 0.1, 0.2, 0.3], 2), random.uniform(0.3, 2.0), random.normal()
        end = 10.0 + up + level + down
        push = np.clip((T - 10.0) / up, 0, 1) * np.clip((end - T) / down, 0, 1) * (1 + 0.1 * slope * (T - 10.0))
        [event] = events(T, smoothed(3.0 * push, 0.2), np.full(len(T), 0.02), 0.1, rise=0.2)
        z += [(event.onset - 10.0) / event.onset_std, (event.release - end) / event.release_std]
    assert np.mean(np.abs(z) < 1.96) > 0.95 - 4 * np.sqrt(0.05 * 0.95 / len(z))


def test_a_push_too_short_for_the_smoother_is_found_and_its_peak_is_said_to_be_hidden():
    """Half a wave of 60 ms and 8 N m, of which the smoother shows a fifth."""
    push = 8.0 * np.where((T >= 20.0) & (T <= 20.06), np.sin(np.pi * (T - 20.0) / 0.06), 0.0)
    of = track(smoothed(push, 0.2) + slow_noise(0.02), std=0.02, smooth_rise=0.2)
    quiet = [Threshold("hand_roll", "rts", 0.05, 0.005, 0.06, 0.005, "c", 1, 0.95, 0.01, 0.2)]
    warning, contact = measured(of, quiet, entry(role="contact"))
    assert (contact.found.tolist(), contact.onset[0]) == ([1], pytest.approx(20.0, abs=0.1))
    assert "push/hand_roll: the contact at 19.9" in warning.text[0]
    assert "its peak may be several times larger" in warning.text[0]
    [stated] = measured(of, quiet, entry(role="contact", contact=((19.5, 20.5),)))
    assert stated.impulse[0] == pytest.approx(8.0 * 0.06 * 2 / np.pi, abs=3 * stated.impulse_std[0])


def smoothed(x, rise):
    """An effort with exponential weights on either side, as the smoother shows it: a step has the slope 1 / rise."""
    weights = np.exp(-2.0 * np.abs(np.arange(-200, 201)) / RATE / rise)
    return np.convolve(x, weights / weights.sum(), "same")


def test_a_push_is_found_in_a_stated_window_that_it_fills_or_leaves():
    push = 3.0 * np.where(np.abs(T - 10.0) <= 1.0, np.cos(np.pi / 2 * (T - 10.0)) ** 2, 0.0)
    quiet = [Threshold("hand_roll", "rts", 0.01, 0.001, 0.02, 0.002, "c", 1, 0.95, 0.01, 0.2)]
    for window, found in (((9.0, 11.0), 1), ((9.6, 10.4), 1), ((7.0, 13.0), 1), ((11.2, 13.0), 0)):
        contact = measured(track(push, std=0.002), quiet, entry(role="contact", contact=(window,)))[0]
        assert contact.found[0] == found


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_peak_that_smoothing_flattens_is_at_least_the_mean(sign):
    """A push of 0.3 s and 2 N m, of which a smoother of 0.5 s shows three quarters."""
    push = 2.0 * sign * ((T >= 20.0) & (T <= 20.3))
    of = replace(track(smoothed(push, 0.5), std=0.02, smooth_rise=0.5), tau_ext_direct=push)
    quiet = [Threshold("hand_roll", "rts", 0.05, 0.005, 0.06, 0.005, "c", 1, 0.95, 0.01, 0.2)]
    *_, contact = measured(of, quiet, entry(role="contact", contact=((20.0, 20.3),)))
    assert np.abs(of.tau_ext_smooth).max() < 1.5
    assert contact.peak.tolist() == contact.mean.tolist() == [pytest.approx(2.0 * sign, rel=0.05)]
    *_, wide = measured(of, quiet, entry(role="contact", contact=((18.0, 22.0),)))
    assert wide.peak[0] == wide.middle_mean[0] == pytest.approx(2.0 * sign, rel=0.05)
    assert abs(wide.peak[0]) > 2 * abs(wide.mean[0])
    assert wide.t_peak[0] == pytest.approx(20.15, abs=0.02)


def test_what_a_contact_lies_outside_its_stated_window_is_in_its_error():
    push = 3.0 * np.where(np.abs(T - 10.0) <= 1.0, np.cos(np.pi / 2 * (T - 10.0)) ** 2, 0.0)
    quiet = [Threshold("hand_roll", "rts", 0.01, 0.001, 0.02, 0.002, "c", 1, 0.95, 0.01, 0.2)]
    wide, narrow = (
        measured(track(push, std=0.002), quiet, entry(role="contact", contact=(window,)))[0]
        for window in ((8.0, 12.0), (9.6, 10.4))
    )
    assert wide.onset_std[0] < 0.3
    assert narrow.onset[0] == wide.onset[0]
    assert (narrow.onset_std[0], narrow.release_std[0]) == pytest.approx((9.6 - wide.onset[0], wide.release[0] - 10.4))


def test_the_error_of_an_impulse_includes_those_of_onset_and_release_unless_its_window_is_stated():
    """Flanks of half a cosine: where the smoother starts the contact late, part of the impulse lies before it."""
    flank = np.clip(np.minimum((T - 10.0) / 0.15, (10.5 - T) / 0.15), 0.0, 1.0)
    push = 3.0 * (0.5 - 0.5 * np.cos(np.pi * flank))
    quiet = [Threshold("hand_roll", "rts", 0.01, 0.001, 0.02, 0.002, "c", 1, 0.95, 0.01, 0.2)]
    shown = replace(track(smoothed(push, 0.1), std=0.002, smooth_rise=0.1), tau_ext_direct=push + noise(std=0.005))
    found, stated = (
        next(r for r in measured(shown, quiet, entry(role="contact", contact=w)) if isinstance(r, Contact))
        for w in ((), ((9.9, 10.6),))
    )
    edges = np.interp([found.onset[0], found.release[0]], T, shown.tau_ext_smooth)
    expected = np.hypot(edges[0] * found.onset_std[0], edges[1] * found.release_std[0])
    assert found.impulse_std[0] == pytest.approx(expected, rel=0.1)
    assert found.impulse[0] == pytest.approx(3.0 * 0.35, abs=3 * found.impulse_std[0])
    assert stated.impulse_std[0] < 0.1 * found.impulse_std[0]


def test_free_motion_of_a_fitted_log_raises_the_alarm_level_unless_it_is_far_from_the_rest_as_a_touch_is():
    """What was fitted shows less of the model's error than what was not, so it exceeds no level by that error."""
    fitted = slow_noise(0.05) + np.where((T >= 30) & (T <= 31), 0.2, 0.0)
    about, other = entry(role="identification"), entry(role="validation")

    def threshold(effort, about=about):
        quiet, _, *_ = assess.run(track(slow_noise(0.02), log="check", role="validation"), other, arm.ARM)
        space, _, *_ = assess.run(track(effort, role="identification"), about, arm.ARM)
        alone, together = list(assess.gather([quiet])), list(assess.gather([quiet, space]))
        assert together[0].level_from == "check"
        assert together[0].detection_level == alone[0].detection_level
        return alone, together, space

    alone, together, space = threshold(fitted)
    assert measured(track(fitted, std=0.01, role="contact"), alone, entry(role="contact"))
    assert together[0].alarm_level == space.free_max > 2.0 * alone[0].alarm_level
    assert not measured(track(fitted, role="identification"), together, about)
    touched = fitted + np.where((T >= 20) & (T <= 22), 2.0, 0.0)
    _, together, space = threshold(touched)
    assert together[0].alarm_level == space.free_max < 0.5
    [contact] = measured(track(touched, role="identification"), together, about)
    assert contact.onset.tolist() == pytest.approx([20.0], abs=0.1)
    again = fitted + np.where(np.abs(T - 16.0) <= 7.0, 0.6 * (np.mod(T, 6.0) < 0.3), 0.0)  # 12 and 18 s: as touches may
    assert threshold(again)[2].free_max < 0.5
    again = fitted + np.where(np.abs(T - 18.0) <= 7.0, 0.6 * (np.mod(T, 6.0) < 0.3), 0.0)  # and 24 s, as with a period
    assert threshold(again)[2].free_max > 0.6
    free = entry(role="identification", free=((0.0, 40.0),))
    _, together, space = threshold(touched, free)
    assert together[0].alarm_level == space.free_max > 1.9
    assert not measured(track(touched, role="identification"), together, free)
    said = list(assess.run(track(touched, role="identification"), free, arm.ARM))
    assert not any(isinstance(made, Diagnostic) for made in said)


def test_no_contact_begins_where_the_smoother_has_no_later_samples():
    quiet = [Threshold("hand_roll", "rts", 0.05, 0.005, 0.5, 0.05, "c", 1, 0.95, 0.01, 0.2)]
    for rise, start, found in ((0.2, 39.0, 1), (0.2, 39.75, 0), (0.4, 39.25, 1), (0.4, 39.4, 0), (0.05, 39.6, 0)):
        late = track(1.0 * (start <= T), smooth_rise=rise)
        assert len(measured(late, quiet, entry(role="contact"))) == found


def test_no_contact_is_found_where_the_rise_of_the_smoother_is_not_known():
    quiet = [Threshold("hand_roll", "rts", 0.05, 0.005, 0.5, 0.05, "c", 1, 0.95, 0.01, 0.2)]
    pushed = np.where((T >= 20) & (T <= 22), 2.0, 0.0)
    for rise, found in ((0.2, 1), (np.nan, 0)):
        assert len(measured(track(pushed, smooth_rise=rise), quiet, entry(role="contact"))) == found


MOVING = np.ones(len(T))  # [rad/s]


def test_a_touch_in_a_log_of_free_motion_is_named_and_free_motion_is_not():
    push = np.where((T >= 20) & (T <= 22), 2.0, 0.0)
    for role in ("identification", "validation"):
        about = entry(role=role)
        assert len(list(assess.run(track(slow_noise(0.05), role=role, dq=MOVING), about, arm.ARM))) == 2
        *_, warning = assess.run(track(slow_noise(0.05) + push, role=role, dq=MOVING), about, arm.ARM)
        assert "push/hand_roll: at 2" in warning.text[0]
        assert "give the log the role contact, or state its contact windows" in warning.text[0]
    stated = entry(role="validation", contact=((19.5, 22.5),))
    assert len(list(assess.run(track(slow_noise(0.05) + push, role="validation", dq=MOVING), stated, arm.ARM))) == 2


@pytest.mark.parametrize(
    ("free", "remedy"),
    [((), "add this time to its contact windows, or state in its free windows"),
     (((2.0, 25.0),), "leave this time out of its free windows"), (((2.0, 18.0), (24.0, 36.0)), "")],
)  # fmt: skip
def test_a_touch_outside_the_windows_of_a_contact_log_is_named_unless_free_leaves_it_out(free, remedy):
    touched = slow_noise(0.05) + np.where((T >= 20) & (T <= 22), 2.0, 0.0) + np.where((T >= 30) & (T <= 32), 3.0, 0.0)
    contact = ((29.5, 32.5),) if not free or len(free) == 1 else ((20.0, 22.0),)
    about = entry(role="contact", contact=contact, free=free if len(free) < 2 else ((2.0, 18.0), (34.0, 38.0)))
    _, _, *warnings = assess.run(track(touched, dq=MOVING), about, arm.ARM)
    assert [remedy in warning.text[0] for warning in warnings] == [True] * bool(remedy)


def test_friction_of_a_joint_that_slows_down_to_a_stop_is_no_touch():
    push = np.where((T >= 20) & (T <= 20.5), 2.0, 0.0)
    stops = np.interp(T, [0.0, 19.9, 20.0, 20.4, 20.5, 40.0], [1.0, 1.0, 0.0, 0.0, 1.0, 1.0])
    for dq, warnings in ((MOVING, 1), (stops, 0), (0.0 * T, 0)):
        of = track(slow_noise(0.05) + push, role="validation", dq=dq)
        assert len(list(assess.run(of, entry(role="validation"), arm.ARM))) == 2 + warnings


@pytest.mark.parametrize(("size", "touches"), [(2.9, False), (3.1, True), (-3.1, True)])
def test_what_is_three_times_above_the_level_of_the_rest_of_a_log_is_a_touch(monkeypatch, size, touches):
    monkeypatch.setattr(assess, "typical_alarm_level", lambda *given: 0.1)
    effort = np.where(np.arange(len(T)) == 2000, 0.1 * size, 0.0)
    warnings = assess.touch_warning(track(effort, dq=MOVING), np.ones(len(T), bool), entry(), arm.ARM)
    assert ["at 20.00 s" in warning.text[0] for warning in warnings] == [True] * touches


def test_an_effort_at_standstill_is_no_touch_however_small_efforts_are(monkeypatch):
    monkeypatch.setattr(assess, "typical_alarm_level", lambda *given: 1e-4)
    still = np.where(np.arange(len(T)) < 1000, 0.0, MOVING)
    effort = np.where(np.arange(len(T)) == 500, 1.0, 2e-4)
    assert not [*assess.touch_warning(track(effort, dq=still), np.ones(len(T), bool), entry(), arm.ARM)]


@pytest.mark.parametrize(("samples", "levels"), [(99, 0), (100, 1)])
def test_a_level_takes_a_hundred_samples_of_free_space(samples, levels):
    free = np.arange(len(T)) < samples
    assert len(list(assess.space_of(track(noise()), "rts", noise(), np.full(len(T), 0.1), free, ~free))) == levels


def test_the_offset_of_few_samples_is_as_uncertain_as_it_is_large():
    found = day_offset(np.arange(4.0), np.array([0.2, 0.2, 0.4, 0.4]), [(-0.5, 3.5)])
    assert found.value == pytest.approx(0.3)
    assert found.drift == pytest.approx(0.2)
    one_each = day_offset(np.arange(2.0), np.array([0.2, 0.5]), [(-0.5, 1.5)])
    assert one_each.drift_std == pytest.approx(np.hypot(0.2, 0.5))
    assert not one_each.drifts


@pytest.mark.parametrize("seed", range(5))
def test_a_swing_after_a_large_push_is_no_contact_and_a_small_push_after_it_is_one(seed):
    """Trapezoids of 3 and -0.5, and between them a swing above the alarm level whose interval holds zero."""
    corners = [(5.0, 0.0), (5.2, 3.0), (7.0, 3.0), (7.2, 0.0), (7.4, -0.12), (7.6, 0.0)]
    corners += [(9.0, 0.0), (9.2, -0.5), (10.5, -0.5), (10.7, 0.0)]
    x = smoothed(np.interp(T, *zip(*corners, strict=True)), 0.1) + slow_noise(0.04, seed)
    of = track(x, std=0.04, smooth_rise=0.1)
    assert len(list(events(T, x, of.tau_ext_smooth_std, 0.105, rise=0.1))) > 2
    quiet = [Threshold("hand_roll", "rts", 0.1, 0.01, 0.105, 0.01, "c", 1, 0.95, 0.01, 0.2)]
    [contact] = measured(of, quiet, entry(role="contact"))
    assert contact.peak == pytest.approx([3.0, -0.5], abs=0.2)
    assert contact.onset == pytest.approx([5.0, 9.0], abs=0.3)
    windows = ((5.0, 7.2), (7.3, 7.8))
    [contact] = measured(of, quiet, entry(role="contact", contact=windows))
    assert (contact.stated.tolist(), contact.found.tolist()) == ([1, 1, 0], [1, 0, 1])


def test_an_offset_drifts_where_its_halves_differ_by_more_than_two_standard_errors():
    halves = np.repeat([0.0, 1.0], 2000) * (T >= 0)
    assert not day_offset(T, halves, [(0.0, 0.005)]).std  # one sample tells no offset
    for by, drifts in ((1.9, False), (2.1, True)):
        quiet = day_offset(T, noise(2), [(-1.0, 50.0)])
        found = day_offset(T, 0.3 + noise(2) + (by * quiet.drift_std - quiet.drift) * halves, [(-1.0, 50.0)])
        assert found.drift == pytest.approx(by * found.drift_std, rel=1e-9)
        assert found.drifts == drifts
    assert quiet.drift_std == pytest.approx(2.0 * quiet.std, rel=0.3)


def test_the_alarm_level_is_that_of_rice_and_at_least_the_largest_effort():
    for crossings, logarithm in ((2.0, np.log(1200.0)), (1 / 600, 0.0), (1 / 6000, 0.0)):
        level = alarm_level(0.3, 0.01, crossings)
        assert level == pytest.approx(max(0.01, 0.3 * np.sqrt(2.0 * logarithm)), rel=1e-12)
    sine = 0.7 * np.sin(2 * np.pi * 1.5 * T + 0.05)
    free = (T < 10.0) | (T >= 30.0)  # it crosses zero 15 times in 10 s, each last time just before a window or its end
    rms, largest_, crossings = free_motion_statistics(sine, free, RATE)
    assert (rms, largest_) == pytest.approx((0.7 / np.sqrt(2), 0.7), rel=2e-3)
    assert crossings == pytest.approx(28 / 20.0, rel=1e-12)


def test_the_error_of_an_onset_is_noise_over_slope_the_shape_of_the_rise_and_noise_in_its_duration():
    """A ramp of 0.8 s to a peak of 2, under noise whose deviation is stated; T_seen = 2 (t - t) has twice its noise."""
    ramp = 2.0 * np.clip((T - 5.0) / 0.8, 0.0, 1.0) * (T <= 20.0)
    for std in (0.0, 0.05, 0.5):
        [found] = events(T, ramp, np.full(len(T), std), 0.3, rise=0.0)
        assert found.onset == pytest.approx(5.0 - 0.2 * 0.8, abs=1e-9)
        crossing = std * 0.8 / 2.0
        longer = np.sqrt(0.8**2 + 2 * 0.8 * 2 * np.sqrt(2) * crossing)
        expected = np.linalg.norm([crossing, 0.2 * 0.8, 0.5 * (longer - 0.8)])
        assert found.onset_std == pytest.approx(expected, rel=1e-9)


def test_what_no_mean_reduces_is_in_the_error_of_a_mean_as_it_is():
    plain, more = (
        summarise(T, (noise(), np.zeros(len(T)), noise()), (10.0, 12.0), T < 5.0, 0.0, constant)
        for constant in (None, T / 22)
    )
    assert more.mean_std == pytest.approx(np.hypot(plain.mean_std, 0.5), rel=1e-9)
    assert more.impulse_std == pytest.approx(2.0 * more.mean_std, rel=1e-9)


def test_the_bootstrap_of_few_blocks_allows_for_the_mean_that_they_share(monkeypatch):
    monkeypatch.setattr(bootstrap, "DRAWS", 40_000)
    values = [0.3, -1.0, 2.0, 0.7]
    assert error_of_mean(values) == pytest.approx(np.std(values, ddof=1) / 2.0, rel=0.02)


def test_a_root_has_half_the_relative_error_of_its_square_and_near_zero_the_root_of_the_error():
    assert bootstrap.root(4.0, 0.4) == pytest.approx((2.0, 0.1), rel=1e-12)
    assert bootstrap.root(0.01, 0.4) == pytest.approx((0.1, np.sqrt(0.4)), rel=1e-12)
    assert bootstrap.root(-1.0, 0.4) == pytest.approx((0.0, np.sqrt(0.4)), rel=1e-12)


def test_the_coverage_of_logs_has_the_error_of_their_blocks_and_of_three_logs_their_scatter():
    def spaces(*coverage):
        return [free_space_record(coverage=c, coverage_std=0.02) for c in coverage]

    assert assess.pooled_coverage(spaces(0.9, 0.96)) == pytest.approx((0.93, 0.02 / np.sqrt(2)))
    assert assess.pooled_coverage(spaces(0.9, 0.9, 0.99)) == pytest.approx((0.93, 0.03))
    assert assess.pooled_coverage(spaces(0.94, 0.94, 0.94)) == pytest.approx((0.94, 0.02 / np.sqrt(3)))
