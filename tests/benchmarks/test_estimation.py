"""How fast parameters and their standard errors are found, beside statsmodels, a product of matrices, and a swarm."""

import time
from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.estimators import estimator, pso, wlse
from davinci_forces.estimators.problem import Regression
from davinci_forces.maths.estimation.least_squares import triangle
from davinci_forces.robots.davinci import ROBOT
from tests.test_swarm import problem

ROWS, COLUMNS = 1_000_000, 5
AT_LEAST = 10.0  # times as fast as statsmodels
OF_ONE_LOG, OF_MANY = 40.0, 26.0  # products Phi' Phi at most, of the processor's time, that standard errors take
AS_A_SWARM = 15.0  # times as fast as pyswarms, at as many evaluations


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


@pytest.fixture(scope="module")
def rows() -> Callable[..., Regression]:
    """What makes the same problem anew: what one instance has computed, another does not know."""
    random = np.random.default_rng(0)
    Phi = random.normal(size=(ROWS, COLUMNS))
    tau = Phi @ np.ones(COLUMNS) + random.normal(size=ROWS)
    var = 10 * random.chisquare(9, size=ROWS) / 9
    names, M = tuple("abcde"), np.full(ROWS, 10)
    return lambda logs=1: Regression(Phi, tau, var, M, tuple(range(0, ROWS, ROWS // logs)), names)


@pytest.mark.parametrize("name", ["lse", "wlse"])
def test_a_million_rows_take_a_tenth_of_the_time_of_statsmodels(rows, name, capsys):
    import statsmodels.api as sm

    find, p = estimator(name), rows()
    weights = p.periods / wlse.pool_variance(p.tau_var, p.periods)
    thetas: list[np.ndarray] = []
    rivals: list[np.ndarray] = []

    def ours():
        thetas.append(find(rows()).theta)

    def theirs():
        model = sm.OLS(p.tau, p.Phi) if name == "lse" else sm.WLS(p.tau, p.Phi, weights=weights)
        rivals.append(model.fit().params)

    ours()  # compiles, or reads what was compiled
    turns = [(seconds(ours), seconds(theirs)) for _ in range(5)]
    for theta in (*thetas, *rivals):
        assert_allclose(theta, rivals[0], rtol=1e-9)
    own, rival = (min(times) for times in zip(*turns, strict=True))  # the others were disturbed
    with capsys.disabled():
        print(f"\n{name} of {ROWS} rows: {own:.3f} s, {rival / own:.0f} times as fast as statsmodels", end="")
    assert rival / own >= AT_LEAST


@pytest.mark.parametrize("logs", [1, 100])
@pytest.mark.parametrize("name", ["lse", "wlse"])
def test_standard_errors_cost_a_few_dozen_products_of_the_columns(rows, name, logs, capsys):
    """The processor's time of parameters and standard errors together, of a problem that is made anew.

    The correlation of residuals takes twelve Fourier transforms of all samples, which alone cost 17 products of one log
    and 5 of a hundred.
    """
    find = estimator(name)
    find(rows(logs)).standard_errors  # noqa: B018  # compiles, or reads what was compiled
    Phi, times = rows().Phi, []
    for _ in range(5):
        p, start = rows(logs), time.process_time()
        errors = find(p).standard_errors
        middle = time.process_time()
        Phi.T @ Phi
        times.append((middle - start, time.process_time() - middle))
        # Uncorrelated noise of variance 1 on columns of variance 1: both kinds are 1 / sqrt(K).
        assert_allclose(errors.classical, ROWS**-0.5, rtol=0.02)
        assert_allclose(errors.total, ROWS**-0.5, rtol=0.02)
    own, product = (min(column) for column in zip(*times, strict=True))
    with capsys.disabled():
        print(f"\n{name} with standard errors, {logs} logs: {own:.3f} s, {own / product:.0f} products Phi' Phi", end="")
    assert own <= (OF_ONE_LOG if logs == 1 else OF_MANY) * product


@pytest.mark.parametrize("name", [joint.name for joint in ROBOT.joints])
def test_a_swarm_takes_a_fifteenth_of_the_time_of_pyswarms(name, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # where the rival leaves its log
    reason = "pyswarms, the rival, is not installed: the swarm's time is compared with nothing"
    rival = pytest.importorskip("pyswarms.single", reason=reason)
    p = problem(name)
    R, box = triangle(p.Phi, p.tau, p.periods.astype(float)), p.known.box
    monkeypatch.setattr(pso, "MAX_ITERATIONS", 1000)
    monkeypatch.setattr(pso, "CHANGE", -1.0)  # so that it does not stop early
    manner = pso.CONSTRICTED
    options = {"c1": manner.cognitive, "c2": manner.social, "w": manner.inertia[0]}
    bounds = (box.lower, box.upper)

    least: list[float] = []
    theirs_least: list[float] = []

    def ours():
        found = pso.swarm(R, box, np.random.default_rng(0), manner)
        assert len(found.history) == 1000
        least.append(found.history[-1])

    def theirs():
        search = rival.GlobalBestPSO(pso.PARTICLES, len(box.lower), options, bounds=bounds, bh_strategy="reflective")
        cost, _ = search.optimize(lambda x: R.excess(box.lumping.theta(x)), iters=1000, verbose=False)
        theirs_least.append(cost + R.min_squares)

    ours()  # compiles, or reads what was compiled
    turns = [(seconds(ours), seconds(theirs)) for _ in range(3)]
    assert max(least) <= 1.001 * min(theirs_least)  # as good a fit
    ratio = min(time for _, time in turns) / min(time for time, _ in turns)
    with capsys.disabled():
        print(f"\nswarm of the {name}: {ratio:.0f} times as fast as pyswarms", end="")
    assert ratio >= AS_A_SWARM
