"""Every estimator: parameters that were put in come out, with errors as large as it says, or it says why not."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from davinci_forces.errors import NotIdentifiable
from davinci_forces.estimators import ESTIMATORS, title_of
from davinci_forces.estimators.problem import Estimate, Estimator, Regression
from davinci_forces.maths.models.independent import regressor
from tests import arm

K, M = 400, 10  # samples of a period, periods averaged
SIGMA = 0.3  # of the effort, in one period
SEEDS = 200
TERMS, THETA = arm.joint("hand_roll").terms, arm.THETA["hand_roll"]
PHI = regressor(TERMS, *arm.excitation("hand_roll", 10.0 * np.arange(K) / K))
NAMES = tuple(term.name for term in TERMS)
EXACT = np.zeros((1, len(NAMES), len(NAMES)))  # covariance of the errors of the motion

# Of its standard errors: an estimator that draws parameters to a guess is biased, and says so.
BIASED = {"prior": 0.3}

ESTIMATOR = pytest.mark.parametrize(
    "estimate", [import_module(f"davinci_forces.estimators.{name}").estimate for name in ESTIMATORS], ids=ESTIMATORS
)


def problem(seed: int | None = None, sigma=SIGMA) -> Regression:
    """The averaged periods of a joint whose parameters are known; without a seed, free of noise.

    The motion is exact, and known to be.  No estimator may write into it.
    """
    tau, tau_var = PHI @ THETA, np.zeros(K)
    if seed is not None:
        random, sigma = np.random.default_rng(seed), np.broadcast_to(sigma, K)
        tau = tau + sigma / np.sqrt(M) * random.normal(size=K)
        tau_var = sigma**2 * random.chisquare(M - 1, size=K) / (M - 1)
    return frozen(Regression(PHI.copy(), tau, tau_var, np.full(K, M), (0,), NAMES, Phi_cov=EXACT))


def frozen(p: Regression) -> Regression:
    for column in (p.Phi, p.tau, p.tau_var, p.periods):
        column.setflags(write=False)
    return p


def rounding(Phi: np.ndarray) -> float:
    """How far rounding may put the parameters of scaled columns: 1e-16 a sample, times the condition number."""
    scaled = Phi / np.linalg.norm(Phi, axis=0)
    return len(Phi) * np.finfo(float).eps * float(np.linalg.cond(scaled))


def agree(one: np.ndarray, other: np.ndarray, Phi: np.ndarray = PHI) -> None:
    """Parameters that differ by rounding only, each measured by what it contributes to the effort."""
    size = np.linalg.norm(Phi, axis=0)
    assert np.linalg.norm((one - other) * size) <= rounding(Phi) * np.linalg.norm(Phi @ THETA)


def test_every_estimator_has_a_title_of_its_own():
    titles = {name: title_of(name) for name in ESTIMATORS}
    assert len({*titles, *titles.values()}) == 2 * len(ESTIMATORS)
    assert title_of("ridge") == "ridge"


@ESTIMATOR
@pytest.mark.parametrize("tau_var", [0.0, 0.1])
def test_without_noise_the_parameters_come_out_to_rounding(estimate: Estimator, tau_var: float):
    p = frozen(replace(problem(), tau_var=np.full(K, tau_var)))
    found = estimate(p)
    agree(found.theta, THETA)
    assert np.isfinite([found.theta, found.standard_errors.classical, found.theta_std]).all()


@ESTIMATOR
def test_columns_that_are_hard_to_tell_apart_cost_their_condition_number_and_not_its_square(estimate: Estimator):
    """As the normal equations would: two columns differ by a millionth."""
    p = problem()
    Phi = np.column_stack([p.Phi[:, :3], p.Phi[:, 0] + 1e-6 * p.Phi[:, 3]])
    agree(estimate(frozen(replace(p, Phi=Phi, tau=Phi @ THETA))).theta, THETA, Phi)


@ESTIMATOR
def test_errors_are_as_large_as_stated(estimate: Estimator):
    found = [estimate(problem(seed)) for seed in range(SEEDS)]
    for std in ("classical", "total"):
        is_calibrated(found, std, bias(estimate))


@ESTIMATOR
def test_errors_are_as_large_as_stated_where_noise_differs_over_the_period(estimate: Estimator):
    """By the deviations that allow for it: it is loud where gravity's column is large, and tells most."""
    size = np.abs(PHI[:, 1])
    loud = SIGMA * np.where(size > np.quantile(size, 0.7), 4.0, 1.0)
    is_calibrated([estimate(problem(seed, loud)) for seed in range(SEEDS)], "total", bias(estimate))


