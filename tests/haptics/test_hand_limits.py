"""The limits of a hand: what speaks of the same thing agrees, and what differs differs by what it includes."""

from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from davinci_forces.haptics import limits
from davinci_forces.haptics import loop as haptic
from davinci_forces.haptics.maths.bimodal import THESIS_HAND, Hand, cqlf_limit
from davinci_forces.haptics.maths.delay import delay_limit, formula, response_limit, sampled_limit
from davinci_forces.haptics.scenario import FIRM, SLIDE, HapticScenario
from davinci_forces.records import HandLimit, Origin
from davinci_forces.records.catalogue import Catalogue, Provenance
from davinci_forces.report.content import Figure, Prose, Table, Verdict, walk
from davinci_forces.report.context import Context
from davinci_forces.report.results import collect
from davinci_forces.report.sections import stability
from davinci_forces.report.sections.summary import opening
from davinci_forces.robots import davinci
from davinci_forces.study import Settings, Study
from tests.haptics.test_limit import stiffness

NAN = float("nan")
FULL = haptic.complete_scenario(HapticScenario())
IDEAL = replace(FULL, exact=True, filtered=False, damping=0.0, friction=0.0)
MIDDLE = Hand(1.0, 10.0, 300.0)
POLE = 0.9  # of a filter y_k = POLE y_(k-1) + (1 - POLE) x_k
SAME = ("k_t_limit", "k_t_response", "k_t_simulated")


@pytest.fixture(scope="module")
def loop():
    return limits.loop_response(FULL)


def recordings(seed: int, gain: float = 1.0, logs: int = 2) -> list[limits.Recording]:
    """Logs of coloured noise with a trend, and what the filter makes of it."""
    rng, t = np.random.default_rng(seed), np.arange(6000) / 100.0
    made = [np.cumsum(rng.normal(size=len(t))) * 0.05 + rng.normal(size=len(t)) for _ in range(logs)]
    return [(t, x, gain * lfilter([1.0 - POLE], [1.0, -POLE], x)) for x in made]


def exact(frequency: float) -> complex:
    return (1.0 - POLE) / (1.0 - POLE * np.exp(-2j * np.pi * frequency / 100.0))


def test_the_filter_in_logs_is_found_within_its_error():
    """Of 40 real and imaginary parts, 38 are expected within two standard errors, and 34 or more in 99 % of cases."""
    within = 0
    for seed in range(20):
        H, std = limits.filter_response(recordings(seed), 1.7)
        assert 0.0 < std < 0.02 * abs(exact(1.7))
        error = H - exact(1.7)
        within += int(abs(error.real) < 2.0 * std) + int(abs(error.imag) < 2.0 * std)
    assert within >= 34


def test_too_little_of_a_log_measures_no_filter():
    H, std = limits.filter_response([tuple(x[:2000] for x in recordings(0)[0])], 1.7)
    assert np.isnan([H, std]).all()


@pytest.mark.medium
@pytest.mark.parametrize("hand", [THESIS_HAND, FIRM, MIDDLE])
def test_formula_response_and_simulation_of_the_same_loop_agree_within_5_percent(hand, loop):
    limit = limits.limits_of(FULL, "one", hand, loop)
    same = [getattr(limit, name) for name in SAME]
    assert max(same) < 1.05 * min(same), same
    assert limit.k_t_cqlf == cqlf_limit(hand)
    assert np.isnan(limit.k_t_limit_std)  # nothing was measured


@pytest.mark.medium
@pytest.mark.parametrize("share", [0.5, 0.96, 1.04, 1.9])
def test_the_limit_by_simulation_is_the_same_from_every_guess(share, loop):
    """A hand that bounces off far stiffer tissue with a bounded amplitude is not stable."""
    linear, (expected, _) = limits.without_friction(FULL), response_limit(THESIS_HAND, *loop)
    assert_allclose(limits.max_settling(linear, THESIS_HAND, share * expected), expected, rtol=0.05)
    assert not haptic.hand_settles(replace(linear, stiffness=2.0 * expected), THESIS_HAND)


@pytest.fixture(scope="module")
def loop_of_ideal():
    """The response of an ideal arm with a delay, which is the same for every hand: each is simulated once."""
    return cache(lambda delay: limits.loop_response(replace(IDEAL, force_delay=delay)))


