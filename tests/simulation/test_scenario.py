"""Scenario files: what they say, and what is said about wrong ones."""

import tomllib
from dataclasses import replace
from importlib.resources import files
from pathlib import Path as File

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from davinci_forces import robots
from davinci_forces.maths.simulation.actuators import Regulator
from davinci_forces.maths.simulation.surroundings import Path
from davinci_forces.robots.davinci import ROBOT
from davinci_forces.simulation.motion import simulate_log
from davinci_forces.simulation.scenario import BadScenario, ForceSensor
from davinci_forces.simulation.scenario.reading import _scenario, load, shipped_scenarios
from davinci_forces.simulation.sensors import record_force
from davinci_forces.toml import TomlFile, TomlTable
from tests.conftest import TWO_FRICTIONS
from tests.test_study import ANYTHING, places_of

LISTED = ", ".join(robots.ROBOTS)
GOOD = """
title = "A roll"
robot = "davinci"
seed = 1
rate = 100.0
started = "2016-05-02T09:00:00"
[joint.hand_roll]
theta = { inertia = 0.4, "gravity, sine" = 0.1, "viscous friction" = 0.3, "Coulomb friction" = 0.2 }
[[log]]
name = "roll"
file = "roll.tdms"
role = "contact"
duration = 10.0
moves.hand_roll = { period = 5.0, a = [0.1], b = [0.0] }
external.hand_roll = [ { shape = "triangle", start = 2.0, end = 4.0, peak = 1.0 } ]
"""
TWO_ARMS = File(TWO_FRICTIONS).read_text(encoding="utf-8")


def shipped_text(name: str) -> str:
    return files("davinci_forces.simulation").joinpath(f"shipped/{name}.toml").read_text(encoding="utf-8")


def read(tmp_path, text: str):
    file = tmp_path / "mine.toml"
    file.write_text(text, encoding="utf-8")
    return load(str(file))


def problems(tmp_path, text: str) -> list[str]:
    with pytest.raises(BadScenario) as error:
        read(tmp_path, text)
    return [line.removeprefix(f"{tmp_path / 'mine.toml'}:") for line in str(error.value).splitlines()]


def test_a_scenario_says_what_its_file_says(tmp_path):
    scenario = read(tmp_path, GOOD)
    assert scenario.name == "mine"
    assert scenario.joints["hand_roll"].theta == (0.4, 0.1, 0.3, 0.2)
    log = scenario.logs[0]
    assert (log.role, log.duration, log.windows) == ("contact", 10.0, [(2.0, 4.0)])
    assert log.position("hand_roll", np.array([1.25])) == pytest.approx(0.1 * 5 / (2 * np.pi))


@pytest.mark.parametrize("name", shipped_scenarios())
def test_every_shipped_scenario_is_sound(name):
    assert load(name).name == name


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("seed = 1", "sead = 1", [(1, "seed is missing"), (4, "unknown key 'sead'")]),
        ("seed = 1", "seed = 1.5", [(4, "seed must be a whole number, not 1.5")]),
        ('robot = "davinci"', 'robot = "raven"', [(3, f"robot must be one of {LISTED}, not 'raven'")]),
        ("rate = 100.0", "rate = 0", [(5, "rate must be finite and greater than 0, not 0")]),
        ("rate = 100.0", "rate = nan", [(5, "rate must be finite and greater than 0, not nan")]),
        ("rate = 100.0", "rate = 1e7", [(5, "log roll has 1e+08 samples; it must have 2 to")]),
        ("rate = 100.0", "rate = 0.1", [(5, "log roll has 1 samples; it must have 2 to")]),
        ("T09", " 9", [(6, "started must be a date and time such as")]),
        ("inertia = 0.4", "mass = 0.4", [(8, "joint.hand_roll.theta: inertia is missing"), (8, "unknown key 'mass'")]),
        ("hand_roll]", "elbow]", [(7, "robot davinci has no joint 'elbow'"), (14, "there is no [joint.hand_roll]")]),
        ('name = "roll"', 'name = "Roll 1"', [(10, "log 1: name must match [a-z0-9_-]+, not 'Roll 1'")]),
        ("roll.tdms", "../roll.tdms", [(11, "log 1: file must be a plain file name")]),
        ("roll.tdms", "roll.csv", [(11, "ends in .tdms or .lvm")]),
        ('role = "contact"', 'role = "dance"', [(12, "log 1: role must be one of identification")]),
        ("period = 5.0", "period = -5.0", [(14, "log 1.moves.hand_roll: period must be finite and greater than 0")]),
        ("b = [0.0]", "b = []", [(14, "a and b must have one number for each harmonic, not 1 and 0")]),
        ("b = [0.0]", "b = ['x']", [(14, "b must be a list of finite numbers")]),
        ("end = 4.0", "end = 1.0", [(15, "log 1.external.hand_roll 1: end must be after start = 2, not 1")]),
        ("end = 4.0", "end = 40.0", [(15, "end = 40 s is after the end of the recording at 10 s")]),
        ('"triangle"', '"square"', [(15, "shape must be one of triangle, pulse, not 'square'")]),
        ("external.hand_roll", "external.hand_pitch", [(15, "hand_pitch has a contact but is not recorded")]),
        ("duration = 10.0", "duration = 10.0\nmass = 1.0", [(14, "log 1: unknown key 'mass'")]),
        ("moves.hand_roll", "held.hand_roll = 0.0\nmoves.hand_roll", [(14, "hand_roll both moves and is held")]),
        ("[[log]]", "[log]", [(9, "log must be a list of tables")]),
        ("theta = {", "noise = 3\ntheta = {", [(8, "joint.hand_roll.noise: must be a table, not 3")]),
        ("moves.hand_roll = { period = 5.0, a = [0.1], b = [0.0] }", "moves.hand_roll = { path = [[0, 0], [1, 1]] }",
         [(14, "joints that follow their model exactly need a Fourier series")]),
    ],
)  # fmt: skip
def test_everything_wrong_with_a_scenario_is_said_with_its_place(tmp_path, old, new, says):
    assert old in GOOD
    found = problems(tmp_path, GOOD.replace(old, new))
    for line, words in says:
        assert any(problem.startswith(f"{line}: ") and words in problem for problem in found), found


