"""Stage `haptic-limits`: the simulated loop of a study, with what the study found of joint, noise and tissue."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from typer.testing import CliRunner

from davinci_forces.cli import app
from davinci_forces.haptics import limits
from davinci_forces.haptics import loop as haptic
from davinci_forces.haptics import scenario as scenarios
from davinci_forces.haptics.limits import has_limits, loop_response, why_unstable
from davinci_forces.haptics.maths.bimodal import Hand, cqlf_limit, switching_limit
from davinci_forces.haptics.maths.delay import response_limit, sampled_limit
from davinci_forces.haptics.scenario import FIRM, SLIDE, SLIDE_NOISE
from davinci_forces.records import FilterNoise, Fit, HandLimit, HapticResponse, HapticRun
from davinci_forces.robots import davinci
from davinci_forces.stages.tissue import haptic_limits
from davinci_forces.study import HapticScenario
from tests.haptics.test_limit import stiffness

HAND = Hand(1.0, 10.0, 300.0)
PLAN = ((0.0, -0.01), (1.0, 0.01), (2.0, -0.01))
SCENARIO = HapticScenario(hands=(("one", HAND),), plan=PLAN, exact=True, filtered=False, damping=0.0, friction=0.0)
THETA = (0.2, 1.8, 3.0, 4.5)


def fit(theta=THETA, estimator="lse") -> Fit:
    joint = davinci.ROBOT.joint("instrument_slide")
    names = np.array([term.name for term in joint.terms], object)
    numbers = dict.fromkeys(Fit.scalars(), 1)
    columns = dict.fromkeys(Fit.columns(), np.zeros(4)) | dict.fromkeys(
        ("parameter", "phi", "unit", "combination"), names
    )
    about = {"structure": "independent", "cutoff": (17.0,), "effort_lag": (0.0,)}
    about |= {"group": joint.name, "model": "independent", "estimator": estimator, "logs": ("a",)}
    return Fit(
        **(numbers | columns | about | {"theta": np.array(theta), "theta_std": np.array([0.01, 0.02, 0.03, 0.04])})
    )


def noise(joint="instrument_slide") -> FilterNoise:
    numbers = dict.fromkeys(FilterNoise.scalars(), 1.0) | dict.fromkeys(FilterNoise.columns(), np.zeros(0))
    return FilterNoise(
        **(numbers | {"joint": joint, "logs": ("a",), "delay": 0.1, "r_q": 1e-6, "r_dq": 2e-3, "r_tau": 0.7})
    )


def made(tissues, fits=(), noises=(), scenario=SCENARIO) -> list:
    everything = haptic_limits.run(tissues, (), fits, noises, scenario, davinci.ROBOT, q_tau=0.0)
    return [record for record in everything if isinstance(record, HapticResponse | HandLimit | HapticRun)]


def test_an_arm_that_follows_no_hand_has_no_limits_and_it_is_said():
    """The thesis's controller, tuned to 2 kg, does not hold a tenth of it: its loop diverges before any tissue."""
    body = SLIDE._replace(inertia=0.2, static=(3.0, 3.0), stribeck_velocity=0.01)
    unstable = replace(SCENARIO, body=body, exact=False)
    *_, said, limit = haptic_limits.run([stiffness()], (), (), (), unstable, davinci.ROBOT, q_tau=0.0)
    assert "does not stabilise 0.2 kg at `tick` = 0.0005 s; it does at 0.000125 s, so" in said.text[0]
    assert "state [arm.body]" in said.text[0]
    assert (limit.hand, limit.k_t_cqlf, limit.k_t_switching) == ("one", cqlf_limit(HAND), switching_limit(HAND))
    assert np.isnan([limit.k_t_limit, limit.k_t_settles, limit.loop_delay, limit.delay_margin]).all()


def test_the_tick_that_is_named_for_an_unstable_arm_is_the_longest_that_has_limits():
    """Lower gains of the velocity loop do not help."""
    unstable = haptic.complete_scenario(replace(SCENARIO, body=SLIDE._replace(inertia=0.1), exact=False))
    ticks = [unstable.tick / n for n in (1, 2, 4, 8)]
    known = [has_limits(replace(unstable, tick=tick)) for tick in ticks]
    assert known == sorted(known) == [False, False, True, True]
    assert "it does at 0.000125 s, so state tick = 0.000125 under [arm]" in why_unstable(unstable)
    gains = unstable.law._replace(velocity_p=unstable.law.velocity_p / 8.0, velocity_i=unstable.law.velocity_i / 8.0)
    assert not has_limits(replace(unstable, law=gains))


def test_no_tick_is_named_that_does_not_help_or_that_a_file_may_not_state():
    lightest = haptic.complete_scenario(replace(SCENARIO, body=SLIDE._replace(inertia=0.002), exact=False))
    assert "nor at a tick down to 6.25e-05 s; check the gains of your drivers" in why_unstable(lightest)
    light = replace(lightest, body=SLIDE._replace(inertia=0.2), plan=((0.0, 0.0), (900.0, 0.01)))
    assert "at `tick` = 0.0005 s; check the gains" in why_unstable(light)