@pytest.mark.medium
@pytest.mark.parametrize("hand", [THESIS_HAND, FIRM, MIDDLE])
@pytest.mark.parametrize("delay", [0.0, 0.03])
def test_with_an_ideal_arm_every_limit_is_that_of_a_held_force(hand, delay, loop_of_ideal):
    """Where a swing that shrinks by 3 % in a quarter of the time counts as lasting: that is within 3 %."""
    limit, expected = (
        limits.limits_of(replace(IDEAL, force_delay=delay), "one", hand, loop_of_ideal(delay)),
        sampled_limit(hand, delay, 100.0),
    )
    for name in (*SAME, "k_t_settles"):
        assert_allclose(getattr(limit, name), expected, rtol=0.03, err_msg=name)
    assert_allclose(limit.loop_delay, delay + 0.005, atol=5e-4)


def test_the_headline_takes_the_filter_from_the_logs_and_its_error_with_it():
    linear = limits.without_friction(FULL)
    in_loop = limits.measured_limit(linear, FIRM, 18.6, (), ())
    one, two = (limits.measured_limit(linear, FIRM, 18.6, recordings(3, gain), ()) for gain in (1.0, 2.0))
    assert_allclose(one["filter_share"], in_loop["filter_share"] * abs(exact(one["limit_frequency"])), rtol=0.02)
    assert_allclose(two["k_t_limit"], 0.5 * one["k_t_limit"], rtol=1e-6)
    late = [(t[5:], x[5:], y[:-5]) for t, x, y in recordings(3)]
    later = limits.measured_limit(linear, FIRM, 18.6, late, ())
    assert_allclose(later["loop_delay"] - one["loop_delay"], 0.05, atol=5e-4)
    assert later["k_t_limit"] < one["k_t_limit"]
    heavier = limits.without_friction(FULL, SLIDE._replace(viscous=SLIDE.viscous + 5.0))
    changed = limits.measured_limit(linear, FIRM, 18.6, recordings(3), [heavier])
    assert one["k_t_limit_std"] > 0.0
    assert changed["k_t_limit_std"] > 1.2 * one["k_t_limit_std"]
    unstable = limits.without_friction(FULL, SLIDE._replace(inertia=0.2))
    assert np.isnan(limits.measured_limit(linear, FIRM, 18.6, recordings(3), [unstable])["k_t_limit_std"])


def test_what_is_felt_without_tissue_adds_to_the_hand():
    w, Z = 12.0, complex(-7.0, 30.0)
    moved, delay, share = formula(MIDDLE, w, 0.5 * np.exp(-0.06j * w), Z)
    assert_allclose([delay, share], [0.06, 0.5])
    s = 1j * w
    assert_allclose(moved.m * s**2 + moved.b * s + moved.k, MIDDLE.m * s**2 + MIDDLE.b * s + MIDDLE.k + Z)


def test_the_response_of_a_pure_delay_has_the_limit_of_a_delay():
    w = 2.0 * np.pi * haptic.FREQUENCIES
    limit, crossing = response_limit(THESIS_HAND, w, np.exp(-0.05j * w), np.zeros(len(w)))
    assert_allclose(limit, delay_limit(THESIS_HAND, 0.05), rtol=1e-3)
    damped, _ = response_limit(THESIS_HAND, w, np.exp(-0.05j * w), 2.0j * w)
    assert_allclose(damped, delay_limit(THESIS_HAND._replace(b=3.0), 0.05), rtol=1e-3)
    assert abs(complex(crossing**2 - 100.0, -crossing)) == pytest.approx(limit, rel=1e-2)
    assert np.isnan(response_limit(Hand(1.0, 1e3, 100.0), w, np.full(len(w), 0.5j), np.zeros(len(w)))).all()


def test_the_best_delay_is_that_of_the_largest_limit_and_no_setting_changes():
    scenario = replace(IDEAL, force_delay=0.1)
    limit = limits.limits_of(scenario, "one", THESIS_HAND, limits.loop_response(scenario))
    total = 0.105 + np.linspace(0.0, 2.0 * np.pi / 10.0, 101)
    expected = [delay_limit(THESIS_HAND, delay) for delay in total.tolist()]
    assert_allclose(limit.k_t_best, max(expected), rtol=0.02)
    assert_allclose(0.105 + limit.best_delay, total[int(np.argmax(expected))], atol=0.02)
    assert limit.k_t_best > 3.0 * limit.k_t_response
    assert scenario.force_delay == 0.1


@pytest.mark.slow
def test_a_later_force_leaves_a_smaller_limit_and_a_weaker_one_a_larger_in_proportion(loop):
    assert FULL.force_delay == 0.0
    later = [loop, *(limits.loop_response(replace(FULL, force_delay=delay)) for delay in (0.05, 0.1))]
    assert (np.diff([response_limit(FIRM, *of)[0] for of in later]) < 0.0).all()
    halved = replace(IDEAL, device=IDEAL.device._replace(force=0.5))
    limit = limits.limits_of(halved, "one", THESIS_HAND, limits.loop_response(halved))
    for name in SAME:
        assert_allclose(getattr(limit, name), 2.0 * sampled_limit(THESIS_HAND, 0.0, 100.0), rtol=0.03)


