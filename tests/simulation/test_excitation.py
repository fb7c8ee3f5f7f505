"""Fourier trajectories: their motion, their exact ranges, what they tell about a joint, and their design."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from davinci_forces.maths.excitation.fourier import (
    Fourier,
    condition,
    determinant,
    instants,
    motion,
    observation,
    qr_factor,
    ranges,
)
from davinci_forces.maths.excitation.joint import ExcitationProblem, design, impossible, shrink_to_limits
from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.models.terms import TERMS, bias, inertia, stiffness
from davinci_forces.robots.davinci import ROBOT

TABLE_6_1 = {  # with b1 of hand roll corrected; f as printed, and for hand roll as that correction gives it
    "hand_roll": ((-0.1848, 0.0260, -0.2783, 0.0609, -0.4261), 10.0, -8.5973),
    "hand_pitch": ((-0.1912, 0.2861, -0.0639, 0.1741, 0.3701), 10.0, -12.7527),
    "instrument_slide": ((-0.0164, 0.0001, 0.0002, -0.1632, -0.1350), 5.0, -8.6718),
}
BEST = {"hand_roll": -8.59596, "hand_pitch": -12.75064, "instrument_slide": -8.75599}  # there is, to 1e-6
HAND = ((-0.6, 0.6), (-1.2, 1.2), (-1.2, 1.2))

coefficient = st.floats(-2, 2).filter(lambda c: c == 0 or abs(c) > 1e-6)
pairs = st.lists(st.tuples(coefficient, coefficient), min_size=1, max_size=6)
series_of = st.builds(
    lambda a0, ab, period: Fourier(a0, tuple(a for a, _ in ab), tuple(b for _, b in ab), period),
    st.floats(-1, 1), pairs, st.floats(0.5, 20),
)  # fmt: skip


def problem(name: str, criterion: str = "determinant") -> ExcitationProblem:
    joint = ROBOT.joint(name)
    limits = (joint.limits.q, joint.limits.dq, joint.limits.ddq)
    return ExcitationProblem(joint.terms, limits, TABLE_6_1[name][1], joint.harmonics, criterion)


@given(series_of)
def test_velocity_and_acceleration_are_the_derivatives_of_position(series):
    t, h = np.linspace(0, series.period, 50), 1e-6 * series.period
    _, dq, ddq = motion(series, t)
    ahead, behind = motion(series, t + h), motion(series, t - h)
    w = 2 * np.pi * len(series.a) / series.period
    size = np.abs(series.x[1:]).sum() + 1e-12
    # central differences: truncation (w h)^2 / 6, rounding eps |q| / h
    rounding = 1e-15 * (abs(series.a0) + size / w * len(series.a)) / h
    assert np.allclose((ahead[0] - behind[0]) / (2 * h), dq, rtol=0, atol=size * (w * h) ** 2 + 10 * rounding)
    assert np.allclose((ahead[1] - behind[1]) / (2 * h), ddq, rtol=0, atol=size * w * (w * h) ** 2 + 1e-14 * size / h)


@given(series_of)
def test_ranges_are_reached_and_never_left(series):
    samples = 4000
    dense = motion(series, instants(series.period, samples))
    step = 2 * np.pi * len(series.a) / samples
    for values, (low, high) in zip(dense, ranges(series), strict=True):
        size = np.abs(values - values.mean()).sum() / samples * 20 + 1e-9
        assert low <= values.min() + 1e-9 * size + 1e-12
        assert high >= values.max() - 1e-9 * size - 1e-12
        assert high - values.max() <= size * step**2  # between two samples a harmonic rises by (k w dt)^2 / 8
        assert values.min() - low <= size * step**2


def test_a_vector_of_coefficients_gives_the_series_back():
    series = Fourier(0.1, (1.0, 2.0), (3.0, 4.0), 7.0)
    assert series.x.tolist() == [0.1, 1.0, 3.0, 2.0, 4.0]
    assert Fourier.from_coefficients(series.x, 7.0) == series


@pytest.mark.parametrize("name", TABLE_6_1)
def test_table_6_1_has_its_printed_objective(name):
    x, period, printed = TABLE_6_1[name]
    F = observation(ROBOT.joint(name).terms, Fourier.from_coefficients(np.array(x), period))
    assert determinant(F) == pytest.approx(printed, abs=1e-3)
    assert determinant(F) == pytest.approx(-np.log10(np.linalg.det(F.T @ F)), abs=1e-9)
    assert 10 ** condition(F) == pytest.approx(np.linalg.cond(F), rel=1e-9)


@pytest.mark.parametrize("criterion", [determinant, condition])
def test_columns_that_depend_on_each_other_are_worth_nothing(criterion):
    once = np.arange(1.0, 10.0)
    assert criterion(np.column_stack([once, 2 * once])) == np.inf


@pytest.mark.parametrize("samples", [4, 2000, 2001, 2003, 6000, 1_000_001])
def test_the_triangle_of_many_samples_is_that_of_all_at_once(samples):
    F = np.random.default_rng(0).normal(size=(2, samples, 4)) * (1.0, 1e-3, 1e5, 1.0)
    R = qr_factor(F)
    assert R.shape == (2, 4, 4)
    scale = np.linalg.norm(F, axis=1)
    expected = np.swapaxes(F, 1, 2) @ F / (scale[:, None] * scale[:, :, None])
    found = np.swapaxes(R, 1, 2) @ R / (scale[:, None] * scale[:, :, None])
    assert found == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("criterion", [determinant, condition])
def test_fewer_samples_than_columns_are_worth_nothing(criterion):
    assert criterion(np.random.default_rng(0).normal(size=(3, 4))) == np.inf


@pytest.mark.parametrize("criterion", [determinant, condition])
def test_the_criterion_of_many_regressors_is_that_of_each(criterion):
    F = np.random.default_rng(0).normal(size=(3, 40, 4))
    F[1, :, 0] = F[1, :, 3]
    assert criterion(F).tolist() == pytest.approx([float(criterion(each)) for each in F])


def test_the_regressor_of_many_motions_is_the_columns_of_the_terms():
    q, dq, ddq = np.random.default_rng(0).normal(size=(3, 2, 7))
    Phi = regressor(list(TERMS.values()), q, dq, ddq)
    expected = [term.a * ddq + bias(term.coefficients, q, dq, 0.0)[0] for term in TERMS.values()]
    assert Phi == pytest.approx(np.stack(expected, axis=-1), rel=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 5))
@pytest.mark.parametrize("name", TABLE_6_1)
def test_any_seed_designs_the_best_trajectory_there_is(name, seed):
    asked = problem(name)
    assert determinant(observation(asked.terms, design(asked, 8, seed)[0])) <= BEST[name] + 1e-5


@pytest.mark.parametrize("name", TABLE_6_1)
def test_a_designed_trajectory_is_the_best_there_is_and_keeps_its_limits_at_every_instant(name):
    asked = problem(name)
    series, optima = design(asked, 24, 0)
    assert determinant(observation(asked.terms, series)) <= BEST[name] + 1e-5
    assert determinant(observation(asked.terms, series)) == pytest.approx(optima.min(), abs=1e-6)
    for values, (low, high) in zip(motion(series, instants(series.period, 100_000)), asked.limits, strict=True):
        assert low <= values.min()
        assert values.max() <= high


def test_a_design_for_the_condition_number_is_better_at_it_than_one_for_the_determinant():
    terms = problem("hand_roll").terms
    volume, shape = (design(problem("hand_roll", c), 4, 0)[0] for c in ("determinant", "condition"))
    assert np.linalg.cond(observation(terms, shape)) < np.linalg.cond(observation(terms, volume))


def test_a_design_for_the_condition_number_need_not_touch_the_limits():
    """With limits eight times as wide, the best condition of the roll is where gravity still looks like a sine."""
    asked = replace(problem("hand_roll", "condition"), limits=tuple((8 * low, 8 * high) for low, high in HAND))
    series = design(asked, 8, 0)[0]
    used = max(
        value / limit
        for pair, own in zip(ranges(series), asked.limits, strict=True)
        for value, limit in zip(pair, own, strict=True)
    )
    assert used < 0.9
    assert condition(observation(asked.terms, series)) < 0.95


def test_the_same_seed_designs_the_same_trajectory():
    asked = problem("instrument_slide")
    assert design(asked, 2, 3)[0] == design(asked, 2, 3)[0]


@given(series_of)
def test_a_shrunk_trajectory_keeps_every_limit(series):
    asked = ExcitationProblem((inertia,), ((-0.3, 0.5), (-1.0, 0.2), (-np.inf, 2.0)), series.period, len(series.a))
    for (low, high), (lowest, highest) in zip(asked.limits, ranges(shrink_to_limits(asked, series)), strict=True):
        assert low <= lowest
        assert highest <= high


@pytest.mark.parametrize(
    ("limits", "says"),
    [
        (((-1, 1), (0.1, 0.5), (-1, 1)), "velocity"),
        (((-1, 1), (-1, 1), (-2, -1)), "acceleration"),
        (((1, 1), (-1, 1), (-1, 1)), "no position"),
        (((-1, np.inf), (-1, 1), (-1, 1)), "limited on both sides"),
    ],
)
def test_limits_that_no_periodic_motion_keeps_are_refused_with_the_reason(limits, says):
    assert says in impossible(limits)
    with pytest.raises(ValueError, match=says):
        design(ExcitationProblem((inertia,), limits, 10.0, 2), 1, 0)


def test_terms_that_no_trajectory_tells_apart_are_named():
    # with one harmonic about a fixed centre of zero, the acceleration is -w^2 times the position
    with pytest.raises(ValueError, match="inertia, stiffness, stiffness"):
        design(ExcitationProblem((inertia, stiffness, stiffness), ((-1, 1), (-1, 1), (-1, 1)), 10.0, 1), 1, 0)
