"""What is said of pushes of known shape: the band of the external effort, and the times of contact."""

from functools import cache

import numpy as np
import pytest

from davinci_forces.filters import tracker
from davinci_forces.filters.problem import NoiseModel, joint_at_rest
from davinci_forces.filters.response import rise, rounding_error, smallest_q_tau
from davinci_forces.maths.contact.detection import events, narrower_means, summarise
from davinci_forces.maths.uncertainty.error_band import NORMAL_95

T_S, INERTIA, VISCOUS, START = 0.01, 0.3, 0.3, 10.0
T = T_S * np.arange(2000)
STARTS = NoiseModel(r_q=1e-5, r_dq=2e-3, q_q=0.0, q_dq=0.14 * T_S / INERTIA, q_tau=0.0)
NOISE = STARTS._replace(q_tau=smallest_q_tau(tracker("ekf"), INERTIA, VISCOUS, T_S, STARTS))
SHAPES = {  # of the share of its duration that has passed
    "step": np.ones_like,
    "triangle": lambda x: 1.0 - np.abs(2.0 * x - 1.0),
    "half-sine": lambda x: np.sin(np.pi * x),
    "squared sine": lambda x: np.sin(np.pi * x) ** 2,
    "ramp and hold": lambda x: np.minimum(np.minimum(x / 0.4, (1.0 - x) / 0.2), 1.0),
    "sawtooth": lambda x: np.minimum(x / 0.15, (1.0 - x) / 0.85),
    "let go in two steps": lambda x: np.interp(x, [0.0, 0.2, 0.5, 0.6, 0.85, 1.0], [0.0, 1.0, 1.0, 0.55, 0.6, 0.0]),
}
PUSHES = [("step", 4.0), ("step", 0.5), ("triangle", 2.0), ("triangle", 0.6), ("half-sine", 1.0), ("half-sine", 0.3)]
PUSHES += [("squared sine", 1.0), ("squared sine", 0.5), ("ramp and hold", 4.0)]
FLANKS = {
    "ramp": lambda x: x,
    "half a cosine": lambda x: 0.5 - 0.5 * np.cos(np.pi * x),
    "least jerk": lambda x: x**3 * (10.0 - 15.0 * x + 6.0 * x**2),
}


def push(shape, duration):
    x = (T - START) / duration
    return np.where((x >= 0.0) & (x <= 1.0), SHAPES[shape](x), 0.0)


@cache
def smoothed(shape, duration, peak, seed):
    """The push (N,), the smoothed effort (N,), its deviation (N,), what is rounded off (N,), and the rise [s]."""
    chance, true = np.random.default_rng(seed), peak * push(shape, duration)
    joint = joint_at_rest(np.full(len(T), INERTIA), VISCOUS, true + 0.14 * chance.normal(size=len(T)), T_S, 1.0)
    q, dq = (std * chance.normal(size=len(T)) for std in (NOISE.r_q, NOISE.r_dq))
    joint = joint._replace(q=q, dq=dq)
    made, spread = tracker("rts")(joint, NOISE), rise(tracker("rts"), joint, NOISE)
    return true, made.tau_ext, made.tau_ext_std, rounding_error(made.tau_ext, made.tau_ext_std**2, T_S, spread), spread


@pytest.mark.parametrize("peak", [0.5, 1.0, 3.0])
@pytest.mark.parametrize(("shape", "duration"), PUSHES)
def test_the_band_holds_pushes_and_is_hardly_wider_in_free_motion(shape, duration, peak):
    """Without what is rounded off, it holds 2 to 99 % of the samples up to a tenth of a second beside a push."""
    inside, wider = [], []
    for seed in range(4):
        true, effort, std, rounding, _ = smoothed(shape, duration, peak, seed)
        near, free = np.abs(T - START - 0.5 * duration) < 0.5 * duration + 0.1, (T > 2.0) & (T < START - 2.0)
        inside.append(np.abs(effort - true)[near] <= NORMAL_95 * np.hypot(std, rounding)[near])
        wider.append(np.hypot(std, rounding)[free] / std[free])
    assert np.mean(inside) > 0.9
    assert np.mean(wider) < 1.05


def test_a_rounded_step_and_a_rounded_tip_are_off_by_what_is_stated():
    """Under exponential weights of either side, without noise: half of a step beside it, and .3 at a tip of slope 3."""
    weights = np.exp(-np.abs(np.arange(-200, 201)) * T_S / 0.1)
    for true, off in ((2.0 * (T >= START), 1.0), (3.0 * np.clip(1.0 - np.abs(T - START), 0.0, None), 0.3)):
        rounded = np.convolve(true, weights / weights.sum(), "same")
        k = int(np.abs(rounded - true)[500:-500].argmax()) + 500
        assert np.abs(rounded - true)[k] == pytest.approx(off, rel=0.1)
        assert rounding_error(rounded, np.zeros(len(T)), T_S, 0.2)[k] == pytest.approx(off, rel=0.1)


