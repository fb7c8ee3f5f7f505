"""Data that do not tell what is asked of them: a clear statement from every stage, never a silently wrong number."""

from dataclasses import replace

import numpy as np
import pytest

from davinci_forces.maths.signals.windows import UNSCORED_SAMPLE, free_space
from davinci_forces.records import Choice, Diagnostic, FilterNoise, Fit, JointModel, Signal
from davinci_forces.stages.forces import benchmark
from davinci_forces.stages.model import choose, fit
from davinci_forces.study import LogEntry
from tests import arm
from tests.test_estimation import trajectory

RATE = 100.0


def recording(q, dq, seed=0, name="hand_roll") -> Signal:
    """A joint that goes so, with the arm's friction and gravity and its noise."""
    tau = arm.THETA[name][-2] * dq + arm.THETA[name][-1] * np.sign(dq) + 0.1 * np.sin(q)
    tau = tau + 0.05 * np.random.default_rng(seed).normal(size=len(q))
    t = np.arange(len(q)) / RATE
    zero = np.zeros(len(q), int)
    return Signal("run", name, "identification", RATE, "as recorded", "logged", 0, 0, t, q, dq, tau, zero, zero)


def constant(samples: int) -> Signal:
    return recording(0.2 * np.arange(samples) / RATE, np.full(samples, 0.2))


def said(stage, *signals) -> tuple[list, str]:
    """What a stage makes of signals that do not repeat, and what it says."""
    motions = [arm.motion(s) for s in signals]
    settings = {"lowpass": 17.0, **({"fit": "chosen"} if stage is choose else {})}
    made = list(stage.run(*(([], motions) if stage is fit else (motions, [])), arm.ARM, **settings))
    texts = [text for record in made if isinstance(record, Diagnostic) for text in record.text]
    return [record for record in made if not isinstance(record, Diagnostic)], " ".join(texts)


def test_a_constant_velocity_is_named_as_what_does_not_excite_the_inertia():
    made, text = said(fit, constant(1000))
    assert [record for record in made if isinstance(record, Fit)] == []
    for name in ("lse", "pso", "bounded", "prior", "huber", "iv", "tls", "consistent"):
        assert f"hand_roll: {name} is left out: " in text
    assert "inertia" in text


def test_nothing_is_chosen_from_a_constant_velocity_and_it_is_said():
    made, text = said(choose, constant(1000))
    assert [record for record in made if isinstance(record, Choice | Fit)] == []
    assert "no model could be chosen" in text


@pytest.mark.parametrize("samples", [30, 60])
def test_too_few_samples_are_counted_against_the_parameters(samples):
    t = np.arange(samples) / RATE
    signal = recording(0.3 * np.sin(6 * t), 1.8 * np.cos(6 * t))
    made, text = said(fit, signal)
    for record in made:
        if isinstance(record, Fit):
            assert record.samples > len(record.theta)
            assert np.isfinite(record.theta_std).all()
    made, text = said(choose, signal)
    assert text or [record for record in made if isinstance(record, Choice)]


def test_a_handful_of_samples_is_refused_with_both_numbers():
    t = np.arange(4) / RATE
    _, text = said(fit, recording(0.3 * np.sin(20 * t), 6.0 * np.cos(20 * t)))
    assert "samples for 4 parameters: record more of the motion" in text


def test_three_periods_have_no_weights_and_are_fitted_otherwise():
    found = fit.run([trajectory(arm.signal("hand_roll", periods=3))], [], arm.ARM, lowpass=17.0)
    made = list(found)
    texts = [text for record in made if isinstance(record, Diagnostic) for text in record.text]
    assert any("wlse is left out: weights need at least 4 periods" in text for text in texts)
    assert "lse" in {record.estimator for record in made if isinstance(record, Fit)}


def compared(samples: int | None = None) -> list:
    """What the comparison of the filters makes of a log; `samples` of free motion, or all."""
    identified = list(fit.run([trajectory(arm.signal("hand_roll"))], [], arm.ARM, lowpass=17.0))
    fits = [record for record in identified if isinstance(record, Fit)]
    log = arm.signal("hand_roll", seed=1, periods=2, role="validation", log="check")
    model = next(record for record in arm.models([log], fits) if isinstance(record, JointModel))
    left_out = np.full(len(model), UNSCORED_SAMPLE)
    left_out[np.flatnonzero(free_space(model.t, (), model.rate))[:samples]] = 0
    noise = FilterNoise(
        "hand_roll", ("run",), RATE, 1e-4, 1e-3, arm.NOISE["hand_roll"], 1.0, 0.1, 0.02, 0.1, np.ones(1), np.ones(1)
    )
    entry = LogEntry("check", ("check.csv",), "validation", ())
    return list(benchmark.run(replace(model, unscored=left_out), fits, noise, entry, arm.ARM, q_tau=0.0))


@pytest.mark.parametrize(("samples", "is_compared"), [(99, False), (100, True)])
def test_filters_are_compared_from_a_hundred_samples_of_free_motion_on(samples, is_compared):
    assert bool(compared(samples)) == is_compared


@pytest.mark.parametrize(("share", "warnings"), [(0.49, 1), (0.51, 0)])
def test_a_filter_that_shows_less_than_half_of_a_push_is_warned_of_once(share, warnings, monkeypatch):
    monkeypatch.setattr(benchmark, "response", lambda *_: (share, 0.1))
    texts = [text for record in compared() if isinstance(record, Diagnostic) for text in record.text]
    assert len([text for text in texts if f"the filter shows only {share:.0%} of a push" in text]) == warnings
