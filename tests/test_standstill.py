"""Standstill: friction takes any value there, so nothing is fitted to a joint's effort then, nor judged by it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.selection import path_blocks, sum_equations
from davinci_forces.maths.signals.smoothing import lowpass, noise_std
from davinci_forces.maths.signals.standstill import HOLD, is_standing_still
from davinci_forces.records import Average, Choice, Diagnostic, Fit, Prediction, Recording, Trajectory
from davinci_forces.stages.model import choose, fit
from davinci_forces.stages.recordings import average, differentiate, resample
from davinci_forces.study import LogEntry
from tests import arm

RATE, LOWPASS = 100.0, 17.0
ENTRY = LogEntry(name="run", files=("x",), role="identification", channels=())
STOP = 6.0  # [s]


def moved(t):
    """Position and velocity that stand still for 3 s, move for 30 s and stop: (N,) each."""
    s = np.clip(t - 3.0, 0.0, 30.0)
    return 0.5 * (1.0 - np.cos(0.2 * np.pi * s)), 0.1 * np.pi * np.sin(0.2 * np.pi * s)


def stands(q, dq, segment=None, **more):
    return is_standing_still(q, dq, np.zeros(len(q), int) if segment is None else segment, RATE, **more)


@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-3])
def test_a_stop_is_found_from_where_it_begins_to_where_it_ends(noise):
    t = np.arange(4000) / RATE
    q, dq = moved(t)
    found = stands(q + noise * np.random.default_rng(0).normal(size=len(t)), dq, q_std=noise)
    edges = t[np.flatnonzero(np.diff(found.astype(int)))]
    assert_allclose(edges, [3.0, 33.0], atol=0.7 * HOLD)
    assert found[0]
    assert found[-1]


def test_turns_of_a_motion_are_no_stop_however_noisy_it_is():
    t = np.arange(9000) / RATE
    q, dq = np.cos(2 * np.pi * t / 20.0), -np.pi / 10.0 * np.sin(2 * np.pi * t / 20.0)
    for noise in (0.0, 1e-3, 0.1):
        assert not stands(q, dq, q_std=noise).any()


def test_a_stop_shorter_than_a_turn_is_none_and_one_is_not_put_together_across_a_gap():
    t = np.arange(4000) / RATE
    q, dq = moved(t)
    short = t < 33.0 + 0.8 * HOLD
    assert not stands(q[short], dq[short])[-1]
    apart = np.where(t < 33.0 + 0.8 * HOLD, 0, 1)
    some = t < 33.0 + 1.6 * HOLD
    assert not stands(q[some], dq[some], apart[some])[-1]
    assert stands(q[some], dq[some])[-1]


def test_as_many_samples_around_it_are_left_out_as_a_low_pass_spreads():
    t = np.arange(4000) / RATE
    q, dq = moved(t)
    assert stands(q, dq, spread=6).sum() == stands(q, dq).sum() + 12  # one end of each stop is inside the log


def test_an_effort_that_is_not_known_counts_nothing_and_the_others_do():
    random = np.random.default_rng(0)
    Phi, tau, cell = random.normal(size=(60, 2, 3)), random.normal(size=(60, 2)), np.repeat([0, 1, 2], 20)
    unknown = np.zeros(60, bool)
    unknown[[0, 25, 26, 40]] = True
    unknown[40:] = True
    made = sum_equations(Phi, np.where(np.stack([unknown, np.zeros(60, bool)], 1), np.nan, tau), cell, 3)
    for effort, known in enumerate((~unknown, np.ones(60, bool))):
        for c in range(3):
            rows = known & (cell == c)
            assert_allclose(made.gram[c, effort], Phi[rows, effort].T @ Phi[rows, effort], rtol=1e-12)
            assert made.squares[c, effort] == pytest.approx(tau[rows, effort] @ tau[rows, effort])


def test_blocks_of_a_path_that_does_not_repeat_are_sixths_of_what_moves():
    t = np.arange(1200) / RATE
    moving = (t >= 3.0) & (t < 9.0)
    assert_allclose(np.bincount(path_blocks(t, 0.0, moving)[moving]), 100, atol=1)


def stopped(stuck: float):
    """Four periods of the hand roll and a stop, in which friction holds some effort."""
    signal = arm.signal("hand_roll", periods=4, noise=0.02, seed=2)
    q, dq, ddq = arm.excitation("hand_roll", signal.t)
    t = np.arange(len(signal.t) + round(STOP * RATE)) / RATE
    stop, more = t >= signal.t[-1] + 0.5 / RATE, np.full(round(STOP * RATE), 1.0)
    noise = 0.003 * np.random.default_rng(1).normal(size=len(t))
    tau = regressor(arm.joint("hand_roll").terms, q, dq, ddq) @ arm.THETA["hand_roll"]
    return replace(
        signal, t=t, q=np.append(signal.q, q[-1] * more), dq=np.append(dq, 0.0 * more),
        tau=np.append(tau, stuck * more) + noise, segment=np.zeros(len(t), int), filled=np.zeros(len(t), int),
    ), stop  # fmt: skip


def chosen(signal, named="chosen"):
    """What the stages up to `predict` make of one log."""
    motion = arm.motion(signal, LOWPASS)
    [mean] = [r for r in average.run([signal], ENTRY, arm.ARM, harmonics=0, lowpass=LOWPASS) if isinstance(r, Average)]
    joint = arm.joint("hand_roll")
    [own] = [r for r in differentiate.run(mean, joint, harmonics=0) if isinstance(r, Trajectory)]
    made = list(choose.run([motion], [mean], arm.ARM, fit=named, lowpass=LOWPASS))
    cv = fit.apply([motion], [own], [], ENTRY, arm.ARM, lowpass=LOWPASS)
    return [mean, *made, *(r for r in cv if isinstance(r, Prediction))]


@pytest.fixture(scope="module")
def held():
    return {stuck: chosen(stopped(stuck)[0]) for stuck in (0.2, -0.2)}


def kinds(records, kind):
    return [r for r in records if isinstance(r, kind)]


def test_what_friction_holds_in_a_stop_moves_no_parameter_and_no_score(held):
    one, other = held.values()
    assert kinds(one, Choice)[0].chosen == kinds(other, Choice)[0].chosen
    for a, b in zip(kinds(one, Fit), kinds(other, Fit), strict=True):
        assert_allclose(a.theta, b.theta, atol=1e-3)
    for a, b in zip(kinds(one, Prediction), kinds(other, Prediction), strict=True):
        assert a.relative_error == pytest.approx(b.relative_error, abs=1e-4)
        assert a.relative_error < 0.05


def resampled(signal, role="identification"):
    columns = {name: getattr(signal, name) for name in ("t", "q", "dq", "tau", "filled")}
    recording = Recording("run", "hand_roll", role, RATE, "logged", **columns)
    return list(resample.run(recording, arm.joint("hand_roll"), lowpass=LOWPASS))


def test_the_reviewer_is_told_when_a_joint_stands_still():
    signal, _ = stopped(0.2)
    [note] = kinds(resampled(signal), Diagnostic)
    assert note.severity[0] == "note"
    assert "run/hand_roll: it stands still from 3" in note.text[0]
    assert "to 45.99 s, 13 % of the log" in note.text[0]
    assert not kinds(resampled(arm.signal()), Diagnostic)
    assert [d.text[0] for d in kinds(resampled(signal, "validation"), Diagnostic)] == [note.text[0]]
    assert not kinds(resampled(signal, "tissue"), Diagnostic)


def test_every_fit_states_its_error_without_a_period_beside_the_joint_s_own_and_over_the_same_samples(held):
    made = {(p.model, p.estimator): p for p in kinds(held[0.2], Prediction)}
    mean, choice = kinds(held[0.2], Average)[0], kinds(held[0.2], Choice)[0]
    own = made["independent", "lse"]
    assert own.scheme == "leave one period out"
    fits = {(f.model, f.estimator) for f in kinds(held[0.2], Fit) if f.estimator != "consistent"}
    assert fits
    for name in {name for name in fits if name[0] != "chosen"}:
        p = made[name]
        assert (p.scheme, p.path) == (own.scheme, own.path)
        assert_allclose(p.t, own.t)
        assert p.prefix == f"cv.run.hand_roll.{name[0]}.{name[1]}"
    assert len(own.t) == 4 * 1000
    assert mean.periods == 4
    assert made["chosen", f"{choice.model}.{choice.estimator}"].scheme == "leave a block of path out"


@pytest.mark.parametrize(("model", "estimator"), [("independent", "lse"), ("independent+smooth", "lse")])
def test_a_period_is_predicted_by_who_has_not_seen_it(model, estimator):
    """Friction that is larger in one period moves what is predicted of the others, and not what is of its own."""
    signal, _ = stopped(0.2)
    third = (signal.t >= 20.0) & (signal.t < 30.0)
    other = replace(signal, tau=signal.tau + 0.2 * third * np.sign(signal.dq))
    before, after = (
        next(p for p in kinds(chosen(each, f"{model}.{estimator}"), Prediction)
             if (p.model, p.estimator) == (model, estimator))
        for each in (signal, other)
    )  # fmt: skip
    assert before.scheme == "leave one period out"
    own, moved_by = third[: len(after.t)], np.abs(after.tau_hat - before.tau_hat)
    assert np.median(moved_by[own]) < 0.05 * np.median(moved_by[~own])


def test_a_drive_s_ripple_is_no_noise_where_periods_tell_that_it_repeats():
    """Faster than the low-pass, a ripple looks like noise to whoever sees one period."""
    signal = arm.signal("hand_roll", noise=0.0)
    white = 0.05 * np.random.default_rng(3).normal(size=len(signal.t))
    ripple = 0.2 * np.sin(2 * np.pi * 25.0 * signal.t)
    [mean] = kinds(
        average.run([replace(signal, tau=signal.tau + white + ripple)], ENTRY, arm.ARM, harmonics=0, lowpass=LOWPASS),
        Average,
    )
    assert mean.sigma_tau_white == pytest.approx(noise_std(white, signal.segment, RATE, LOWPASS), rel=0.03)
    assert mean.sigma_tau_white < 0.5 * noise_std(white + ripple, signal.segment, RATE, LOWPASS)
    passed = lowpass(white, RATE, LOWPASS).std() / lowpass(signal.tau, RATE, LOWPASS).std()
    assert mean.relative_noise == pytest.approx(passed, rel=0.1)
    assert "noise.run.hand_roll.relative_noise" in [p.key for p in mean.published()]