def context(**about) -> Context:
    """A report on a hand and on tissue of 457.24 N/m."""
    values = dict.fromkeys(HandLimit.scalars(), 1.0) | dict.fromkeys(HandLimit.columns(), np.ones(5))
    values |= {"hand": "firm", "k_t_limit": 900.0, "k_t_limit_std": 50.0, "k_t_response": 918.0, "k_t_simulated": 891.0}
    records = [HandLimit(**(values | about)), stiffness()]
    for record in records:
        object.__setattr__(record, "origin", Origin("x", "0" * 64, {f.name: "" for f in fields(record)}))
    catalogue = Catalogue(lambda kind: [record for record in records if isinstance(record, kind)])
    study = Study(None, "A study", davinci.ROBOT, True, Settings(), ())
    return Context(catalogue, study, collect(catalogue), Provenance("study", "1", {}, {}, {}, {}))


def section(**about):
    return stability.section(context(**about))


@pytest.mark.parametrize(
    ("about", "level", "words"),
    [
        ({}, "good", "**stable** against the measured tissue, 457"),
        ({"k_t_limit_std": 300.0}, "warn", "may oscillate against the measured tissue"),
        ({"k_t_limit_std": NAN}, "warn", "may oscillate"),
        ({"delay_margin": 0.0}, "warn", "may oscillate against the measured tissue"),
        ({"k_t_limit": 300.0}, "warn", "**not stable** against the measured tissue"),
        ({"filter_lag_std": NAN}, "info", "is not rated. To measure it, record more free motion"),
        ({"k_t_limit": NAN}, "info", "no limit of the tissue's stiffness was found."),
        ({"k_t_limit": NAN, "loop_delay": NAN}, "info", "controller does not hold this arm; see [@runs]."),
    ],
)
def test_a_hand_is_said_to_be_stable_or_not_by_the_headline_and_its_interval(about, level, words):
    [verdict] = [block for block in walk(section(**about)) if isinstance(block, Verdict)]
    assert verdict.level == level
    assert words in verdict.text


def test_one_table_states_all_limits_and_no_page_says_that_any_tissue_is_stable():
    blocks = list(walk(section()))
    [table] = [block for block in blocks if isinstance(block, Table)]
    assert [row[0] for row in table.rows[3:6]] == [
        "**Limit**: formula",
        "Linear response",
        "Simulation",
    ]
    assert len({row[-1] for row in table.rows[3:6]}) == 1
    [prose] = [block for block in blocks if isinstance(block, Prose)]
    assert "agree within 3.0 %" in prose.text
    assert "every" not in prose.text


@pytest.mark.parametrize(("std", "doubted"), [(10.0, False), (10.5, True), (NAN, False)])
def test_page_one_says_of_a_limit_whose_95_percent_interval_holds_0_that_it_may_be_none(std, doubted):
    [line] = opening.feedback(context(k_t_limit=20.0, k_t_limit_std=std))
    assert line.startswith("Haptic feedback, simulated: stable on tissue up to 20")
    assert line.endswith(" (cannot be told from none)") == doubted


@pytest.mark.parametrize(("delay", "shown"), [(0.09, True), (0.49, False)])
def test_a_delay_that_nobody_would_add_is_a_dash(delay, shown):
    [table] = [block for block in walk(section(best_delay=delay)) if isinstance(block, Table)]
    cells = {row[0]: row[1] for row in table.rows}
    dashes = [cells[name] == "–" for name in ("Added delay with the highest limit", "Limit with that delay")]
    assert dashes == [not shown, not shown]


def test_of_an_arm_that_does_not_follow_the_limits_of_the_hands_alone_are_shown():
    known = {name: value for name, value in vars(limits.without_arm("firm", FIRM)).items() if name != "hand"}
    blocks = list(walk(section(**known)))
    [table] = [block for block in blocks if isinstance(block, Table)]
    names = ["Mass of the hand", "Damping of the hand", "Stiffness of the hand", "Lyapunov function", "Worst switching"]
    assert [row[0] for row in table.rows] == names
    [figure] = [block for block in blocks if isinstance(block, Figure) and block.label == "stability-limits"]
    assert [panel.title for panel in figure.panels] == ["Without delay"]
