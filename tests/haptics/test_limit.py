"""Stage `haptic-limits`, the thesis's criteria, and the filter's lag in logs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.haptics.maths.bimodal import THESIS_HAND, Hand, switching_limit
from davinci_forces.haptics.maths.lmi import cqlf_exists
from davinci_forces.haptics.scenario import SLIDE, SLIDE_NOISE
from davinci_forces.records import Comparison, FilterNoise, HandLimit, HapticMotion, StabilityLimit, Stiffness
from davinci_forces.robots import davinci
from davinci_forces.stages.tissue import haptic_limits
from davinci_forces.study import HapticScenario

K = 457.24
SCENARIO = HapticScenario(hands=(("one", Hand(1.0, 10.0, 300.0)),), plan=((0.0, -0.01), (1.0, 0.01), (2.0, -0.01)))
NOISE = FilterNoise(
    **dict.fromkeys(FilterNoise.scalars(), 1.0)
    | dict.fromkeys(FilterNoise.columns(), np.zeros(0))
    | {"joint": "instrument_slide", "logs": ("a",), "delay": 0.1, "inertia": SLIDE.inertia, "viscous": SLIDE.viscous}
    | {f"r_{name}": value for name, value in SLIDE_NOISE._asdict().items()}
)
MEASURED = (
    ("direct", "instrument_slide", 0.0), ("ekf", "instrument_slide", 0.05), ("rts", "instrument_slide", 0.0),
    ("direct", "hand_roll", 0.0), ("ekf", "hand_roll", 0.2),
)  # fmt: skip


def stiffness(log="pushes", k=K, pushes=3) -> Stiffness:
    empty = np.zeros(0)
    columns = dict.fromkeys(Stiffness.columns(), empty)
    about = {"log": log, "source": "force sensor", "swings": 3, "stiffness": k, "stiffness_std": 1.0}
    about |= {"stiffness_std_model": 0.0, "stiffness_q1": k, "stiffness_q3": k, "pushes": pushes}
    return Stiffness(**dict.fromkeys(Stiffness.scalars(), 0.0) | about | columns)


def comparison(label, joint="instrument_slide", log="a", delay=0.0) -> Comparison:
    """A filter whose external effort is noise that comes `delay` [s] late."""
    numbers = dict.fromkeys(Comparison.scalars(), 1.0)
    about = {"log": log, "joint": joint, "filter": label, "role": "validation", "default": int(label == "ekf")}
    t, late = np.arange(6000) / 100.0, round(100.0 * delay)
    noise = np.random.default_rng(1).normal(size=6100)[100 - late : 6100 - late]
    return Comparison(**(numbers | about | {"t": t, "tau_ext": noise}))


def made(tissues, comparisons=()) -> list:
    return list(haptic_limits.run(tissues, comparisons, (), [NOISE], SCENARIO, davinci.ROBOT, q_tau=0.0))


def only(records, kind):
    [record] = [record for record in records if isinstance(record, kind)]
    return record


@pytest.fixture(scope="module")
def records():
    logs = [comparison(label, joint, delay=delay) for label, joint, delay in MEASURED]
    return made([stiffness()], [*logs, comparison("ekf", log="without-direct", delay=0.3)])


def test_the_lag_is_the_default_filter_s_in_logs_of_the_joint_that_slides(records):
    limit = only(records, HandLimit)
    assert_allclose(limit.filter_lag, 0.05, rtol=0.02)
    assert_allclose(limit.filter_share, 1.0, rtol=0.02)
    assert 0.0 < limit.filter_lag_std < 0.005
    assert 0.05 < limit.loop_delay < 0.15  # arm, link and hold besides


def test_the_border_of_the_map_is_where_the_matrix_inequality_loses_its_solution(records):
    exact = only(records, StabilityLimit)
    for k, border in zip(exact.k_h[::10].tolist(), exact.k_t_cqlf[::10].tolist(), strict=True):
        hand = THESIS_HAND._replace(k=k)
        assert [cqlf_exists(hand, share * border) for share in (0.99, 1.01)] == [True, False]
    assert (exact.k_t_switching > exact.k_t_cqlf).all()


def test_the_motion_grows_by_the_worst_switching_and_comes_to_rest_as_it_is(records):
    runs = {record.switching: record for record in records if isinstance(record, HapticMotion)}
    for name, grows in (("worst", True), ("at contact", False)):
        V, run = runs[name].V, runs[name]
        assert run.tissue_stiffness > switching_limit(THESIS_HAND)
        assert (V[-100:].max() > V[:100].max()) == grows


def test_nothing_is_made_where_no_tissue_was_measured():
    assert made([], [comparison("ekf")]) == []
    assert made([stiffness(pushes=0, k=float("nan")), stiffness(k=-3.0)]) == []
