"""Scenarios of a hand that feels: what a file says, what is said about a wrong one, the command, and within a study."""

import csv
import json
import re
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from typer.testing import CliRunner

from davinci_forces.cli import app
from davinci_forces.errors import BadStudy
from davinci_forces.haptics import loop as haptic
from davinci_forces.haptics.scenario import SLIDE, SLIDE_NOISE, BadHaptics, read
from davinci_forces.runner.fingerprint import canonical
from davinci_forces.runner.reporting import study_files
from davinci_forces.study import HapticScenario, reading
from tests import arm

SHIPPED = files("davinci_forces.haptics").joinpath("haptics.toml").read_text(encoding="utf-8")
STATED = re.sub(r"(?m)^#(?! )", "", SHIPPED)  # with the tables that a study's own estimates replace
SHORT = """
plan = [[0.0, -0.01], [0.5, 0.01], [1.0, -0.01]]
[[hand]]
name = "still"
mass = 1.0
damping = 40.0
stiffness = 500.0
[arm]
follows = "exactly"
[filter]
use = "none"
[tissue]
stiffness = 100.0
friction = 0.0
"""


def written(folder, text: str):
    file = folder / "mine.toml"
    file.write_text(text, encoding="utf-8")
    return file


def problems(folder, text: str) -> list[str]:
    file = written(folder, text)
    with pytest.raises(BadHaptics) as error:
        read(file)
    return [line.removeprefix(f"{file}:") for line in str(error.value).splitlines()]


def said(*options: str, code: int = 0) -> str:
    shown = CliRunner().invoke(app, ["haptics", *map(str, options)])
    assert shown.exit_code == code, shown.output
    return shown.output


def test_the_shipped_file_says_what_is_taken_where_none_says_another(tmp_path):
    assert (read(written(tmp_path, SHIPPED)).body, read(written(tmp_path, SHIPPED)).stiffness) == (None, None)
    shipped = read(written(tmp_path, STATED))
    assert canonical(haptic.complete_scenario(shipped)) == canonical(haptic.complete_scenario(HapticScenario()))
    assert (shipped.body, shipped.noise) == (SLIDE, SLIDE_NOISE)
    assert canonical(read(written(tmp_path, ""))) == canonical(HapticScenario())


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("seed = 8", "sead = 8", (5, "unknown key 'sead'; known keys are")),
        ("mass = 1.0", "mass = 0", (19, "hand 1: mass must be finite and greater than 0, not 0")),
        ("damping = 40.0", "", (23, "hand 2: damping is missing")),
        ('name = "firm"', 'name = "relaxed"', (24, "two hands have the name 'relaxed'")),
        ('name = "firm"', 'name = "My hand"', (24, "hand 2: name must match [a-z0-9_-]+")),
        ("motion_scale = 1.0", "motion_scale = -1", (30, "device: motion_scale must be finite and greater than 0")),
        (
            "rate = 100.0         #",
            "rate = 300.0 #",
            (37, "link: the period at 300 Hz must be a whole number of ticks of 0.0005 s"),
        ),
        ("force_delay = 0.0 ", "force_delay = 20 ", (39, "link: force_delay must be at most 5 s, not 20")),
        (
            '"cascade" #',
            '"exactly" #',
            (42, "an arm that follows exactly has no effort to estimate a force from; write use"),
        ),
        ("stops = [-0.13, 0.09]", "stops = [0.1, 0]", (45, "arm: stops must be lower and upper, not 0.1 and 0")),
        ("tick = 5e-4 ", "tick = 5e-7 ", (43, "arm: 6e+07 ticks are too many to simulate; use at most 2000000")),
        ("inductance = 3e-4", "inductance = 0", (51, "arm.motor: inductance must be finite and")),
        ("position_p = 30.0", "position_p = 'x'", (57, "arm.control: position_p must be a number, not 'x'")),
        ("coulomb = [3.984, 3.984]   #", "coulomb = [-1, 1] #", (71, "arm.body: coulomb must be two numbers")),
        ("inertia = 2.0036", "inertia = 0", (68, "arm.body: inertia must be finite and greater than 0")),
        ('use = "ekf"', 'use = "kalman"', (79, "filter: use must be one of ekf, none, not 'kalman'")),
        ("stiffness = 457.24", "stiffness = -1", (84, "tissue: stiffness must be finite and greater than 0")),
        (
            "friction = 0.05 ",
            "friction = 1.5 ",
            (86, "tissue: friction must be below 1, not 1.5, because tissue never pulls"),
        ),
        ("[0.0, -0.04], [1.0, 0.03]", "[0.0, -40], [1.0, 0.03]", (9, "it is in metres")),
        ("[0.0, -0.04], [1.0, 0.03]", "[1.0, -0.04], [1.0, 0.03]", (9, "the times of plan must increase")),
    ],
)
def test_everything_wrong_with_a_scenario_is_said_with_its_place(tmp_path, old, new, says):
    assert STATED.count(old) >= 1
    found = problems(tmp_path, STATED.replace(old, new, 1))
    line, words = says
    assert any(problem.startswith(f"{line}: ") and words in problem for problem in found), found


