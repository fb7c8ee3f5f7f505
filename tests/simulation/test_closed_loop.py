"""The whole arm in closed loop: what its recordings must say about the arm that made them."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from davinci_forces.maths.mechanics import kinematics
from davinci_forces.maths.mechanics.rigid_body import gravity
from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.simulation.actuators import Regulator
from davinci_forces.maths.simulation.closed_loop import JointConstraints, Timing, arm, simulate
from davinci_forces.maths.simulation.surroundings import UP, Path, Surroundings, pulse, triangle
from davinci_forces.simulation.motion import SimulatedRun, simulate_log, theta
from davinci_forces.simulation.scenario import BadScenario, Scenario, SimulatedLog
from davinci_forces.simulation.scenario.reading import load
from davinci_forces.simulation.study_folder import contact_times
from tests.conftest import TWO_FRICTIONS

G = 9.81
SLIDE = "instrument_slide"


@cache
def scenario() -> Scenario:
    return load(TWO_FRICTIONS)


def log(name: str, **changes) -> SimulatedLog:
    return replace(next(entry for entry in scenario().logs if entry.name == name), **changes)


def run(entry: SimulatedLog) -> SimulatedRun:
    return simulate_log(scenario(), entry)


def identified(entry: SimulatedLog, joint: str) -> tuple[np.ndarray, np.ndarray]:
    """Least squares on the true efforts, with position as its few harmonics; and the parameters put in."""
    motion, period = run(entry).motions[joint], entry.moves[joint].period
    samples = round(period * scenario().rate)
    q, tau = motion.q[-samples:], motion.tau[-samples:]
    t = np.arange(samples) / scenario().rate
    w = 2 * np.pi / period * np.arange(1, 3)
    cos, sin = np.cos(np.outer(t, w)), np.sin(np.outer(t, w))
    x = np.linalg.lstsq(np.column_stack([np.ones(samples), cos, sin]), q, rcond=None)[0]
    a, b = x[1:3], x[3:5]
    q, dq, ddq = x[0] + cos @ a + sin @ b, -sin @ (w * a) + cos @ (w * b), -cos @ (w**2 * a) - sin @ (w**2 * b)
    F = regressor(scenario().robot.joint(joint).terms, q, dq, ddq)
    return np.linalg.lstsq(F, tau, rcond=None)[0], theta(scenario(), "matched")[joint]


@pytest.mark.parametrize(("name", "joint"), [("roll", "hand_roll"), ("pitch", "hand_pitch"), ("slide", SLIDE)])
def test_recordings_with_matched_friction_have_the_parameters_that_were_put_in(name, joint):
    entry = log(f"matched-{name}-excitation")
    period = entry.moves[joint].period
    found, true = identified(replace(entry, duration=2 * period, lead=0.0), joint)
    # without noise what is left is the time that a joint takes to turn round where friction changes sign, some 10 ms
    # of each quarter of a period: a few per cent of the friction, and of the inertia that is excited beside it
    scale = np.maximum(np.abs(true), 0.2 * np.abs(true).max())
    assert np.abs(found - true).max() < 0.06 * scale.max()


def test_the_slides_parameters_are_its_links_masses_and_its_rotor():
    put_in = theta(scenario(), "matched")[SLIDE]
    assert put_in == pytest.approx([0.079 + 0.079 + 0.04 + 0.01, 1340.0**2 * 1e-6, 3.2723, 3.9840], rel=1e-9)


def test_friction_that_no_joint_model_has_leaves_no_parameters_to_be_true():
    assert theta(scenario(), "realistic") == {}


def test_the_same_scenario_gives_the_same_motion():
    entry = log("realistic-tip-contact", duration=1.0, lead=0.0, tip=())
    for one, two in zip(
        vars(run(entry).motions[SLIDE]).values(), vars(run(entry).motions[SLIDE]).values(), strict=True
    ):
        assert np.array_equal(one, two)


def test_slow_contact_with_tissue_is_a_spring_from_the_surface_on():
    approach = Path(((0.0, 0.03), (4.0, 0.05)), ease=False)
    entry = log("matched-tissue-approach", duration=4.0, moves={SLIDE: approach})
    found = run(entry)
    motion = found.motions[SLIDE]
    depth = motion.q - entry.tissue.surface
    speed = 0.02 / 4.0
    assert contact_times(found)[0][0] == pytest.approx(2.0, abs=0.05)  # the loop follows 1 / 30 s late
    pressed = depth > 1e-4
    expected = 457.24 * depth + 5.0 * speed
    # the middle of a tick is where the force is taken; friction's grip makes the speed jump about a little
    assert motion.tau_ext[pressed] == pytest.approx(expected[pressed], abs=0.02)
    assert found.force[pressed, 2] == pytest.approx(-motion.tau_ext[pressed], rel=1e-9)
    assert not motion.tau_ext[depth < -1e-4].any()


def test_a_hung_mass_loads_the_vertical_slide_by_minus_its_weight():
    entry = log("matched-slide-weight", duration=6.0, lead=6.0)
    motion = run(entry).motions[SLIDE]
    assert motion.tau_ext.mean() == pytest.approx(-0.097 * G, abs=0.097 * 0.05)
    free = run(replace(entry, mass=0.0)).motions[SLIDE]
    assert (motion.tau - free.tau).mean() == pytest.approx(-0.097 * G, rel=0.02)


def test_a_force_of_the_tip_loads_the_joints_through_the_jacobian():
    entry = log("matched-tip-contact", duration=8.0, lead=0.0)
    entry = replace(entry, tip=entry.tip[:1])
    found = run(entry)
    q = np.column_stack([found.motions[name].q for name in found.motions])
    loads = np.column_stack([found.motions[name].tau_ext for name in found.motions])
    J, _ = kinematics.jacobian(scenario().robot.chain, q)
    # J is taken half a tick later, by when the joints have moved 0.25 ms at 0.2 rad/s
    assert loads == pytest.approx(np.einsum("kci,kc->ki", J, found.force), abs=12 * 1e-3)
    assert found.force[650, 1] == pytest.approx(12.0, rel=1e-6)


def test_no_joint_passes_its_stop():
    far = Path(((0.0, 0.1), (1.0, 0.2), (2.0, 0.0)), ease=False)
    motion = run(log("realistic-slide-friction", duration=3.0, moves={SLIDE: far})).motions[SLIDE]
    stop = scenario().joints[SLIDE].stops[1]
    assert motion.q.max() == stop
    assert (motion.dq[motion.q == stop] <= 0).all()
    assert motion.q[-1] < stop


def test_gains_that_the_ticks_are_too_slow_for_are_refused():
    what = scenario().arm
    wild = what.control._replace(velocity_p=1e9 * what.control.velocity_p)
    limits = what.motors._replace(current_limit=np.full(3, 1e300), voltage_limit=np.full(3, 1e300))
    nowhere = {name: replace(joint, stops=(-np.inf, np.inf)) for name, joint in scenario().joints.items()}
    unstable = replace(scenario(), arm=replace(what, control=wild, motors=limits), joints=nowhere)
    with pytest.raises(BadScenario, match="log matched-roll-contact: the control loop is unstable"):
        simulate_log(unstable, log("matched-roll-contact", duration=5.0, lead=0.0, external={}))


def test_slow_motion_shows_friction_with_hysteresis_and_asymmetry():
    motion = run(log("realistic-slide-friction", duration=20.0)).motions[SLIDE]
    weight = -0.208 * G
    up, down = motion.tau[500:900].mean() - weight, motion.tau[1500:1900].mean() - weight
    friction = scenario().arm.families["realistic"].friction
    speed = 0.005
    stribeck = np.exp(-((speed / 0.01) ** 2))
    expected = [g + (s - g) * stribeck + 3.2723 * speed for g, s in ((4.3, 5.4), (3.7, 4.7))]
    assert friction.coulomb_up[2] == 4.3
    assert [up, -down] == pytest.approx(expected, rel=0.02)


def frictionless() -> tuple[Any, Any, Any]:
    """The arm without friction, what holds its joints, and motors without encoder steps."""
    what, robot = scenario().arm, scenario().robot
    n = 3
    none = what.families["matched"].friction._replace(**{f"coulomb_{d}": np.zeros(n) for d in ("up", "down")})
    none = none._replace(static_up=np.zeros(n), static_down=np.zeros(n))
    body = JointConstraints(none, np.full(n, -1.0), np.full(n, 1.0))
    plant = arm(robot.chain, robot.bodies, what.motors.gear_ratio**2 * what.rotors)
    return plant, body, what.motors._replace(encoder_step=np.zeros(n), current_limit=np.full(n, 100.0))


def untouched(ticks: int) -> Surroundings:
    """Nothing that acts on the arm."""
    return Surroundings(np.zeros((ticks, 3)), np.zeros((ticks, 3)), 0.0, 0.0, 0.0, np.zeros(3), UP.copy(), False)


def test_the_damping_of_a_controller_is_its_gain_times_the_change_of_position_over_its_period():
    plant, body, motors = frictionless()
    law = Regulator(np.zeros(3), np.array([50.0, 40.0, 30.0]), np.zeros(3), 0.0)
    fallen = simulate(plant, body, motors, law, Timing(5e-4, 2), np.zeros((60, 3)), untouched(120), np.full(3, 0.1))
    assert (np.ptp(fallen.q, axis=0) > 1e-6).all()
    assert fallen.tau[1:] == pytest.approx(-law.derivative * np.diff(fallen.q, axis=0) / 1e-3, rel=1e-6, abs=1e-9)


@pytest.mark.slow
def test_pd_with_gravity_compensation_at_a_controllers_rate_comes_to_rest_at_its_reference():
    plant, body, motors = frictionless()
    goal = np.array([-np.pi / 8, np.pi / 8, 0.1])
    law = Regulator(np.full(3, 500.0), np.array([50.0, 50.0, 40.0]), np.zeros(3), 1.0)
    ticks, K = 2, 6000
    reference = np.tile(goal, (K, 1))
    found = simulate(plant, body, motors, law, Timing(5e-4, ticks), reference, untouched(K * ticks), np.zeros(3))
    assert found.q[-1] == pytest.approx(goal, abs=1e-4)
    assert found.tau[-1] == pytest.approx(
        gravity(scenario().robot.chain, scenario().robot.bodies, found.q[-1]), abs=1e-2
    )


def test_a_triangle_rises_to_its_peak_midway_and_a_pulse_is_constant_from_its_start_to_before_its_end():
    t = np.array([0.9, 1.0, 1.5, 2.0, 2.5, 3.0, 3.1])
    np.testing.assert_allclose(triangle(t, 1.0, 3.0, -4.0), [0, 0, -2, -4, -2, 0, 0], atol=1e-15)
    np.testing.assert_array_equal(pulse(t, 1.0, 3.0, -4.0), [0, -4, -4, -4, -4, 0, 0])
