"""What is known of a robot before its logs: the design's records say what the mathematics says."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipeline.maths.mechanics.kinematics import tip
from pipeline.records import Control, Excitation, Links, Lyapunov, Pose, Workspace
from pipeline.robots import davinci, dvrk_psm
from pipeline.stages import design


@pytest.fixture(scope="module")
def made():
    return list(design.run(davinci.ROBOT))


def of(made, kind, **about):
    return [r for r in made if isinstance(r, kind) and all(getattr(r, k) == v for k, v in about.items())]


def test_the_chain_ends_where_the_tip_is(made):
    [zero] = of(made, Pose, pose="zero")
    last = list(zero.link).index("9L")
    assert_allclose([zero.x[last], zero.y[last], zero.z[last]], tip(davinci.ROBOT.chain, np.zeros(3)), atol=1e-12)
    [links] = of(made, Links)
    assert list(links.moved_by[2:5]) == [2, 2, 2]  # the parallelogram


def test_the_condition_of_the_jacobian_reaches_about_sixty_within_the_limits(made):
    [links], [workspace] = of(made, Links), of(made, Workspace)
    assert links.worst_condition == workspace.condition.max() == pytest.approx(62, abs=3)


def test_pd_settles_and_its_lyapunov_function_never_rises(made):
    for study in ("pd-to-zero", "pd-to-pose"):
        assert of(made, Lyapunov, controller=study)[0].V_rise == 0.0
        for run in of(made, Control, controller=study):
            assert abs(run.error_end) < 1e-5


def test_pid_is_worse_than_pd_for_twenty_seconds_and_better_in_the_end(made):
    for joint in ("hand_roll", "hand_pitch"):
        [pd], [pid] = (of(made, Control, controller=c, joint=joint) for c in ("pd-light", "pid-light"))
        assert abs(pid.error_10) > abs(pd.error_10)
        assert abs(pid.error_20) > abs(pd.error_20)
        assert abs(pid.error_end) < abs(pd.error_end)


@pytest.mark.parametrize(
    ("joint", "source", "objective"),
    [
        ("hand_roll", "table-6.1-corrected", -8.5973),
        ("hand_pitch", "table-6.1", -12.7527),
        ("instrument_slide", "table-6.1", -8.6718),
    ],
)
def test_the_printed_objectives_are_reproduced(made, joint, source, objective):
    [published] = of(made, Excitation, joint=joint, source=source)
    assert published.objective == pytest.approx(objective, abs=1e-3)


def test_what_is_found_keeps_the_limits_and_what_is_printed_does_not(made):
    for found in of(made, Excitation, source="found"):
        assert found.excess_q == found.excess_dq == found.excess_ddq == 0.0
    [slide] = of(made, Excitation, joint="instrument_slide", source="table-6.1")
    assert slide.excess_q == pytest.approx(0.033, abs=0.001)


def test_a_robot_without_geometry_or_published_excitation_has_nothing_to_design():
    assert list(design.run(dvrk_psm.ROBOT)) == []