def test_all_problems_are_said_at_once(tmp_path):
    wrong = STATED.replace("mass = 1.0", "mass = -1").replace("strongest", "x\n# strongest").replace("tau = 1", "t = 1")
    found = problems(tmp_path, wrong.replace('use = "ekf"', 'use = "no"').replace("# x", "x = 1"))
    assert [
        words in problem for problem, words in zip(found, ("mass", "mass", "'x'", "tau", "'t'", "use"), strict=True)
    ]


def test_a_file_that_is_not_there_or_is_no_toml_is_said(tmp_path):
    assert "no such file" in said(tmp_path / "none.toml", code=1)
    assert "mine.toml" in said(written(tmp_path, "plan = ["), code=1)


def test_what_is_left_open_is_filled_and_what_is_stated_is_kept(tmp_path):
    stated = read(written(tmp_path, SHORT))
    body = SLIDE._replace(inertia=3.0)
    assert haptic.complete_scenario(stated).stiffness == 100.0
    assert haptic.complete_scenario(HapticScenario(), stiffness=333.0).stiffness == 333.0
    found = haptic.complete_scenario(stated, body)
    assert (found.body, found.assumed_body) == (body, body)
    own = replace(stated, body=SLIDE)
    assert (
        haptic.complete_scenario(own, body).assumed_body == SLIDE
    )  # the filter assumes the true body, unless the file says another


def test_the_command_says_what_each_hand_feels_and_where_its_limits_are(tmp_path):
    text = said(written(tmp_path, SHORT))
    assert "simulated, against tissue of 100 N/m" in text
    assert "Hand 'still' of m = 1 kg, b_H = 40 N s/m and K_H = 500 N/m" in text
    assert "limit for elastic tissue" in text
    assert "for this tissue the hand's own damping suffices, by the response" in text
    weak = written(tmp_path, SHORT.replace("damping = 40.0", "damping = 0.3"))
    assert re.search(r"for this tissue a damping of 0\.\d+ N s/m is needed", said(weak))


def test_its_numbers_and_traces_are_for_machines_too(tmp_path):
    answer = json.loads(said(written(tmp_path, SHORT), "--json", "--csv", tmp_path / "traces"))
    assert answer["tissue_stiffness"] == 100.0
    hand = answer["hands"]["still"]
    with (tmp_path / "traces" / "still.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 100
    assert max(float(row["true [N]"]) for row in rows) == pytest.approx(hand["true_peak"])
    assert hand["out_of_reach"] is None
    assert answer["response"][0]["share"] == pytest.approx(1.0, abs=1e-3)


def test_an_unstable_hand_is_said_to_be_thrown_out_of_reach(tmp_path):
    wild = SHORT.replace("damping = 40.0", "damping = 0.1").replace("stiffness = 100.0", "stiffness = 1e5")
    assert "unstable: the hand is thrown out of the device's reach after" in said(written(tmp_path, wild))


def test_the_template_is_the_shipped_file_and_overwrites_none(tmp_path):
    target = tmp_path / "new.toml"
    assert "written; change its numbers" in said("--template", target)
    assert target.read_text(encoding="utf-8") == SHIPPED
    assert "exists already" in said("--template", target, code=1)


@pytest.fixture
def study(tmp_path):
    folder = arm.write_study(tmp_path / "raw" / "arm")
    text = (folder / "study.toml").read_text()

    def with_haptics(value: str):
        (folder / "study.toml").write_text(f"haptics = {value}\n{text}")
        return folder

    return with_haptics


def test_a_study_names_the_file_of_its_scenario(study):
    folder = study('"mine.toml"')
    written(folder, SHORT)
    read = reading.read(folder)
    assert read.haptics.stiffness == 100.0
    assert study_files(read) == ("study.toml", read.robot.file, "mine.toml")  # so a report states its hash


def test_problems_of_that_file_are_said_with_those_of_the_study(study):
    folder = study('"mine.toml"\nrate = 3')
    written(folder, SHORT.replace("friction = 0.0", "friction = 2"))
    with pytest.raises(BadStudy) as error:
        reading.read(folder)
    assert "mine.toml:14: tissue: friction must be below 1" in str(error.value)
    assert "study.toml:2: unknown key 'rate'" in str(error.value)


@pytest.mark.parametrize(
    ("value", "words"),
    [('"../mine.toml"', "must name a file inside the study"), ('"mine.toml"', "no such file"), ("3", "haptics")],
)
def test_a_study_that_names_no_such_file_is_told(study, value, words):
    with pytest.raises(BadStudy, match=words):
        reading.read(study(value))


def test_a_plan_begins_and_ends_where_it_says(tmp_path):
    scenario = haptic.complete_scenario(read(written(tmp_path, SHORT)))
    run = haptic.experiment(scenario, *scenario.hands[0])
    assert run.plan_x[0] == pytest.approx(-0.01)
    assert run.plan_x[50] == pytest.approx(0.01)
    assert np.abs(run.hand_x - run.plan_x).max() < 0.004
