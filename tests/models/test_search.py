"""The search for a joint's model finds the terms, the low-pass and the lag that its logs were made with."""

from itertools import pairwise

import numpy as np
import pytest

from davinci_forces.identification.candidates import library, reach_of
from davinci_forces.identification.observations import Processing, observe
from davinci_forces.identification.search import CUTOFF_GRID, MIN_BETTER_BLOCKS, JointSearch, neighbours, sets_of_terms
from davinci_forces.maths.models.terms import OF_MOTION, TERMS, presliding_friction, smooth_sign, stribeck
from davinci_forces.maths.signals.smoothing import lowpass
from davinci_forces.records import Motion
from davinci_forces.robots import davinci
from davinci_forces.robots.models import OPTIONAL_TERMS, coupled_arm, independent, model_of

ROLL, SLIDE = (davinci.ROBOT.joint(name) for name in ("hand_roll", "instrument_slide"))
RATE, PERIOD, LAG = 200.0, 7.0, 0.005
START = Processing(17.0, 0.0)


def motion(added=(), noise=0.0, lag=0.0, seed=0) -> Motion:
    """The roll on a rich path; its effort has its terms and `added` ones, and comes `lag` [s] later than the motion."""
    random, t = np.random.default_rng(seed), np.arange(round(6 * PERIOD * RATE)) / RATE
    a, phase = random.normal(size=6) * 0.1, random.uniform(0, 6, 6)
    w = 2 * np.pi / PERIOD * np.arange(1, 7)

    def derivatives(t):
        x = np.outer(t, w) + phase
        return np.sin(x) @ a, np.cos(x) @ (a * w), -np.sin(x) @ (a * w**2)

    def effort(t):
        q, dq, ddq = derivatives(t)
        tau = 0.05 * ddq + 0.2 * dq + 0.3 * np.sign(dq)
        return tau + sum(size * function(q, dq) for size, function in added)

    q, dq, _ = derivatives(t)
    measured = q + noise * random.normal(size=len(t)), dq + noise * 30 * random.normal(size=len(t))
    smooth = (lowpass(measured[0], RATE, 17.0), lowpass(measured[1], RATE, 17.0))
    tau = effort(t - lag) + 0.02 * random.normal(size=len(t))
    zero = np.zeros(len(t), np.int64)
    about = ("identification", RATE, "logged", 17.0, 0.0, 0, 0.0, 0.0, 0.0)
    ddq = np.gradient(smooth[1], 1 / RATE)
    return Motion("run", ROLL.name, *about, t, *smooth, ddq, *measured, tau, zero, zero, zero)


def search(record: Motion, joint=ROLL):
    log = observe([record], (), 17.0, 0)
    return JointSearch(davinci.ROBOT, joint.name, "independent", [log], reach_of([log], joint.name)).run(START)


def test_a_term_that_the_effort_has_is_found_and_one_that_it_has_not_is_not():
    quadratic = (0.3, lambda q, dq: np.abs(dq) * dq)
    assert "quadratic friction" in {term.name for term in search(motion([quadratic])).chosen.terms}
    plain = search(motion())
    assert plain.chosen.score == pytest.approx(plain.steps[0].score, rel=0.1)
    assert "quadratic friction" not in {term.name for term in plain.chosen.terms}


def test_a_noisy_motion_gets_a_lower_cutoff():
    """The acceleration of a noisy motion passes less noise at a lower cutoff."""
    noisy, clean = (search(motion(noise=noise)).chosen.processing.cutoff for noise in (2e-3, 0.0))
    assert noisy < 17.0 <= clean


@pytest.mark.parametrize("lag", [-LAG, LAG])
def test_the_lag_of_the_effort_is_found(lag):
    assert search(motion(lag=lag)).chosen.processing.effort_lag == pytest.approx(lag, abs=0.0026)


def test_each_step_is_better_than_the_one_before_in_most_blocks():
    steps = search(motion([(0.3, lambda q, dq: np.abs(dq) * dq), (0.2, lambda q, dq: q**2)])).steps
    assert len(steps) > 2
    for before, step in pairwise(steps):
        assert step.score < before.score
        assert (step.errors.unseen[0] < before.errors.unseen[0]).mean() >= MIN_BETTER_BLOCKS


def test_scores_of_all_cutoffs_are_of_the_same_effort():
    log = observe([motion(noise=1e-3)], (), 17.0, 0)
    model = independent(ROLL)
    squares = [
        library(model, [log.process([Processing(cutoff, 0.0)])], 1).cells.scored.squares for cutoff in (6.0, 17.0, 30.0)
    ]
    for other in squares[1:]:
        np.testing.assert_allclose(other, squares[0], rtol=1e-12)


def test_a_sliding_joint_has_no_harmonics_and_one_with_an_offset_gets_no_second():
    names = {term.name for terms in sets_of_terms(SLIDE, "independent") for term in terms}
    assert not {name for name in names if "harmonic" in name}
    assert "offset" in names
    assert "offset" not in {term.name for terms in sets_of_terms(SLIDE, "coupled") for term in terms}


def test_neighbours_of_a_value_lie_on_both_sides():
    assert neighbours(CUTOFF_GRID, 17.0) == (14.0, 17.0, 20.0)
    assert neighbours(CUTOFF_GRID, 5.0) == (5.0, 6.0)


def test_a_model_is_rebuilt_from_the_names_and_scales_of_its_parameters():
    """Every term that a search may add: the fit of a study holds no more than names and scales."""
    scaled = (presliding_friction(0.01), presliding_friction(0.1, 2), smooth_sign(0.3), stribeck(0.2))
    lacking = [TERMS[name] for name in OPTIONAL_TERMS if TERMS[name] not in ROLL.terms]
    model = independent(ROLL, (*OF_MOTION.values(), *scaled, *lacking), "chosen")
    arm = coupled_arm(davinci.ROBOT, [0, 2], [scaled, tuple(OF_MOTION.values())], "chosen")
    for structure, made in (("independent", model), ("coupled", arm)):
        names, scales = zip(*((p.name, p.scale) for p in made.parameters), strict=True)
        assert model_of(davinci.ROBOT, structure, "chosen", made.group, names, scales) == made
