"""Sizes that no machine has are refused, in whatever file or option they stand."""

import json
import re
import tomllib
from copy import deepcopy
from pathlib import Path

import pytest
from typer.testing import CliRunner

from davinci_forces import robots
from davinci_forces.cli import app
from davinci_forces.errors import PipelineError
from davinci_forces.haptics import scenario as haptics
from davinci_forces.robots.urdf import reading as urdf
from davinci_forces.robots.urdf import tables
from davinci_forces.simulation.scenario import reading as scenarios
from davinci_forces.study import reading as studies
from davinci_forces.toml import TomlFile
from davinci_forces.toml.table import KIND_OF, KINDS

PACKAGE = Path(robots.__file__).parents[1]
STUDY = """
title = "T"
robot = "dvrk_psm"
tool = { length = 0.4 }
settings = { lowpass = 17.0, harmonics = 3, q_tau = 1.5, effort = { hand_roll = 1.0 } }
[robot_overrides.hand_roll]
gear_ratio = 50.0
torque_constant = 0.05
harmonics = 5
q_tau = 0.1
limits = { q = [-1.0, 1.0], dq = [-2.0, 2.0], ddq = [-5.0, 5.0], effort = 10.0 }
[[log]]
name = "a"
file = "study.toml"
role = "contact"
period = 10.0
rate = 100.0
skip = 1.0
until = 90.0
contact = [[1.0, 2.0]]
free = [[3.0, 4.0]]
weight = { moves_with = "hand_roll", position = [0.1, 0.1, 0.1], mass = 0.5 }
channels = { "hand_roll.q" = { channel = "q", offset = 1.0, scale = 2.0 }, "hand_roll.tau" = 1 }
"""
ARM = """
wrist = ["grip"]
[[joint]]
name = "j"
kind = "revolute"
terms = ["inertia"]
gear_ratio = 100.0
torque_constant = 0.05
harmonics = 5
q_tau = 0.1
limits = { q = [-1.0, 1.0], dq = [-2.0, 2.0], ddq = [-5.0, 5.0], effort = 10.0 }
[[link]]
name = "l"
alpha = 0.1
a = 0.2
d = 0.3
theta = 0.4
moved_by = "j"
mass = 1.2
centre = [0.1, 0.1, 0.1]
inertia = [0.01, 0.001, 0.001, 0.01, 0.001, 0.01]
[[link]]
name = "m"
moved_by = "grip"
"""
HAPTICS = (PACKAGE / "haptics" / "haptics.toml").read_text(encoding="utf-8").replace("# strongest", "strongest")
HAPTICS = re.sub(r"(?m)^#(?! )", "", HAPTICS)  # with the tables that a study's own estimates replace
SHIPPED = {f"scenario {name}": (PACKAGE / "simulation" / "shipped" / f"{name}.toml").read_text() for name in
           ("davinci-demo", "davinci-filter", "davinci-joints", "davinci-thesis")}  # fmt: skip
URDF = """<robot name="r"><link name="a"/>
<link name="b"><inertial><origin xyz="0.1 0.1 0.1" rpy="0.1 0.1 0.1"/><mass value="1.0"/>
<inertia ixx="1.0" ixy="0.1" ixz="0.1" iyy="1.0" iyz="0.1" izz="1.0"/></inertial></link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.1 0.1 0.1" rpy="0.1 0.1 0.1"/>
<axis xyz="0.1 0.1 0.1"/><limit lower="-1.0" upper="1.0" velocity="2.0" effort="3.0"/></joint></robot>"""
FILES = {
    "study": (STUDY, lambda file: studies.read(file.parent)),
    "arm": (ARM, lambda file: robots.load(file.name, file.parent)),
    "haptics": (HAPTICS, haptics.read),
    **{name: (text, lambda file: scenarios.load(str(file))) for name, text in SHIPPED.items()},
}
JOINTS = {joint.name for joint in robots.load("davinci", Path()).joints}
FAMILIES = {"lab", "exact", "matched", "realistic"}
ODD = (1e-300, -1e300, 1e300, 5e-324)


def written(value) -> str:
    """A value as TOML, in one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {written(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(written, value)) + "]"
    return json.dumps(value)


def lines(values: dict) -> str:
    """A file, a key of the top and an element of a list of tables a line."""
    return "".join(f"{json.dumps(key)} = {written(value)}\n" for key, value in values.items())


def numbers(value, path=()):
    """The paths of all numbers: of a list of numbers or pairs, its first and its last."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from numbers(inner, (*path, key))
    elif isinstance(value, list):
        tables_of = bool(value) and isinstance(value[0], dict)
        for i in range(len(value)) if tables_of else {0, len(value) - 1} if value else ():
            yield from numbers(value[i], (*path, i))
    elif type(value) in (int, float):
        yield path