def test_all_problems_are_said_at_once(tmp_path):
    found = problems(tmp_path, GOOD.replace("rate = 100.0", "rate = -1").replace("roll.tdms", "roll.csv"))
    assert len(found) == 2


def test_two_logs_of_one_name_or_file_are_refused(tmp_path):
    found = problems(tmp_path, GOOD + GOOD[GOOD.index("[[log]]") :])
    assert found == ["17: two logs have the name 'roll'", "18: two logs have the file 'roll.tdms'"]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("position_i = [7.5,", "position_i = [-7.5,", "arm.control: position_i must not be negative"),
        ("tick = 5e-4", "tick = 3e-4", "must be a whole number of ticks, not 33.3333"),
        ("rate = 100.0", "rate = 1e-323", "rate must lie between 0.001 and 1e+07 Hz"),
        ("tick = 5e-4", "tick = 'a'", "arm: tick must be a number, not 'a'"),
        ("tick = 5e-4", "tick = 3e-2", "must be a whole number of ticks, not 0.333333"),
        ("rotor_inertia = [1e-6, 1e-6, 1e-6]", "rotor_inertia = [1e-6]", "arm: rotor_inertia must be a list of 3"),
        ("resistance = [2.0, 2.0, 2.0]", "resistance = [2.0, -2.0, 2.0]", "resistance must be greater than 0"),
        ("resistance = [2.0, 2.0, 2.0]", "resistance = [2.0, 0.0, 2.0]", "resistance must be greater than 0"),
        ("position_p", "position_q", "arm.control: position_p is missing"),
        (
            "coulomb = [0.24, 0.20]",
            "coulomb = 0.24",
            "realistic.hand_roll: coulomb must be a list of 2 finite",
        ),
        ("coulomb = [0.24, 0.20]", "coulomb = [0.24, -0.20]", "coulomb must be two numbers that are not negative"),
        ("stops = [-0.09, 0.13]", "stops = [0.13, -0.09]", "stops must be lower and upper"),
        ("skip = 5.0", "skip = 500.0", "skip = 500 s leaves nothing of 55 s"),
        ("[[0, 0.0], [10, 0.05]", "[[0, 0.0], [0, 0.05]", "the times of path must increase"),
        ("surface = 0.04, ", "", "tissue: surface is missing"),
        ("force = [0.0, 12.0, 0.0]", "force = [0.0, 12.0]", "force must be a list of 3 finite numbers"),
    ],
)
def test_the_tables_of_the_whole_arm_are_checked_too(tmp_path, old, new, says):
    text = TWO_ARMS
    assert old in text
    found = problems(tmp_path, text.replace(old, new))
    assert any(says in problem for problem in found), found
    changed = {number for number, line in enumerate(text.splitlines(), start=1) if old in line}
    assert {int(problem.partition(":")[0]) for problem in found} & changed


def test_the_force_at_the_tip_may_be_recorded_late_and_with_noise(tmp_path):
    text = TWO_ARMS
    line = 'file = "tip_contact.tdms"'
    whole = read(tmp_path, text.replace(line, f"{line}\nsensor = {{ noise = 0.1, lag = 0.02 }}"))
    sensors = {log.name: log.sensor for log in whole.logs if log.sensor}
    assert sensors == dict.fromkeys(("matched-tip-contact", "realistic-tip-contact"), ForceSensor(0.1, 0.02))
    [problem] = problems(tmp_path, text.replace(line, f"{line}\nsensor = {{ lag = -1 }}"))
    assert "sensor: lag must be finite and at least 0" in problem
    t, f = np.arange(100) / 100.0, np.arange(300.0).reshape(100, 3)
    made = record_force(ForceSensor(0.0, 0.02), t, f, np.random.default_rng(0))
    assert [channel.quantity for channel in made] == ["force_x", "force_y", "force_z"]
    assert np.allclose(np.stack([channel.samples for channel in made], axis=-1)[2:], f[:-2])