def bias(estimate: Estimator) -> float:
    return BIASED.get(estimate.__module__.rpartition(".")[2], 0.0)


def is_calibrated(found: list[Estimate], std: str, bias: float) -> None:
    """The standard error of n scores' mean is 1/sqrt(n), that of their deviation 1/sqrt(2 n); four of each are let."""
    scores = np.array([(e.theta - THETA) / getattr(e.standard_errors, std) for e in found])
    assert_allclose(scores.mean(axis=0), 0.0, atol=4 / np.sqrt(SEEDS) + bias, err_msg=std)
    assert_allclose(scores.std(axis=0), 1.0, atol=4 / np.sqrt(2 * SEEDS), err_msg=std)


@ESTIMATOR
@pytest.mark.parametrize("column", range(len(NAMES)), ids=NAMES)
def test_scaling_a_column_scales_its_parameter_and_nothing_else(estimate: Estimator, column: int):
    p, scale = problem(seed=1), np.ones(len(NAMES))
    scale[column] = 1e6
    plain, scaled = estimate(p), estimate(frozen(replace(p, Phi=p.Phi * scale)))
    agree(scaled.theta * scale, plain.theta)
    # Deviations lose what the square of the condition number loses, through (Phi' Phi)^-1.
    tolerance = rounding(PHI) * np.linalg.cond(PHI / np.linalg.norm(PHI, axis=0))
    assert_allclose(scaled.standard_errors.classical * scale, plain.standard_errors.classical, rtol=tolerance)
    assert_allclose(scaled.theta_std * scale, plain.theta_std, rtol=tolerance)


@ESTIMATOR
def test_the_order_of_the_logs_does_not_matter(estimate: Estimator):
    a, b = problem(seed=1), problem(seed=2, sigma=2 * SIGMA)
    agree(estimate(pooled(a, b)).theta, estimate(pooled(b, a)).theta)


@ESTIMATOR
def test_two_logs_tell_more_than_one(estimate: Estimator):
    a, b = problem(seed=1), problem(seed=2)
    assert (estimate(pooled(a, b)).standard_errors.classical < estimate(a).standard_errors.classical).all()


def pooled(a: Regression, b: Regression) -> Regression:
    columns = (np.concatenate([getattr(a, n), getattr(b, n)]) for n in ("Phi", "tau", "tau_var", "periods"))
    return frozen(Regression(*columns, (0, len(a.tau)), a.names, Phi_cov=np.concatenate([EXACT, EXACT])))


@ESTIMATOR
def test_a_sample_that_no_period_was_recorded_at_counts_for_nothing(estimate: Estimator):
    p, nothing = problem(seed=1), np.arange(K) % 7 == 3
    unseen = replace(p, periods=np.where(nothing, 0, M))
    wild = replace(unseen, tau=np.where(nothing, 1e3, p.tau))
    agree(estimate(frozen(wild)).theta, estimate(frozen(unseen)).theta)


@ESTIMATOR
def test_the_same_data_give_the_same_bits(estimate: Estimator):
    one, other = estimate(problem(seed=3)), estimate(problem(seed=3))
    assert_array_equal(one.theta, other.theta)
    for a, b in zip(one.standard_errors, other.standard_errors, strict=True):
        assert_array_equal(a, b)


