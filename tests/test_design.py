"""What is known of a robot before its logs: the design's records say what the mathematics says."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces import robots
from davinci_forces.maths.mechanics.kinematics import tip
from davinci_forces.records import Control, Excitation, Links, Lyapunov, Pose, Workspace
from davinci_forces.records.catalogue import Catalogue, Provenance
from davinci_forces.report.context import Context
from davinci_forces.report.results import Results
from davinci_forces.report.sections.robot import section
from davinci_forces.robots import davinci, dvrk_psm, from_toml
from davinci_forces.robots.davinci import DRIVES
from davinci_forces.stages import design
from davinci_forces.study import Settings, Study
from tests.guide import make_logs


@pytest.fixture(scope="module", autouse=True)
def _one_start():
    """No test asks how good an excitation was found: one start of each search."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(design, "STARTS", 1)
        yield


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


def test_a_jacobian_that_is_singular_within_the_limits_has_no_condition_number_and_the_report_says_why(tmp_path):
    (tmp_path / "arm.urdf").write_text(make_logs.URDF)  # its elbow can be straight
    robot = robots.load("arm.urdf", tmp_path)
    made = list(design.geometry(robot, robot.chain))
    assert np.isnan(of(made, Links)[0].worst_condition)
    study, of_kind = Study(None, "arm", robot, True, Settings(), ()), Catalogue(lambda kind: of(made, kind))
    page = section(Context(of_kind, study, Results(), Provenance("arm", "1", {}, {}, {}, {})))
    assert "has no bound: the Jacobian is singular within the joints' limits" in page.blocks[0].text


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


def test_the_lyapunov_function_starts_at_the_energy_of_the_stretched_controller(made):
    """V = e' K_p e / 2 at rest.  (5.9)"""
    for study in davinci.ROBOT.control:
        e = np.subtract(study.target, study.start)
        [lyapunov] = of(made, Lyapunov, controller=study.name)
        assert pytest.approx(e @ (np.array(study.proportional) * e) / 2, rel=1e-12) == lyapunov.V_0


def test_an_error_between_two_steps_of_the_solver_is_that_of_the_motion():
    t = np.array([0.0, 1.0, 7.0, 12.0])
    run = design.control_record(davinci.ROBOT.control[0], "hand_roll", t, t**3, 3 * t**2, 0.0, 1500.0)
    assert run.error_10 == pytest.approx(500.0, rel=1e-12)


def test_overshoot_and_settling_are_those_of_the_response():
    """A second-order response overshoots by exp(-pi zeta / sqrt(1 - zeta^2)), and stays in the band once it settles."""
    zeta, w = 0.4, 3.0
    t = np.linspace(0, 12, 40_001)
    w_d = w * np.sqrt(1 - zeta**2)
    step = 1 - np.exp(-zeta * w * t) * (np.cos(w_d * t) + zeta / np.sqrt(1 - zeta**2) * np.sin(w_d * t))
    study = davinci.ROBOT.control[0]
    run = design.control_record(study, "a", t, 1.0 - 2.0 * step, np.zeros_like(t), 1.0, -1.0)
    assert run.overshoot == pytest.approx(np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2)), rel=1e-4)
    assert abs(step[t >= run.settling_time] - 1).max() <= 0.02
    assert abs(step[t < run.settling_time][-1] - 1) > 0.02


def test_what_a_study_is_too_short_to_show_is_left_open(made):
    [short] = of(made, Control, controller="pd-to-pose", joint="hand_roll")
    assert np.isnan([short.error_10, short.error_20]).all()
    [light] = of(made, Control, controller="pd-light", joint="hand_pitch")
    assert np.isfinite([light.error_10, light.error_20]).all()


def test_a_robot_of_any_number_of_joints_has_a_design():
    """A fourth joint on a robot with a chain, two joints of it only, and joints without limits."""
    joints = davinci.ROBOT.joints
    fourth = replace(joints[0], name="instrument_roll", published=())
    for some in ((*joints, fourth), joints[:2], tuple(replace(j, limits=from_toml.UNLIMITED) for j in joints)):
        robot = replace(davinci.ROBOT, joints=some, wrist=davinci.ROBOT.coordinates[len(some) :], control=())
        records = list(design.run(robot))
        assert of(records, Links)
        assert of(records, Pose, pose="zero")
        limited = all(np.isfinite(j.limits.q).all() for j in some)
        assert bool(of(records, Workspace)) == limited


def test_every_coordinate_of_the_da_vinci_has_a_name_and_a_drive():
    robot = davinci.ROBOT
    assert len(robot.coordinates) == robot.chain.n == len(DRIVES.gear_ratio) == len(set(robot.coordinates))
    assert list(DRIVES.gear_ratio[:3]) == [joint.gear_ratio for joint in robot.joints]


def test_a_robot_without_geometry_or_published_excitation_has_nothing_to_design():
    assert list(design.run(replace(dvrk_psm.ROBOT, chain=None))) == []


def test_a_robot_whose_masses_are_not_known_has_a_geometry_and_no_control_studies():
    made = list(design.run(dvrk_psm.ROBOT))
    [links] = of(made, Links)
    assert np.isnan(links.mass[list(links.link).index("end_link")])
    assert links.moved_by[list(links.link).index("back_link_corner")] == 0
    assert links.a[list(links.link).index("end_link")] == 0.516
    assert of(made, Workspace)
    assert not of(made, Control)


def test_a_chain_that_no_table_describes_has_links_without_parameters():
    chain = replace(davinci.ROBOT.chain, table=())
    [links] = of(design.run(replace(davinci.ROBOT, chain=chain, control=())), Links)
    assert np.isnan(links.alpha).all()
    assert links.mass[0] == 0.0
    assert links.mass[1] == 0.5


def test_an_arm_that_is_singular_somewhere_or_everywhere_has_a_workspace(tmp_path):
    """Two parallel axes never push the tip along them, so the condition of their Jacobian is infinite."""
    link = '<link name="{0}"/>'
    joint = (
        '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="0.4 0 0"/>'
        '<axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>'
    )
    parts = [*(link.format(name) for name in "abc"), joint.format("p", "a", "b"), joint.format("q", "b", "c")]
    (tmp_path / "planar.urdf").write_text(f'<robot name="planar">{"".join(parts)}</robot>')
    [workspace] = of(design.run(robots.load("planar.urdf", tmp_path)), Workspace)
    assert len(workspace.condition)
    assert workspace.condition.min() > 1e6


# What public recordings of such arms reach: rad, rad, m.
@pytest.mark.parametrize(("joint", "low", "high"), [(0, -0.80, 0.80), (1, -0.80, 0.80), (2, 0.092, 0.235)])
def test_the_research_kit_has_the_limits_of_its_own_arm_which_hold_its_recordings(joint, low, high):
    least, most = dvrk_psm.ROBOT.joints[joint].limits.q
    assert least < low < high < most
    assert least != davinci.ROBOT.joints[joint].limits.q[0]


def test_the_slide_of_the_research_kit_stays_off_its_stops():
    assert dvrk_psm.ROBOT.joint("instrument_slide").limits.q == (0.0, 0.24)