def test_a_log_that_starts_beyond_a_stop_is_said_where_it_says_so(tmp_path):
    text = TWO_ARMS
    found = problems(tmp_path, text.replace("stops = [-0.09, 0.13]", "stops = [0.05, 0.13]"))
    assert found
    for problem in found:
        line, says = problem.split(": ", 1)
        assert "instrument_slide starts at " in says
        assert says.endswith(", beyond its stops 0.05 and 0.13")
        assert text.splitlines()[int(line) - 1].startswith(("[[log]]", "moves.instrument_slide", "held."))


def test_a_robot_whose_links_are_not_known_cannot_be_simulated_as_a_whole(monkeypatch):
    monkeypatch.setattr(robots, "load", lambda *_: replace(ROBOT, chain=None))
    with pytest.raises(BadScenario, match="davinci has no geometry or no masses, so the whole arm cannot be simulated"):
        load("davinci-demo")


def test_an_arm_may_be_run_by_the_pid_of_chapter_5(tmp_path):
    text = TWO_ARMS
    start, end = text.index("[arm.control]"), text.index("[family.matched.hand_roll]")
    pid = 'law = "pid"\nproportional = [1, 2, 3]\nderivative = [4, 5, 6]\nintegral = [0, 0, 0]\ngravity = 0.9\n'
    law = read(tmp_path, text[:start] + "[arm.control]\n" + pid + text[end:]).arm.control
    assert isinstance(law, Regulator)
    assert law.derivative.tolist() == [4.0, 5.0, 6.0]
    assert law.gravity == 0.9


@pytest.mark.slow
def test_an_arm_without_control_falls_as_its_forward_dynamics_say(tmp_path):
    text = TWO_ARMS
    start, end = text.index("[arm.control]"), text.index("[family.matched.hand_roll]")
    scenario = read(tmp_path, text[:start] + '[arm.control]\nlaw = "none"\n' + text[end:])
    entry = next(log for log in scenario.logs if log.name == "matched-pitch-excitation")
    family = scenario.arm.families["matched"]
    none = {name: np.zeros(3) for name in family.friction._fields if name != "stribeck_velocity"}
    smooth = replace(family, friction=family.friction._replace(**none))
    scenario = replace(scenario, arm=replace(scenario.arm, families={"matched": smooth}))
    motion = simulate_log(scenario, replace(entry, lead=0.0, duration=0.3)).motions["hand_pitch"]
    rotors = np.diag(scenario.arm.motors.gear_ratio**2 * scenario.arm.rotors)

    def slope(_, x):
        M, bias = ROBOT.mass_matrix(x[:3]) + rotors, ROBOT.inverse_dynamics(x[:3], x[3:], np.zeros(3))
        return np.concatenate([x[3:], np.linalg.solve(M, -bias)])

    t = np.arange(len(motion.q)) / scenario.rate
    true = solve_ivp(slope, (0, t[-1]), [0, motion.q[0], 0, 0, 0, 0], t_eval=t, rtol=1e-8).y[1]
    fall = abs(true[-1] - true[0])
    assert fall > 0.005
    np.testing.assert_allclose(motion.q, true, atol=0.01 * fall)
    assert not motion.tau.any()


def test_a_family_may_give_a_log_another_role():
    roles = {log.name: log.role for log in load(TWO_FRICTIONS).logs}
    assert roles["matched-roll-excitation"] == "identification"
    assert roles["realistic-roll-excitation"] == "validation"


def test_a_name_that_no_scenario_has_is_answered_with_those_there_are():
    with pytest.raises(BadScenario, match="davinci-demo, davinci-filter, davinci-joints, davinci-thesis"):
        load("davinci")


def test_a_file_that_is_not_toml_is_named(tmp_path):
    assert "Expected" in problems(tmp_path, "title =")[0] or "Invalid" in problems(tmp_path, "title =")[0]


def test_a_path_goes_at_constant_speed_or_eases_from_point_to_point():
    points = ((0.0, 1.0), (2.0, 3.0), (3.0, 0.0))
    t = np.array([-1.0, 0.0, 0.5, 1.0, 2.0, 9.0])
    assert Path(points, ease=False).position(t) == pytest.approx([1.0, 1.0, 1.5, 2.0, 3.0, 0.0])
    quarter = 1 + 2 * (1 - np.cos(np.pi / 4)) / 2
    assert Path(points, ease=True).position(t) == pytest.approx([1.0, 1.0, quarter, 2.0, 3.0, 0.0])


@given(data=st.data())
def test_no_scenario_file_however_odd_ends_in_anything_but_problems(data):
    """Any value of a good scenario, tables included, replaced by anything that TOML can hold."""
    table = tomllib.loads(data.draw(st.sampled_from((GOOD, shipped_text("davinci-demo")))))
    parent, key = data.draw(st.sampled_from(places_of(table)))
    parent[key] = data.draw(ANYTHING | st.integers(10**400, 10**401))
    file = TomlFile("odd.toml", {})
    made = _scenario("odd", TomlTable(table, file))
    assert file.problems() or made.logs
