"""The thesis's identification with matched friction, beside realistic friction that differs in nothing else."""

import pytest

import davinci_forces
from davinci_forces.robots.davinci import ROBOT
from davinci_forces.simulation.scenario.reading import load
from tests.arm import searched_coarsely
from tests.test_runs import call

PERIODS = 10


def printed_mse(joint) -> float:
    return next(column.mse for column in joint.printed if column.estimator == "lse")


def test_a_sample_has_the_variance_of_ten_periods_mean_ten_times():
    families = load("davinci-thesis").arm.families
    for family in families.values():
        for joint in ROBOT.joints:
            assert family.noise[joint.name].tau ** 2 == pytest.approx(PERIODS * printed_mse(joint), rel=1e-4)


def test_parameters_are_identified_from_matched_friction_and_realistic_differs_in_nothing_else():
    scenario = load("davinci-thesis")
    matched, realistic = (scenario.arm.families[name] for name in ("matched", "realistic"))
    assert matched.noise == realistic.noise
    for joint in ROBOT.joints:
        moving = [log for log in scenario.logs if joint.name in log.moves]
        assert {(log.role, log.family) for log in moving} == {
            ("identification", "matched"), ("validation", "realistic"), ("validation", "matched"),
            ("friction", "realistic"),
        }  # fmt: skip


def test_section_7_3_has_the_noise_of_table_7_1_a_sinusoid_and_triangles():
    scenario, thesis = load("davinci-filter"), load("davinci-thesis")
    log, (exact,) = scenario.logs[1], scenario.arm.families.values()
    assert (exact.noise["hand_pitch"].q, exact.noise["hand_pitch"].dq, exact.noise["hand_pitch"].tau) == (
        0.01,
        0.008,
        0,
    )
    assert [x.tolist() for x in exact.friction] == [x.tolist() for x in thesis.arm.families["matched"].friction]
    assert len(log.moves["hand_pitch"].b) == 1
    assert {push.shape for push in log.external["hand_pitch"]} == {"triangle"}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lab") / "raw" / "davinci-thesis"
    call("simulate", "davinci-thesis", folder)
    with searched_coarsely():
        call("model", folder)
    return folder


def value(study, kind, name, joint, **place) -> float:
    """A number of the record of a joint."""
    return davinci_forces.read(study, kind, joint=joint.name, **place)[name].iloc[0]


@pytest.mark.medium
def test_averaged_effort_has_the_printed_error(study):
    for joint in ROBOT.joints:
        noise = value(study, "Average", "sigma_tau", joint, log=f"matched-{joint.name.split('_')[1]}-excitation")
        assert noise**2 / PERIODS == pytest.approx(printed_mse(joint), rel=0.1)
        fits = davinci_forces.read(study, "Fit", group=joint.name, model="independent", estimator="lse")
        assert fits["mse"].iloc[0] == pytest.approx(
            printed_mse(joint),
            rel=4 * (2 / 500) ** 0.5,  # of the variance of 500 samples
        )


@pytest.mark.medium
def test_friction_over_velocity_is_drawn_for_both_frictions(study):
    for joint in ROBOT.joints:
        charts = davinci_forces.read(study, "FrictionMap", joint=joint.name, model="independent")
        assert {log.partition("-")[0] for log in charts["log"].unique()} == {"matched", "realistic"}


@pytest.mark.medium
def test_realistic_friction_adds_to_the_model_error(study):
    own = {"model": "independent", "estimator": "lse"}
    for joint in ROBOT.joints:
        logs = [f"{family}-{joint.name.split('_')[1]}-validation" for family in ("matched", "realistic")]
        exact, realistic = (value(study, "Prediction", "model_error", joint, log=log, **own) for log in logs)
        assert realistic > 1.5 * exact
