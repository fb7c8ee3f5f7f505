"""How fast parameters are found, beside statsmodels and a swarm in numpy."""

import time

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.estimators import estimator
from davinci_forces.estimators.problem import Regression
from davinci_forces.maths.estimation import swarm
from davinci_forces.maths.estimation.least_squares import triangle
from davinci_forces.robots.davinci import ROBOT
from tests.test_swarm import problem

ROWS, COLUMNS = 1_000_000, 5
AT_LEAST = 10.0  # times as fast as statsmodels
AS_A_SWARM = 15.0  # times as fast as pyswarms, at as many evaluations


def seconds(work) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


@pytest.fixture(scope="module")
def rows() -> Regression:
    random = np.random.default_rng(0)
    Phi = random.normal(size=(ROWS, COLUMNS))
    tau = Phi @ np.ones(COLUMNS) + random.normal(size=ROWS)
    var = 10 * random.chisquare(9, size=ROWS) / 9
    return Regression(Phi, tau, var, np.full(ROWS, 10), (0,), tuple("abcde"))


@pytest.mark.parametrize("name", ["lse", "wlse"])
def test_a_million_rows_take_a_tenth_of_the_time_of_statsmodels(rows, name, capsys):
    import statsmodels.api as sm

    def theirs():
        weights = rows.periods / rows.tau_var
        model = sm.OLS(rows.tau, rows.Phi) if name == "lse" else sm.WLS(rows.tau, rows.Phi, weights=weights)
        return model.fit().params

    find = estimator(name)
    assert_allclose(find(rows).theta, theirs(), atol=0.01)
    turns = [(seconds(lambda: find(rows)), seconds(theirs)) for _ in range(5)]
    ours, rival = (min(times) for times in zip(*turns, strict=True))  # the others were disturbed
    with capsys.disabled():
        print(f"\n{name} of {ROWS} rows: {ours:.3f} s, {rival / ours:.0f} times as fast as statsmodels", end="")
    assert rival / ours >= AT_LEAST


@pytest.mark.parametrize("name", [joint.name for joint in ROBOT.joints])
def test_a_swarm_takes_a_fifteenth_of_the_time_of_pyswarms(name, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # where the rival leaves its log
    reason = "pyswarms, the rival, is not installed: the swarm's time is compared with nothing"
    rival = pytest.importorskip("pyswarms.single", reason=reason)
    p = problem(name)
    R, box = triangle(p.Phi, p.tau, p.periods.astype(float)), p.known.box
    monkeypatch.setattr(swarm, "MOST", 1000)
    monkeypatch.setattr(swarm, "CHANGE", -1.0)  # so that it does not stop early
    manner = swarm.CONSTRICTED
    options = {"c1": manner.cognitive, "c2": manner.social, "w": manner.inertia[0]}
    bounds = (box.lower, box.upper)

    def ours():
        return swarm.swarm(R, box, np.random.default_rng(0), manner)

    def theirs():
        search = rival.GlobalBestPSO(swarm.PARTICLES, len(box.lower), options, bounds=bounds, bh_strategy="reflective")
        return search.optimize(lambda x: R.excess(box.lumping.theta(x)), iters=1000, verbose=False)

    assert len(ours().history) == 1000
    turns = [(seconds(ours), seconds(theirs)) for _ in range(3)]
    ratio = min(time for _, time in turns) / min(time for time, _ in turns)
    with capsys.disabled():
        print(f"\nswarm of the {name}: {ratio:.0f} times as fast as pyswarms", end="")
    assert ratio >= AS_A_SWARM