def test_a_file_with_the_lines_that_the_report_shows_has_the_limits_of_the_report(tmp_path, monkeypatch):
    """At every third frequency of the response, in which both agree all the same."""
    every_third = haptic.FREQUENCIES[::3]
    for module in (haptic, limits):
        monkeypatch.setattr(module, "FREQUENCIES", every_third)
    law = SCENARIO.law._replace(velocity_p=0.9 * SCENARIO.law.velocity_p)
    scenario = HapticScenario(hands=(("firm", FIRM),), plan=PLAN, law=law, tick=2e-4)
    precise = replace(noise(), r_q=1.4e-5, r_dq=1e-7, r_tau=0.2)
    response, limit, _ = made([stiffness()], [fit((0.2, 0.05, 15.0, 1.7))], [precise], scenario)
    file = tmp_path / "shown.toml"
    file.write_text(response.scenario)
    shown = haptic.complete_scenario(scenarios.read(file))
    assert (shown.tick, float(shown.law.velocity_p[0]), shown.stiffness) == (2e-4, 0.0144, stiffness().stiffness)
    of_template = replace(shown, noise=SLIDE_NOISE, q_tau=0.0)
    again, other = (response_limit(FIRM, *loop_response(x))[0] for x in (shown, of_template))
    assert_allclose(again, limit.k_t_response, rtol=1e-5)
    assert other > 1.5 * again


def test_an_arm_that_follows_by_the_help_of_its_friction_alone_is_refused(tmp_path):
    """A loose velocity loop: with Coulomb friction the arm follows a slow hand, without friction it does not."""
    file = tmp_path / "loose.toml"
    body = "inertia = 0.21\ngravity = -2.03\nviscous = 12.4\ncoulomb = [1.787, 1.787]"
    file.write_text(f"[arm.body]\n{body}\n[arm.control]\nvelocity_p = 0.0017\nvelocity_i = 0.42\n")
    scenario = haptic.complete_scenario(scenarios.read(file))
    assert haptic.is_followed(scenario)
    assert not has_limits(scenario)
    said = CliRunner().invoke(app, ["haptics", str(file)])
    assert said.exit_code == 1
    assert "does not stabilise 0.21 kg" in " ".join(said.output.split())


@pytest.fixture(scope="module")
def records():
    return made([stiffness(k=400.0), stiffness("other", 440.0), stiffness("third", 500.0)])


def test_the_tissue_is_the_stiffest_of_those_that_were_measured(records):
    response = records[0]
    assert isinstance(response, HapticResponse)
    assert response.tissue_stiffness == 500.0
    assert_allclose(response.rendered_stiffness, 500.0 * response.transparency)
    assert_allclose(response.transparency, 1.0, atol=1e-3)
    assert_allclose(response.felt_delay, 0.005, rtol=0.02)


def test_a_device_that_scales_motion_and_force_renders_a_stiffness_scaled_by_both():
    scaled = replace(SCENARIO, device=SCENARIO.device._replace(motion=0.5, force=3.0))
    response = made([stiffness(k=500.0)], scenario=scaled)[0]
    assert_allclose(response.rendered_stiffness, 0.5 * 3.0 * 500.0 * response.transparency)
    assert_allclose(response.transparency, 1.0, atol=1e-3)


def test_each_hand_has_its_run_and_its_limits(records):
    limit, run = records[1:]
    assert isinstance(run, HapticRun)
    assert (run.hand, limit.hand, limit.hand_mass, limit.hand_damping, limit.hand_stiffness) == ("one", "one", *HAND)
    assert len(run) == 200
    assert run.out_of_reach == 0
    assert_allclose(limit.k_t_settles, sampled_limit(HAND, 0.0, 100.0), rtol=0.03)
    assert_allclose(run.true_peak, run.true_force.max())
    assert limit.delay_margin > 0.0


def test_a_stated_stiffness_takes_the_place_of_the_measured_one():
    response, *_ = made([stiffness(k=400.0)], scenario=replace(SCENARIO, stiffness=123.0))
    assert response.tissue_stiffness == 123.0


def test_what_slides_is_the_joint_as_it_was_fitted():
    bodies, arm_from = haptic_limits.moving_bodies(davinci.ROBOT, [fit()], davinci.ROBOT.joint("instrument_slide"))
    body = bodies[0]
    assert arm_from == "instrument_slide"
    assert_allclose([body.inertia, body.viscous, *body.coulomb], [2.0, 3.0, 4.5, 4.5])
    assert_allclose(body.gravity, -0.2 * 9.81)
    errors = [np.array([x.inertia, x.viscous, x.coulomb[0]]) - [2.0, 3.0, 4.5] for x in bodies[1:]]
    assert_allclose(np.sum(errors, axis=0), [0.01 + 0.02, 0.03, 0.04])  # theta_1 and theta_2 make up the inertia


@pytest.mark.parametrize("fits", [[], [fit((-3.0, 1.0, 1.0, 1.0))]])
def test_without_a_fit_that_can_be_it_is_the_thesis_s(fits):
    for joint in (davinci.ROBOT.joint("instrument_slide"), None):
        assert haptic_limits.moving_bodies(davinci.ROBOT, fits, joint) == ([SLIDE], "the thesis")


def test_the_filter_s_noise_is_the_joint_s(monkeypatch):
    taken = []

    def take(*given):
        taken.append(given[2])
        raise NotImplementedError  # what is simulated with it is for other tests

    monkeypatch.setattr(haptic, "complete_scenario", take)
    for noises in ([noise("hand_roll"), noise()], [noise("hand_roll")]):
        with pytest.raises(NotImplementedError):
            made([stiffness()], noises=noises)
    assert taken == [(1e-6, 2e-3, 0.7), SLIDE_NOISE]


def test_nothing_is_made_where_no_tissue_was_measured():
    assert made([], [fit()], [noise()]) == []
    assert made([stiffness(pushes=0, k=float("nan")), stiffness(k=-3.0)]) == []
