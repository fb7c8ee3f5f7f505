"""The search for a joint's model finds the terms, the low-pass and the lag that its logs were made with."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from davinci_forces.errors import NotIdentifiable
from davinci_forces.identification import candidates, search
from davinci_forces.identification.candidates import RIDGES, library, reach_of
from davinci_forces.identification.joint_models import at_samples
from davinci_forces.identification.observations import Processing, observe
from davinci_forces.identification.search import CUTOFF_GRID, MIN_BETTER_BLOCKS, JointSearch, neighbours, sets_of_terms
from davinci_forces.maths.models.terms import OF_MOTION, TERMS, presliding_friction, smooth_sign, stribeck
from davinci_forces.maths.selection import CrossValidation
from davinci_forces.maths.signals.smoothing import lowpass
from davinci_forces.records import Motion
from davinci_forces.robots import davinci
from davinci_forces.robots.models import OPTIONAL_TERMS, Reach, coupled_arm, independent, model_of
from tests.report.report_records import prediction

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
    about = ("identification", RATE, "logged", 17.0, 0.0, 0)
    ddq = np.gradient(smooth[1], 1 / RATE)
    return Motion("run", ROLL.name, *about, t, *smooth, ddq, *measured, tau, zero, zero, 0.0, 0.0, 0.0, zero)


def found(record: Motion, joint=ROLL):
    log = observe([record], (), 17.0, 0)
    return JointSearch(davinci.ROBOT, joint.name, "independent", [log], reach_of([log], joint.name)).run(START)


def test_a_term_that_the_effort_has_is_found_and_one_that_it_has_not_is_not():
    quadratic = (0.3, lambda q, dq: np.abs(dq) * dq)
    assert "quadratic friction" in {term.name for term in found(motion([quadratic])).chosen.terms}
    plain = found(motion())
    assert plain.chosen.score == pytest.approx(plain.steps[0].score, rel=0.1)
    assert "quadratic friction" not in {term.name for term in plain.chosen.terms}


def test_friction_that_reverses_within_a_short_way_is_found_and_not_hidden_by_a_low_pass():
    """A low-pass of 8 Hz and a lag of 10 ms explain half of it, and then no such friction can be seen."""
    x_0 = 2e-4 * float(np.ptp(motion().q))

    def late(q, dq):
        z = np.zeros(len(q))
        for k in range(1, len(q)):
            z[k] = np.sign(dq[k]) + (z[k - 1] - np.sign(dq[k])) * np.exp(-abs(q[k] - q[k - 1]) / x_0)
        return z - np.sign(dq)

    chosen = found(motion([(0.3, late)], noise=1e-4)).chosen
    way = min(term.displacement for term in chosen.terms if term.displacement > 0)
    assert way == pytest.approx(x_0, rel=0.7)
    assert abs(chosen.processing.effort_lag) < 0.003


@pytest.mark.parametrize("width", [0.01, 0.018, 0.055])
def test_a_width_between_those_of_the_grid_is_found(width):
    record = motion([(0.3, lambda q, dq: np.tanh(dq / width) - np.sign(dq))])
    [term] = (term for term in found(record).chosen.terms if term.name == "smooth friction")
    assert abs(np.log(term.width / width)) < np.log(1.3)


def test_a_noisy_motion_gets_a_lower_cutoff():
    """The acceleration of a noisy motion passes less noise at a lower cutoff."""
    noisy, clean = (found(motion(noise=noise)).chosen.processing.cutoff for noise in (2e-3, 0.0))
    assert noisy < 17.0 <= clean


@pytest.mark.parametrize("lag", [-LAG, LAG])
def test_the_lag_of_the_effort_is_found(lag):
    assert found(motion(lag=lag)).chosen.processing.effort_lag == pytest.approx(lag, abs=0.0026)


def test_each_step_is_better_than_the_one_before_in_most_blocks():
    steps = found(motion([(0.3, lambda q, dq: np.abs(dq) * dq), (0.2, lambda q, dq: q**2)])).steps
    assert len(steps) > 2
    for before, step in pairwise(steps):
        assert step.score < before.score
        assert (step.errors.unseen[0] < before.errors.unseen[0]).mean() >= MIN_BETTER_BLOCKS


def test_scores_of_all_cutoffs_are_of_the_same_effort():
    log = observe([motion(noise=1e-3)], (), 17.0, 0)
    model = independent(ROLL)
    squares = [
        library(model, [log._replace(processing=(Processing(cutoff, 0.0),))], 1).cells.scored.squares
        for cutoff in (6.0, 17.0, 30.0)
    ]
    for other in squares[1:]:
        np.testing.assert_allclose(other, squares[0], rtol=1e-12)


def test_a_sliding_joint_has_no_harmonics_and_one_with_an_offset_gets_no_second():
    names = {term.name for terms in sets_of_terms(SLIDE, "independent") for term in terms}
    assert not {name for name in names if "harmonic" in name}
    assert "offset" in names
    assert "offset" not in {term.name for terms in sets_of_terms(SLIDE, "coupled") for term in terms}


@pytest.mark.parametrize(
    ("grid", "ends", "least", "most"),
    [
        (search.CUTOFF_GRID, (5.0, 30.0), 1.16, 1.34), (search.RIDGE_GRID, (1e-5, 0.1), 2.9, 3.4),
        (search.DISPLACEMENT_GRID, (2e-4, 0.1), 1.9, 2.6), (search.WIDTH_GRID, (0.03, 0.3), 2.9, 3.4),
        (search.DECAY_VELOCITY_GRID, (0.1, 0.6), 1.9, 3.0),
    ],
)  # fmt: skip
def test_steps_of_a_grid_are_about_one_factor(grid, ends, least, most):
    assert (grid[0], grid[-1]) == ends
    assert all(least < larger / smaller <= most + 1e-9 for smaller, larger in pairwise(grid))


@pytest.mark.parametrize(
    ("everywhere", "cutoffs", "lags"),
    [
        (True, [5, 6, 8, 10, 12, 14, 17], [-0.01, -0.0075, -0.005, -0.0025, 0, 0.0025, 0.005, 0.0075, 0.01]),
        (False, [12, 14, 17], [-0.0025, 0, 0.0025]),
    ],
)
def test_cutoffs_up_to_0_4_of_the_sampling_rate_and_lags_of_ten_milliseconds_are_tried(
    monkeypatch, everywhere, cutoffs, lags
):
    """Beside the study's cutoff; first all, later those next to the last."""
    tried: list[Processing] = []
    log = observe([replace(motion(), rate=37.5)], (), 17.0, 0)
    of_roll = JointSearch(davinci.ROBOT, ROLL.name, "independent", [log], Reach(1.0, 1.0))
    monkeypatch.setattr(of_roll, "best_processing", lambda step, options: tried.extend(options) or step)
    step = SimpleNamespace(processing=Processing(14.0, 0.0))
    assert of_roll.improve_processing(step, START, everywhere) is step
    assert [p.cutoff for p in tried if p.cutoff != 14.0] == [x for x in cutoffs if x != 14]
    np.testing.assert_allclose([p.effort_lag for p in tried[len(cutoffs) :]], lags, atol=1e-12)