def kinds_of(path) -> tuple:
    """A path without the numbers and names that tell tables of a list, joints and families apart."""
    names = {"joint": JOINTS, "family": FAMILIES}
    words = [key for key in path if isinstance(key, str)]
    return tuple(next((n for n, of in names.items() if word.partition(".")[0] in of), word) for word in words)


def one_of_each() -> list[tuple[str, tuple]]:
    """A file and the path of a number in it, for each kind of number that files of its kind hold."""
    paths = [(what, path) for what, (text, _) in FILES.items() for path in numbers(tomllib.loads(text))]
    return list({(what.partition(" ")[0], kinds_of(path)): (what, path) for what, path in paths}.values())


def read_with(folder: Path, what: str, path, value: float):
    text, read = FILES[what]
    values = deepcopy(tomllib.loads(text))
    inner = values
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    file = folder / ("study.toml" if what == "study" else "x.toml")
    file.write_text(lines(values), encoding="utf-8")
    return read(file)


@pytest.mark.parametrize("what", FILES)
def test_the_file_is_good_as_it_is(tmp_path, what):
    path = next(numbers(tomllib.loads(FILES[what][0])))
    inner = tomllib.loads(FILES[what][0])
    for key in path:
        inner = inner[key]
    read_with(tmp_path, what, path, inner)


@pytest.mark.parametrize(("what", "path"), one_of_each())
def test_sizes_that_no_machine_has_are_refused_with_their_line(tmp_path, what, path):
    key = [key for key in path if isinstance(key, str)][-1]
    for value in ODD:
        with pytest.raises(PipelineError) as caught:
            read_with(tmp_path, what, path, value)
        line = list(tomllib.loads(FILES[what][0])).index(path[0]) + 1
        problems = [one for one in str(caught.value).splitlines() if f"toml:{line}: " in one]
        assert any(key in one for one in problems), (value, str(caught.value))


@pytest.mark.parametrize(
    "key", ["xyz", "rpy", "value", "ixx", "ixy", "ixz", "iyy", "iyz", "izz", "lower", "upper", "velocity", "effort"]
)
def test_sizes_in_a_urdf_are_refused_with_their_line(key):
    """A limit that is too large is one that says that there is none."""
    for value in (1e-300, 1e300) if key not in ("lower", "upper", "velocity", "effort") else (1e-300,):
        text = re.sub(rf'{key}="[\d.-]+', f'{key}="{value}', URDF)
        notes = TomlFile("x.urdf", {})
        line = text[: text.index(f'{key}="{value}')].count("\n") + 1
        assert urdf.robot_of(tables.parse(text.encode(), "x.urdf"), notes, "x") is None
        assert any(one.startswith(f"x.urdf:{line}: ") and f"{key} must lie between" in one for one in notes.problems())


def test_the_urdf_is_good_as_it_is_and_with_limits_that_are_none():
    for text in (URDF, URDF.replace('velocity="2.0" effort="3.0"', 'velocity="1e300" effort="1.79e308"')):
        notes = TomlFile("x.urdf", {})
        assert urdf.robot_of(tables.parse(text.encode(), "x.urdf"), notes, "x"), notes.problems()


@pytest.mark.parametrize("size", ["1e-300", "1e300", "5e-324"])
@pytest.mark.parametrize("command", [
    "stability --k-h {}", "stability --b-h {}", "stability --m {}", "stability --rate {}", "stability --delay {}",
    "excite davinci hand_roll --period {}", "excite davinci hand_roll --q 0,{}", "excite davinci hand_roll --dq -{},1",
    "excite davinci hand_roll --ddq -1,{}", "excite davinci hand_roll --evaluate {},0.1,0.1",
    "excite davinci hand_roll --evaluate 0,0.1,0.1 --csv /dev/null --rate {}", "robot davinci --at {},0,0",
    "robot davinci --at 0,0,0 --dq {}",
])  # fmt: skip
def test_sizes_of_options_are_refused(command, size):
    said = CliRunner().invoke(app, command.format(size).split())
    assert said.exit_code == 1
    assert "must lie between" in said.output


def test_every_kind_has_a_range_and_no_key_two():
    assert set(KIND_OF.values()) <= set(KINDS)
    assert not set(KIND_OF) & set(KINDS)
    assert all(0 <= least < most for least, most, _ in KINDS.values())


@pytest.mark.parametrize(("key", "size"), [("offset", 0.0), ("offset", -1.0), ("scale", -1.0), ("offset", -1.7e18)])
def test_zero_and_negative_numbers_stay_what_they_are(tmp_path, key, size):
    study = read_with(tmp_path, "study", ("log", 0, "channels", "hand_roll.q", key), size)
    assert getattr(study.logs[0].channels[0], key) == size
