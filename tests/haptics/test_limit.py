"""Stage `haptic-limits`, and what the report says of it: the thesis's hand beside measured tissue and a lag."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.haptics.maths import bimodal
from davinci_forces.haptics.maths.bimodal import THESIS_HAND, cqlf_limit, switching_limit
from davinci_forces.haptics.maths.delay import delay_limit, sampled_limit
from davinci_forces.haptics.maths.lmi import cqlf_exists
from davinci_forces.haptics.maths.motion import leaving_limit
from davinci_forces.records import (
    Comparison,
    DelayLimit,
    HapticMotion,
    StabilityLimit,
    StabilityMap,
    Stiffness,
    TissueLimit,
)
from davinci_forces.robots import davinci
from davinci_forces.stages.tissue import haptic_limits

K = 457.24


def stiffness(log="pushes", k=K, pushes=3) -> Stiffness:
    empty = np.zeros(0)
    columns = dict.fromkeys(Stiffness.columns(), empty)
    about = {"log": log, "source": "force sensor", "swings": 3, "stiffness": k, "stiffness_std": 1.0}
    return Stiffness(**about, stiffness_std_model=0.0, stiffness_q1=k, stiffness_q3=k, pushes=pushes, **columns)


def comparison(joint, delay, default=1) -> Comparison:
    numbers = dict.fromkeys(Comparison.scalars(), 1.0)
    about = {"log": "a", "joint": joint, "filter": "ekf", "role": "validation", "default": default}
    return Comparison(**(numbers | about | {"push_delay": delay, "t": np.zeros(1), "tau_ext": np.zeros(1)}))


def made(tissues, comparisons=()) -> list:
    return list(haptic_limits.run(tissues, comparisons, davinci.ROBOT))


def only(records, kind):
    [record] = [record for record in records if isinstance(record, kind)]
    return record


@pytest.fixture(scope="module")
def records():
    slow = comparison("instrument_slide", 0.09), comparison("hand_roll", 0.2), comparison("instrument_slide", 0.5, 0)
    return made([stiffness()], [comparison("instrument_slide", 0.05), *slow])


def test_the_map_is_cut_by_the_exact_border(records):
    cells, exact = only(records, StabilityMap), only(records, StabilityLimit)
    assert len(cells) == 900
    border = np.array([cqlf_limit(THESIS_HAND._replace(k=k)) for k in cells.k_h.tolist()])
    assert np.array_equal(cells.has_cqlf == 1, cells.tissue_stiffness < border)
    assert 100 < cells.has_cqlf.sum() < 800
    assert (exact.k_t_switching > exact.k_t_cqlf).all()


def test_what_is_shipped_of_the_thesis_s_hand_is_what_is_found_of_it():
    for k, proved in zip(bimodal.K_H.tolist(), bimodal.CQLF_COUNTS, strict=True):
        assert cqlf_exists(THESIS_HAND._replace(k=k), bimodal.K_T).tolist() == [
            i < proved for i in range(len(bimodal.K_T))
        ]
    held = [sampled_limit(THESIS_HAND, delay, bimodal.LINK_RATE) for delay in bimodal.DELAYS.tolist()]
    assert_allclose(bimodal.SAMPLED_LIMITS, held, rtol=1e-9)
    simulated = bimodal.DELAYS[bimodal.SIMULATED_DELAYS].tolist()
    leaving = [leaving_limit(THESIS_HAND, delay, delay_limit(THESIS_HAND, delay)) for delay in simulated]
    assert_allclose(bimodal.LEAVING_LIMITS, leaving, rtol=1e-9)


def test_the_delay_s_limits_are_those_of_the_thesis_s_hand(records):
    late = only(records, DelayLimit)
    i = 20
    assert_allclose(late.k_t_delay[i], delay_limit(THESIS_HAND, late.delay[i]))
    assert_allclose(late.k_t_held[i], sampled_limit(THESIS_HAND, late.delay[i], 100.0))
    short = late.delay < 0.1  # beyond, the limit rises again with the delay
    assert (late.k_t_held[short] < late.k_t_delay[short]).all()
    simulated = np.isfinite(late.k_t_leaving)
    assert simulated.sum() >= 3
    assert (late.k_t_leaving[simulated] > 1.9 * late.k_t_delay[simulated]).all()


def test_the_lag_is_the_default_filter_s_largest_on_the_joint_that_slides(records):
    tissue = only(records, TissueLimit)
    assert (tissue.lag_of, tissue.force_lag) == ("instrument_slide", 0.09)
    assert_allclose(tissue.k_t_lag, sampled_limit(THESIS_HAND, 0.09, 100.0))
    damped = THESIS_HAND._replace(b=tissue.damping_needed)
    assert_allclose(sampled_limit(damped, 0.09, 100.0), K, rtol=0.01)
    assert_allclose(cqlf_limit(THESIS_HAND._replace(k=tissue.k_h_needed)), K)


def test_the_motion_grows_by_the_worst_switching_and_comes_to_rest_as_it_is(records):
    runs = {record.switching: record for record in records if isinstance(record, HapticMotion)}
    for name, grows in (("worst", True), ("at contact", False)):
        V, run = runs[name].V, runs[name]
        assert run.tissue_stiffness > switching_limit(THESIS_HAND)
        assert (V[-100:].max() > V[:100].max()) == grows


def test_without_a_filter_that_was_compared_no_lag_is_stated():
    tissue = only(made([stiffness()]), TissueLimit)
    assert tissue.lag_of == ""
    assert np.isnan([tissue.force_lag, tissue.k_t_lag, tissue.damping_needed]).all()
    assert tissue.k_h_needed > 0.0


def test_nothing_is_made_where_no_tissue_was_measured():
    assert made([], [comparison("hand_roll", 0.1)]) == []
    assert made([stiffness(pushes=0, k=float("nan")), stiffness(k=-3.0)]) == []