def test_a_joint_gets_no_term_twice_two_presliding_frictions_and_eight_terms(monkeypatch):
    log = observe([motion()], (), 17.0, 0)
    of_roll = JointSearch(davinci.ROBOT, ROLL.name, "independent", [log], Reach(2.0, 0.5))

    def offered(*used):
        return dict(of_roll.options(used))

    first, second = presliding_friction(0.1, 1), presliding_friction(0.2, 2)
    plain = offered()
    assert plain["presliding friction, 5 % of the range"] == (first,)
    assert plain["smooth friction, 30 % of the velocity"] == (smooth_sign(0.15),)
    assert plain["Stribeck friction, 60 % of the velocity"] == (stribeck(0.3),)
    names = {name for name in plain if "presliding" in name}
    assert {name for name in offered(first) if "presliding" in name} == names - {
        "presliding friction, 5 % of the range"
    }
    assert offered(first)["presliding friction, 10 % of the range"] == (second,)
    assert not [name for name in offered(first, second) if "presliding" in name]
    assert not [name for name in offered(stribeck(0.3)) if name.startswith("Stribeck")]
    monkeypatch.setattr(of_roll, "step", lambda name, *others: asked.append(name))
    for number, is_asked in ((7, True), (8, False)):
        asked: list[str] = []
        of_roll.add_term(SimpleNamespace(terms=tuple(OF_MOTION.values())[:number], processing=START, strength=0.1))
        assert bool(asked) == is_asked


@pytest.mark.parametrize(("better", "improves"), [(3, False), (4, True), (6, True)])
def test_a_step_has_to_improve_two_thirds_of_the_blocks_and_the_sum(better, improves):
    def step(squares):
        return search.Step("", START, (), 0.0, 1, CrossValidation((np.array(squares)[:, None],), ()))

    before = step([1.0] * 6)
    assert step([0.5] * better + [1.0] * (6 - better)).improves(before) == improves
    assert not step([0.9] * 5 + [2.0]).improves(before)