@ESTIMATOR
@pytest.mark.parametrize(
    ("twin", "of"),
    [(PHI[:, 1], [1]), (PHI[:, 1] * (1 + 1e-12), [1]), (PHI[:, 0] - 2 * PHI[:, 2], [0, 2])],
    ids=["equal", "nearly equal", "a sum"],
)
def test_columns_that_the_motion_does_not_tell_apart_are_refused_by_name(estimate: Estimator, twin, of: list[int]):
    """Those that depend on each other, and no others."""
    p = problem(seed=1)
    with pytest.raises(NotIdentifiable) as refused:
        estimate(frozen(replace(p, Phi=np.column_stack([p.Phi, twin]), names=(*NAMES, "the twin"))))
    named = [name for name in (*NAMES, "the twin") if name in str(refused.value)]
    assert named == [*(NAMES[i] for i in of), "the twin"]


@ESTIMATOR
@pytest.mark.parametrize("column", range(len(NAMES)), ids=NAMES)
def test_a_column_that_nothing_excites_is_refused_by_its_name_alone(estimate: Estimator, column: int):
    p = problem(seed=1)
    with pytest.raises(NotIdentifiable) as refused:
        estimate(frozen(replace(p, Phi=p.Phi * (np.arange(len(NAMES)) != column))))
    assert [name for name in NAMES if name in str(refused.value)] == [NAMES[column]]


@ESTIMATOR
@pytest.mark.parametrize("samples", range(2, len(NAMES) + 1))
def test_fewer_samples_than_it_takes_are_refused_with_both_numbers(estimate: Estimator, samples: int):
    p, rows = problem(seed=1), np.linspace(10, K - 10, samples, dtype=int)
    few = Regression(p.Phi[rows], p.tau[rows], p.tau_var[rows], p.periods[rows], p.starts, p.names)
    with pytest.raises(NotIdentifiable, match=f"{samples} samples for {len(NAMES)} parameters"):
        estimate(frozen(few))


@ESTIMATOR
def test_an_effort_that_does_not_vary_is_refused(estimate: Estimator):
    with pytest.raises(NotIdentifiable, match="the effort is constant"):
        estimate(frozen(replace(problem(seed=1), tau=np.full(K, 0.3))))


@ESTIMATOR
@pytest.mark.parametrize("column", ["tau", "Phi"])
def test_what_is_not_a_number_is_refused_with_its_place(estimate: Estimator, column: str):
    p = problem(seed=1)
    broken = getattr(p, column).copy()
    broken[7] = np.nan
    with pytest.raises(NotIdentifiable, match=f"of sample 8 of {K} is not a number"):
        estimate(frozen(replace(p, **{column: broken})))


@ESTIMATOR
def test_a_constant_velocity_is_refused_because_it_does_not_excite_the_inertia(estimate: Estimator):
    """Also where rounding leaves something of an acceleration."""
    t = np.arange(K) / K
    for ddq in (0.0, 1e-15 * np.sin(t)):
        Phi = regressor(TERMS, 0.5 * t - 0.2, np.full(K, 0.5), ddq + 0 * t)
        with pytest.raises(NotIdentifiable, match="inertia"):
            estimate(frozen(replace(problem(seed=1), Phi=Phi)))


@ESTIMATOR
@pytest.mark.parametrize("exponent", [3, 6, 9])
def test_errors_of_rounding_grow_with_the_condition_number_up_to_a_billion(estimate: Estimator, exponent: int):
    random = np.random.default_rng(exponent)
    Q, _ = np.linalg.qr(random.normal(size=(K, len(NAMES))))
    V, _ = np.linalg.qr(random.normal(size=(len(NAMES), len(NAMES))))
    Phi = Q * np.geomspace(1.0, 10.0**-exponent, len(NAMES)) @ V
    found = estimate(frozen(replace(problem(), Phi=Phi, tau=Phi @ THETA))).theta
    agree(found, THETA, Phi)