def test_no_noise_is_taken_for_rounding_and_blocks_change_nothing(monkeypatch):
    _, effort, std, rounding, spread = smoothed("half-sine", 1.0, 1.0, 0)
    assert (rounding[(T > 2.0) & (T < 8.0)] == 0.0).mean() > 0.6
    assert rounding_error(effort[:1], std[:1] ** 2, T_S, spread) == [0.0]
    assert not rounding_error(effort, std**2, T_S, np.nan).any()
    assert np.isfinite(rounding_error(effort, std**2, T_S, 1e9)).all()
    monkeypatch.setattr("davinci_forces.maths.arrays.BLOCK_SAMPLES", 150)
    np.testing.assert_allclose(rounding_error(effort, std**2, T_S, spread), rounding, atol=1e-12)


def test_times_of_contact_have_the_errors_that_are_stated():
    """Over shapes and sizes; the errors of a step, whose duration of rise is the root of a small difference, too."""
    z = []
    for shape, duration in PUSHES:
        for peak in (0.5, 1.0, 3.0):
            for seed in range(4):
                _, effort, std, _, spread = smoothed(shape, duration, peak, seed)
                found = [e for e in events(T, effort, std, 4.0 * std.mean(), spread) if abs(e.onset - START) < 1.0]
                z += [(e.onset - START) / e.onset_std for e in found]
                z += [(e.release - START - duration) / e.release_std for e in found]
    assert len(z) > 200
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.2
    assert np.mean(np.abs(z) < NORMAL_95) > 0.9


def test_a_push_that_ends_in_two_steps_is_released_where_the_last_ends():
    """The ramp of its flanks at 1/4 and 3/4 of the peak would end 2 s after the push."""
    for seed in range(4):
        _, effort, std, _, spread = smoothed("let go in two steps", 6.0, 3.0, seed)
        [found] = [e for e in events(T, effort, std, 4.0 * std.mean(), spread) if abs(e.onset - START) < 1.0]
        assert abs(found.release - START - 6.0) < 2.5 * found.release_std < 1.0


@pytest.mark.parametrize("peak", [1.0, 3.0])
def test_a_peak_is_as_sure_as_stated_whatever_the_push_is_like(peak):
    """Half of the tip that smoothing takes off, with as much as its error, was off by up to a third, and 2.2 errors."""
    z, size = [], []
    for shape, duration in [*PUSHES, ("triangle", 0.3), ("triangle", 0.2), ("sawtooth", 1.0), ("sawtooth", 0.4)]:
        for seed in range(4):
            true, effort, std, _, spread = smoothed(shape, duration, peak, seed)
            direct = true + 0.14 * np.random.default_rng(seed).normal(size=len(T))  # the drive's noise in `smoothed`
            window, free = (START - 0.05, START + duration + 0.05), np.abs(T - START - 0.5 * duration) > duration + 1.0
            means = narrower_means(T, direct, free, spread)
            found = summarise(T, (effort, std, direct), window, free, spread, means)
            z.append((found.peak - peak) / found.peak_std)
            size.append(found.peak_std / peak)
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.2
    assert np.mean(np.abs(z) < NORMAL_95) > 0.9
    assert np.mean(size) < 0.12 * (1.0 if peak < 2.0 else 0.5)


@pytest.mark.parametrize("rise_of", FLANKS.values(), ids=FLANKS)
@pytest.mark.parametrize("r_dq", [2e-3, 0.1])
@pytest.mark.parametrize("flank", [0.1, 0.15, 0.25, 0.5])
def test_a_flank_begins_within_its_error_whatever_the_smoother_s_step_is_like(flank, r_dq, rise_of):
    """Without noise.  By a step's steepest slope soft flanks were up to 4 errors off."""
    noise = STARTS._replace(r_dq=r_dq)
    noise = noise._replace(q_tau=smallest_q_tau(tracker("ekf"), INERTIA, VISCOUS, T_S, noise))
    rising, falling = (rise_of(np.clip(x / flank, 0.0, 1.0)) for x in (T - START, START + 3.0 - T))
    joint = joint_at_rest(np.full(len(T), INERTIA), VISCOUS, rising * falling, T_S, 1.0)
    effort, spread = tracker("rts")(joint, noise).tau_ext, rise(tracker("rts"), joint, noise)
    [found] = events(T, effort, np.full(len(T), 1e-3), 0.05, spread)
    assert abs(found.onset - START) < 1.25 * found.onset_std
    assert abs(found.release - START - 3.0) < 1.25 * found.release_std
