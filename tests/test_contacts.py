"""Contacts and the free space that they are judged by, on efforts whose peak, mean and level are known."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.maths.contact.free_space import levels
from pipeline.maths.contact.window import mean_size, summarise
from pipeline.maths.signals.bootstrap import blocks, standard_error
from pipeline.maths.signals.noise import model_error, noise_std, smoothed
from pipeline.maths.signals.path import likeness, most_different
from pipeline.maths.signals.smoothing import lowpass, share_passed
from pipeline.maths.signals.windows import free_space
from pipeline.records import Threshold, Track
from pipeline.stages import assess, measure, threshold
from tests.test_averaging import entry

RATE = 100.0
T = np.arange(4000) / RATE


def track(tau_ext, std=0.1, joint="hand_roll", log="push", role="contact", at_rest=0) -> Track:
    zero = np.zeros_like(T)
    columns = dict.fromkeys(Track.columns(), zero) | {"t": T, "tau_ext": tau_ext, "tau_ext_std": zero + std}
    scalars = dict.fromkeys(Track.scalars(), 0.0) | {"at_rest": at_rest, "rate": RATE, "filter": "ekf"}
    return Track(**columns, **scalars | {"log": log, "joint": joint, "role": role, "model": "m", "estimator": "e"})


def noise(seed=0, std=0.1):
    return std * np.random.default_rng(seed).normal(size=len(T))


def test_levels_of_white_noise_are_those_of_the_normal_distribution():
    found = levels(noise(), np.full(len(T), 0.1))
    # The density at the 99 % level is 0.0578 / 0.2 of |x|: a quantile's standard error is sqrt(p (1 - p) / N) over it.
    assert found.rms == pytest.approx(0.1, abs=4 * 0.1 / np.sqrt(2 * len(T)))
    assert found.level_95 == pytest.approx(0.196, abs=0.012)
    assert found.level_99 == pytest.approx(0.2576, abs=0.02)
    assert found.coverage == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / len(T)))
    assert found.coverage_std == pytest.approx(np.sqrt(0.95 * 0.05 / len(T)), rel=0.5)
    assert found.rms_std == pytest.approx(0.1 / np.sqrt(2 * len(T)), rel=0.5)


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
    assert found == pytest.approx(true, rel=4 / np.sqrt(2 * len(means)))


def test_a_triangle_has_its_peak_mean_and_impulse():
    push = 3.0 * np.clip(1 - np.abs(T - 10.0), 0, None)
    free = free_space(T, [(9.0, 11.0)], RATE)
    found = summarise(T, noise(std=0.02) + push, (9.0, 11.0), free)
    assert found.peak == pytest.approx(3.0, abs=4 * 0.02)
    assert found.mean == pytest.approx(1.5, abs=0.02)
    assert found.impulse == pytest.approx(3.0, abs=0.04)
    assert found.peak_std == pytest.approx(0.02, rel=0.1)
    assert found.mean_std == pytest.approx(0.02 / np.sqrt(201), rel=0.5)
    assert found.impulse_std == pytest.approx(2.0 * found.mean_std)


def test_a_bias_in_free_space_makes_means_uncertain_however_long_they_are():
    free = np.ones(len(T), bool)
    assert mean_size(noise() + 0.5, free, 1000) == pytest.approx(0.5, abs=0.02)
    assert np.isnan(mean_size(noise(), ~free, 10))
    assert summarise(T, noise(), (100.0, 101.0), free) is None


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
        *assess.run(track(noise(1), log="check", role="validation"), entry(role="validation")),
        *assess.run(track(noise(2, 5.0), log="fitted", role="identification"), entry(role="identification")),
        *assess.run(track(noise(3, 9.0), joint="hand_pitch", role="validation"), entry(role="validation")),
    ]
    [contact] = measure.run(track(noise(0) + push), threshold.run(spaces), entry(role="contact", contact=windows))
    assert contact.level_from == "check"  # neither what was fitted nor another joint
    assert list(contact.above) == [1, int(abs(contact.peak[1]) > contact.detection_level)]
    assert contact.peak[0] == pytest.approx(2.0, abs=0.5)
    assert contact.mean[0] == pytest.approx(2.0, abs=0.05)
    keys = {number.key for number in contact.published()}
    assert {"contact.push.hand_roll.1.peak", "contact.push.hand_roll.2.impulse"} <= keys


def test_nothing_is_said_of_a_joint_at_rest_or_of_a_contact_log_without_windows():
    assert not list(assess.run(track(noise(), at_rest=1), entry(role="contact", contact=((9.0, 11.0),))))
    assert not list(assess.run(track(noise()), entry(role="contact")))
    [space] = assess.run(track(noise()), entry(role="validation"))
    about = entry(role="contact", contact=((9.0, 11.0),))
    assert list(measure.run(track(noise()), threshold.run([space]), about))
    assert not list(measure.run(track(noise(), at_rest=1), threshold.run([space]), about))


def test_noise_is_told_from_the_error_of_a_model():
    """Of white noise and a slow error, each is found, in the presence of a few jumps."""
    segment, error = np.zeros(len(T), int), 0.05 * np.sin(2 * np.pi * 0.4 * T)
    jumps = np.where(np.arange(len(T)) % 500 == 0, 1.0, 0.0)
    residual = noise(std=0.2) + error
    assert noise_std(residual + jumps, segment, RATE, 17.0) == pytest.approx(0.2, rel=0.05)
    slow = smoothed(residual, segment, RATE, 17.0)
    found, std = model_error(slow, 0.2 * np.sqrt(share_passed(RATE, 17.0)))
    assert found == pytest.approx(0.05 / np.sqrt(2), abs=4 * std)
    assert std < 0.02
    none, bound = model_error(smoothed(noise(std=0.2), segment, RATE, 17.0), 0.2 * np.sqrt(share_passed(RATE, 17.0)))
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
    theirs = [Threshold("hand_pitch", "ekf", 1.0, "a"), Threshold("hand_roll", "rts", 1.0, "b")]
    assert not list(measure.run(track(noise()), theirs, about))
    [contact] = measure.run(track(noise()), [*theirs, Threshold("hand_roll", "ekf", 0.01, "c")], about)
    assert (contact.level_from, contact.detection_level, *contact.above) == ("c", 0.01, 1)


def test_a_track_knows_when_it_was_not_touched_in_its_own_words():
    [space] = assess.run(replace(track(noise()), log="x"), entry(role="validation"))
    assert [n.key for n in space.published()] == [
        f"ekf.x.hand_roll.{name}" for name in ("free_rms", "free_level", "detection_level", "coverage")
    ]