def test_a_search_takes_20_000_samples_of_six_logs_from_the_first_to_the_last(monkeypatch):
    made = []
    monkeypatch.setattr(
        search, "JointSearch", lambda *given: made.append(given) or SimpleNamespace(run=lambda start: 0)
    )
    logs = [
        SimpleNamespace(joints=["roll"], is_moving=[i > 0], first_samples=lambda number, i=i: (i, number))
        for i in range(8)
    ]
    search.search_joints(davinci.ROBOT, {"roll": logs}, logs, {"roll": Reach(1.0, 1.0)}, 17.0)
    (_, _, alone, by_itself, _), (_, _, together, coupled, _) = made
    assert (alone, together) == ("independent", "coupled")
    assert by_itself == [(i, 20_000) for i in (0, 1, 3, 4, 6, 7)]
    assert coupled == [(i, 20_000) for i in (1, 2, 3, 5, 6, 7)]  # those in which the joint moves


@pytest.mark.parametrize(("joints", "alone"), [(2, ()), (3, (0, 1, 2))])
def test_searched_joints_share_links_all_or_all_but_one_of_more_than_two(monkeypatch, joints, alone):
    names = [joint.name for joint in davinci.ROBOT.joints][:joints]
    step = SimpleNamespace(score=0.1, terms=())
    searches = [
        search.SearchResult(name, kind, (), step, step) for name in names for kind in ("independent", "coupled")
    ]
    monkeypatch.setattr(search, "searched_part", lambda robot, result, *others: result.joint)
    monkeypatch.setattr(candidates, "weights_of", lambda parts: np.arange(joints) + 1.0)
    monkeypatch.setattr(search, "shared_part", lambda robot, sharing, arm, count, weights: Shared(sharing, weights))

    class Shared(SimpleNamespace):
        def __init__(self, sharing, weights):
            super().__init__(joints=[s.joint for s in sharing], weights=weights.tolist())

        def with_ridge(self, strength):
            return self

    separate = dict.fromkeys(names, ())
    first, *shared = search.searched_candidates(davinci.ROBOT, searches, separate, (), 1)
    assert (first.name, first.parts) == ("searched, joint by joint", tuple(names))
    assert len(shared) == len(search.RIDGE_GRID) * (1 + len(alone))
    for candidate, left_out in zip(shared[:: len(search.RIDGE_GRID)], (None, *alone), strict=True):
        among, *separately = candidate.parts
        assert separately == ([] if left_out is None else [names[left_out]])
        assert among.joints == [name for name in names if name not in separately]
        assert among.weights == [i + 1.0 for i in range(joints) if i != left_out]
        assert (f"except for {separately[0]}" if separately else "links shared, ridge") in candidate.name
    assert search.searched_candidates(davinci.ROBOT, searches[2:], separate, (), 1) == []


def test_the_reach_of_a_joint_is_its_largest_range_and_its_speed_over_all_logs():
    """But for 1 % of the samples at either end."""

    def ramp(length, speed):
        q = np.linspace(0.0, length, 1001)
        columns = dict.fromkeys(("t", "ddq", "q_measured", "dq_measured", "tau"), q)
        zero = dict.fromkeys(("segment", "filled", "standing"), np.zeros(1001, np.int64))
        columns |= {"q": q, "dq": np.full(1001, speed)}
        return observe([replace(motion(), **columns, **zero)], (), 17.0, 0)

    assert reach_of([ramp(0.001, 3.0), ramp(0.002, 4.0)], ROLL.name) == Reach(0.00196, 3.54)
    assert reach_of([ramp(2.0, 3.0), ramp(1.0, 4.0)], ROLL.name) == Reach(1.96, 3.54)
    with pytest.raises(NotIdentifiable, match=f"{ROLL.name}: its velocity in run is lost in noise"):
        reach_of([ramp(2.0, 0.0)], ROLL.name)


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


def test_ridges_that_are_tried_leave_no_gap_wider_than_ten_and_begin_with_hardly_any():
    """A coupled arm is never without one: its links share what no motion tells apart."""
    alone, *others = RIDGES["independent"]
    assert alone == 0.0
    assert others
    assert max(others) <= 1e-3  # a joint's few parameters need no more
    arm = RIDGES["coupled"]
    assert 0.0 < arm[0] <= 1e-4
    assert arm[-1] >= 0.03
    assert all(1.0 < stronger / weaker <= 10.001 for weaker, stronger in pairwise(arm))


def test_a_prediction_counts_at_samples_within_half_a_sample_of_its_own():
    t, tau_hat = np.array([0.0, 0.01, 0.03]), np.array([1.0, 2.0, 3.0])
    predicted = prediction(t=t, tau=tau_hat, tau_hat=tau_hat)
    here = SimpleNamespace(rate=100.0, t=np.array([0.0, 0.0104, 0.0156, 0.0244, 0.0256, 0.0344, 0.0356]))
    assert np.array_equal(at_samples(predicted, here), [1.0, 2.0, np.nan, np.nan, 3.0, 3.0, np.nan], equal_nan=True)
