"""Study files: everything that is wrong is said at once, with its line; what is right means what it says."""

import contextlib
import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from davinci_forces import robots
from davinci_forces.errors import BadRobot, BadStudy
from davinci_forces.maths.mechanics.kinematics import tip
from davinci_forces.robots.from_toml import RESERVED
from davinci_forces.robots.robot import Kind
from davinci_forces.runner.fingerprint import hash_of
from davinci_forces.runner.reporting import study_files
from davinci_forces.study import AttachedMass, reading
from davinci_forces.toml import TomlFile, TomlTable
from tests.arm import write_study
from tests.test_runs import call

GOOD = """title = "T"
robot = "davinci"
[[log]]
name = "a"
file = "a.csv"
role = "identification"
period = 10
contact = [[1, 2]]
[log.channels]
time = "Time"
"hand_roll.theta_m" = { channel = "Motors/Roll", unit = "deg", sign = -1, offset = 0.5 }
hand_roll.i = "Current"
"""


def read(tmp_path, text):
    (tmp_path / "study.toml").write_text(text)
    return reading.read(tmp_path)


def test_a_good_study_means_what_it_says(tmp_path):
    made = read(tmp_path, GOOD)
    [entry] = made.logs
    assert (entry.name, entry.files, entry.period, entry.contact, entry.skip) == (
        "a",
        ("a.csv",),
        10.0,
        ((1.0, 2.0),),
        0.0,
    )
    angle = next(s for s in entry.channels if s.symbol == "theta_m")
    assert (angle.joint, angle.channel, angle.unit, angle.sign, angle.offset) == (
        "hand_roll",
        "Motors/Roll",
        "deg",
        -1,
        0.5,
    )
    assert entry.joints == ("hand_roll",)
    assert made.absent() == ("a.csv",)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('title = "T"', "title = 3", "1: title must be text, not 3"),
        ('title = "T"', 'titel = "T"', "1: unknown key 'titel'; known keys are title, robot"),
        ('robot = "davinci"', 'robot = "davinchi"', "2: there is no robot 'davinchi'; name one of davinci, "),
        ('robot = "davinci"', 'robot = "../arm.toml"', "2: robot '../arm.toml' lies outside the study; copy"),
        ('robot = "davinci"', 'robot = "arm.toml"', "there is no such robot file"),
        ('name = "a"', 'name = "A b"', "4: log name 'A b' may have only lower-case letters, digits, _ and -"),
        ('name = "a"', "", "3: log 1 has no name"),
        ('file = "a.csv"', 'file = "../a.csv"', "5: log 'a': '../a.csv' lies outside the study's folder"),
        ('file = "a.csv"', 'file = "/etc/a.csv"', "lies outside the study's folder"),
        ('file = "a.csv"', "", "log 'a': give one of file"),
        (
            'role = "identification"',
            'role = "training"',
            "6: log 'a': role must be one of identification, validation, contact",
        ),
        ("period = 10", "period = -1", "7: log 'a': period must be positive, not -1"),
        ("period = 10", 'period = "ten"', "7: log 'a': period must be a number, not 'ten'"),
        ("contact = [[1, 2]]", "contact = [[2, 1]]", "8: log 'a': contact must be a list of [start, end]"),
        (
            "contact = [[1, 2]]",
            "contact = [[13, 19.3]]\nfree = [[0, 3], [2, 14]]",
            "9: log 'a': free [2, 14] and contact [13, 19.3] share 13 to 14 s; shorten one, so that no time is in both",
        ),
        ("contact = [[1, 2]]", "colour = 1", "8: log 'a': unknown key 'colour'"),
        (
            "hand_roll.theta_m",
            "hand_rol.theta_m",
            "11: log 'a': robot davinci has no joint 'hand_rol'; it has hand_roll",
        ),
        ("hand_roll.theta_m", "hand_roll.angle", "11: log 'a': unknown quantity 'hand_roll.angle'; the quantities"),
        (
            'unit = "deg"',
            'unit = "degres"',
            "11: log 'a': channel of 'hand_roll.theta_m': unknown unit 'degres'; known units are rad, mrad, deg",
        ),
        (
            'unit = "deg"',
            'unit = "mm"',
            "11: log 'a': channel of 'hand_roll.theta_m': 'mm' measures length, but angle is needed",
        ),
        ("sign = -1", "sign = 2", "sign must be 1 or -1, not 2"),
        ("offset = 0.5", "ofset = 0.5", "unknown key 'ofset'; known keys are channel, unit, sign, offset"),
        ('hand_roll.i = "Current"', "", "3: log 'a': hand_roll has no effort; give hand_roll.tau or hand_roll.i"),
        (
            'hand_roll.i = "Current"',
            'hand_roll.i = "C"\nhand_roll.tau = "D"',
            "hand_roll has both tau and i; leave one out",
        ),
        ('hand_roll.i = "Current"', "hand_roll.i = -1", "must be a name, or a column number from 0, not -1"),
        ("[[log]]", "[settings]\nlowpass = 0\n[[log]]", "4: settings: lowpass must be positive, not 0.0"),
        ("[[log]]", "[settings]\nlow = 0\n[[log]]", "4: settings: unknown key 'low'; known keys are lowpass"),
        ("[[log]]", "[settings.effort]\nelbow = 1\n[[log]]", "4: settings.effort: davinci has no joint"),
        ("[[log]]", "[settings.effort]\nhand_roll = 0\n[[log]]", "4: settings.effort: hand_roll must be positive"),
        ("[[log]]", "[settings]\neffort = 3\n[[log]]", "4: settings.effort: must be a table, not 3"),
        (
            "[[log]]",
            "[robot_overrides.elbow]\ngear_ratio = 1\n[[log]]",
            "3: robot_overrides: davinci has no joint 'elbow'",
        ),
        ("[[log]]", "[robot_overrides.hand_roll]\ngear_ratio = 0\n[[log]]",
            "4: robot_overrides.hand_roll: gear_ratio must be a number other than 0, not 0"),
        ("[[log]]", "[robot_overrides.hand_roll]\nlimits = [0, 1]\n[[log]]",
            "4: robot_overrides.hand_roll.limits: must be a table such as { q = [-0.6, 0.6], dq = [-1.2, 1.2] }, not"),
        ("[[log]]", '[robot_overrides.hand_roll]\ntitle = "Rig"\n[[log]]',
            "4: robot_overrides.hand_roll: title is not shown: reports name a joint by its name"),
        ("[[log]]", "[robot_overrides.hand_roll]\ngears = 1\n[[log]]",
            "4: robot_overrides.hand_roll: unknown key 'gears'; known keys are title, terms"),
        ("[[log]]", "tool = { length = 0.4 }\n[[log]]", "3: robot davinci has no known tool in its chain"),
        ("[[log]]", "tool = { length = 416.2 }\n[[log]]", "3: tool: length must lie between 0.001 and 10 m, not 416.2"),
        ("[[log]]", "tool = { long = 0.4 }\n[[log]]", "3: tool: unknown key 'long'; known keys are length"),
        ("[[log]]", "tool = 0.4\n[[log]]", "3: tool: must be a table, not 0.4"),
        ('title = "T"', 'title = "T', "study.toml: Illegal character"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_its_line_and_the_remedy(tmp_path, old, new, says):
    assert old in GOOD
    with pytest.raises(BadStudy) as caught:
        read(tmp_path, GOOD.replace(old, new, 1))
    assert says in str(caught.value)


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers(-3, 3) | st.floats() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=4,
)


def places_of(parent) -> list:
    """Every place in nested tables and lists, as what holds it and its key."""
    found = []
    for key, value in parent.items() if isinstance(parent, dict) else enumerate(parent):
        found.append((parent, key))
        if isinstance(value, dict | list):
            found += places_of(value)
    return found


@given(data=st.data())
def test_no_study_file_however_odd_ends_in_anything_but_a_message(data, tmp_path_factory):
    """Any value of a good study, tables included, replaced by anything that TOML can hold."""
    table = tomllib.loads(GOOD)
    places = places_of(table)
    table |= {
        "settings": {"lowpass": 3.0},
        "robot_overrides": {"hand_roll": {"gear_ratio": 2.0, "limits": {"q": [0, 1]}}},
    }
    places += places_of({key: table[key] for key in ("settings", "robot_overrides")})
    parent, key = data.draw(st.sampled_from(places))
    parent[key] = data.draw(ANYTHING)
    folder = tmp_path_factory.mktemp("odd", numbered=True)
    with contextlib.suppress(BadStudy):
        assert reading.study_of(TomlTable(table, TomlFile("study.toml", {})), folder).logs


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("[[log]]", '[settings]\nfit = "coupled.x"\n[[log]]',
         "4: settings: fit must be one of chosen, independent.lse, "),
        ("[[log]]", "[settings]\nharmonics = 101\n[[log]]",
         "4: settings: harmonics must lie between 0 and 100, not 101"),
        ("[[log]]", "[settings]\nharmonics = -1\n[[log]]", "harmonics must be positive, not -1"),
        ("[[log]]", "[settings]\nlowpass = 1e6\n[[log]]",
         "lowpass must lie between 1e-06 and 100000 Hz, not 1000000.0"),
        ("[[log]]", f"[settings]\nlowpass = 1{'0' * 400}\n[[log]]", "4: settings: lowpass must be a number, not 1000"),
        ("period = 10", "period = 1e7", "7: log 'a': period must lie between 1e-06 and 1e+06 s, not 10000000.0"),
        ("period = 10", "rate = 1e-4", "7: log 'a': rate must lie between 0.001 and 1e+07 Hz, not 0.0001"),
        ("period = 10", "rate = 1e8", "rate must lie between"),
        ("period = 10", "skip = 1e9", "skip must lie between"),
        ("period = 10", "until = 0", "7: log 'a': until must be positive, not 0"),
        ("period = 10", "until = 2e6", "until must lie between 0.001 and 1e+06 s"),
        ("period = 10", "until = 5.0\nskip = 5.0", "7: log 'a': until = 5 s leaves no samples after skip = 5 s"),
        ("period = 10", 'delimiter = ""', "7: log 'a': delimiter must not be empty"),
        ("contact = [[1, 2]]", "contact = [[-1, 2]]", "8: log 'a': contact must be a list of [start, end]"),
        ("contact = [[1, 2]]", "contact = [[1, inf]]", "8: log 'a': contact must be a list of [start, end]"),
        ('name = "a"', 'name = "con"', "4: log name 'con' is reserved on Windows"),
        ("offset = 0.5", f"offset = 1{'0' * 400}", "offset must be a number"),
        ('title = "T"', f"title = {'1' * 5000}", "Exceeds the limit"),
        ('file = "a.csv"', 'file = "b/../../a.csv"', "lies outside the study's folder"),
        ('file = "a.csv"', 'file = ".."', "lies outside the study's folder"),
    ],
)  # fmt: skip
def test_what_is_not_plausible_is_refused(tmp_path, old, new, says):
    assert old in GOOD
    (tmp_path / "study.toml").write_text(GOOD.replace(old, new, 1))
    with pytest.raises(BadStudy) as caught:
        reading.read(tmp_path)
    assert says in str(caught.value)


def test_a_study_may_say_how_long_its_tool_was(tmp_path):
    """And the report is told, as of all that a study changes of a robot."""
    made = read(
        tmp_path, GOOD.replace('"davinci"', '"dvrk_psm"\ntool = { length = 0.5 }\nrobot_overrides.hand_roll = {}')
    )
    assert made.robot.tool.length == 0.5
    at, usual = (tip(robot.chain, [0.0, 0.0, 0.1]) for robot in (made.robot, robots.load("dvrk_psm", tmp_path)))
    assert (usual - at)[2] == pytest.approx(0.5 - 0.4162)
    assert made.changed == {"tool": {"length": 0.5}}


def test_a_study_may_say_how_its_base_is_mounted(tmp_path):
    """On a wall gravity pulls along the base's -y, and what the thesis prints of the upright arm does not apply."""
    made = read(tmp_path, GOOD.replace('"davinci"', '"davinci"\nbase = { rpy = [1.5707963267948966, 0.0, 0.0] }'))
    np.testing.assert_allclose(made.robot.chain.up, [0.0, 1.0, 0.0], rtol=0, atol=1e-15)
    roll, _, slide = made.robot.joints
    assert {"gravity, sine", "gravity, cosine"}.isdisjoint(term.name for term in roll.terms)  # it lies along gravity
    assert [term.name for term in slide.terms] == ["inertia", "offset", "viscous friction", "Coulomb friction"]
    assert roll.printed == ()
    assert made.changed == {"base": {"rpy": [1.5707963267948966, 0.0, 0.0]}}
    upright = read(tmp_path, GOOD.replace('"davinci"', '"davinci"\nbase = { rpy = [0.0, 0.0, 2.0] }'))
    assert upright.robot.joints == robots.load("davinci", tmp_path).joints


@pytest.mark.parametrize(
    ("base", "says"),
    [
        ("{ rpy = [90.0, 0.0, 0.0] }", "base: rpy is in rad, so that [90.0, 0.0, 0.0] is more than a turn"),
        ("{ rpy = [0.0, 0.0] }", "base: rpy must be roll, pitch and yaw [rad]"),
        ("{ roll = 1.0 }", "base: rpy is missing"),
    ],
)
def test_what_is_wrong_with_a_base_is_said(tmp_path, base, says):
    with pytest.raises(BadStudy) as caught:
        read(tmp_path, GOOD.replace('"davinci"', f'"davinci"\nbase = {base}'))
    assert says in str(caught.value)


@pytest.mark.parametrize("file", ["..x.csv", "...csv", "a/../b.csv"])
def test_a_file_whose_name_begins_with_dots_lies_inside(tmp_path, file):
    (tmp_path / "study.toml").write_text(GOOD.replace("a.csv", file))
    assert reading.read(tmp_path).logs[0].files == (file,)


def test_settings_at_their_limits_are_taken(tmp_path):
    limits = '[settings]\nlowpass = 1e5\nharmonics = 100\nfit = "independent.wlse"\n[[log]]'
    (tmp_path / "study.toml").write_text(GOOD.replace("[[log]]", limits))
    settings = reading.read(tmp_path).settings
    assert (settings.lowpass, settings.harmonics, settings.fit) == (1e5, 100, "independent.wlse")


@pytest.mark.parametrize("value", ['"harmonics"', '"fft"'])
def test_a_setting_of_earlier_versions_is_remarked_on_once_and_changes_nothing(tmp_path, value):
    plain = read(tmp_path, GOOD)
    assert plain.remarks == ()
    old = read(tmp_path, GOOD.replace("[[log]]", f"[settings]\nderivative = {value}\n[[log]]"))
    line = f"{tmp_path / 'study.toml'}:4: the setting 'derivative' no longer has an effect; remove it"
    assert (old.settings, old.remarks) == (plain.settings, (line,))
    with pytest.raises(BadStudy, match="unknown key 'derivatives'"):
        read(tmp_path, GOOD.replace("[[log]]", f"[settings]\nderivatives = {value}\n[[log]]"))


def test_a_run_says_that_a_setting_has_no_effect(tmp_path):
    study = write_study(tmp_path / "raw" / "arm")
    file = study / "study.toml"
    file.write_text(file.read_text().replace("[[log]]", '[settings]\nderivative = "fft"\n[[log]]', 1))
    assert call("ingest", study).count("the setting 'derivative' no longer has an effect") == 1


@pytest.mark.parametrize("name", ["con", "NUL", "com1.old"])
def test_a_study_may_not_be_called_what_windows_reserves(tmp_path, name):
    (tmp_path / name).mkdir()
    (tmp_path / name / "study.toml").write_text(GOOD)
    with pytest.raises(BadStudy, match=f"is called '{name}', which is reserved on Windows"):
        reading.read(tmp_path / name)
    assert "comx" not in RESERVED


def test_all_problems_are_said_at_once(tmp_path):
    text = (
        GOOD.replace("identification", "x")
        .replace('"deg"', '"y"')
        .replace("period = 10", "period = 0")
        .replace("T", "T")
    )
    with pytest.raises(BadStudy) as caught:
        read(tmp_path, text + GOOD.partition("[[log]]")[1] + GOOD.partition("[[log]]")[2])
    lines = str(caught.value).splitlines()
    assert len(lines) == 5
    assert any("14: two logs are named 'a'" in line for line in lines)
    assert any(f"5: file 'a.csv' is not in {tmp_path}" in line for line in lines)
    assert all(line.startswith(f"{tmp_path}/study.toml:") for line in lines)


def problems(folder) -> list[str]:
    """What is said of a study in `folder`, without the folder."""
    with pytest.raises(BadStudy) as caught:
        reading.read(folder)
    return str(caught.value).replace(f"{folder}/", "").replace(str(folder), "the folder").splitlines()


def test_nothing_that_is_wrong_hides_anything_else(tmp_path):
    text = GOOD.replace("title", "titel").replace("period = 10", "period = -10").replace("hand_roll.i", "hand_rol.i")
    (tmp_path / "study.toml").write_text(text)
    known = (
        "known keys are title, robot, simulated, robot_overrides, tool, base, settings, haptics, baseline, log; did "
        "you mean 'title'?"
    )
    assert problems(tmp_path) == [
        f"study.toml:1: unknown key 'titel'; {known}",
        "study.toml:5: file 'a.csv' is not in the folder",
        "study.toml:7: log 'a': period must be positive, not -10.0",
        "study.toml:12: log 'a': robot davinci has no joint 'hand_rol'; it has hand_roll, hand_pitch, instrument_slide",
    ]


def test_a_file_that_is_not_there_is_looked_for_on_the_line_that_names_it(tmp_path):
    files = 'files = [ # in this order\n  "a.csv",\n  "b.csv",\n]'
    (tmp_path / "a.csv").write_text("")
    (tmp_path / "study.toml").write_text(GOOD.replace('file = "a.csv"', files).replace("period = 10", "period = 0"))
    assert problems(tmp_path) == [
        "study.toml:7: file 'b.csv' is not in the folder",
        "study.toml:10: log 'a': period must be positive, not 0.0",
    ]


def test_what_is_wrong_with_a_study_and_with_its_robot_is_said_together(tmp_path):
    arm = ARM.replace("gear_ratio = 50.0", "gear_ratio = 0").replace("[-1, 1]", "[1]")
    study = GOOD.replace('"davinci"', '"my_arm.toml"').replace("period = 10", "period = 0")
    (tmp_path / "my_arm.toml").write_text(arm)
    (tmp_path / "study.toml").write_text(study.replace("hand_roll.theta_m", "shoulder.theta_m"))
    (tmp_path / "a.csv").write_text("")
    assert problems(tmp_path) == [
        "study.toml:7: log 'a': period must be positive, not 0.0",
        "study.toml:12: log 'a': robot mine has no joint 'hand_roll'; it has shoulder",
        "my_arm.toml:6: joint 1 (shoulder): gear_ratio must be a number other than 0, not 0",
        "my_arm.toml:7: joint 1 (shoulder).limits: q must be [lower, upper], not [1]",
    ]


def test_joints_are_not_doubted_where_the_robot_does_not_say_which_it_has(tmp_path):
    (tmp_path / "my_arm.toml").write_text(ARM.replace("shoulder", "Shoulder"))
    study = GOOD.replace('"davinci"', '"my_arm.toml"').replace("hand_roll", "shoulder")
    (tmp_path / "study.toml").write_text(study)
    (tmp_path / "a.csv").write_text("")
    assert problems(tmp_path) == [
        "my_arm.toml:3: joint 1: name 'Shoulder' may have only lower-case letters, digits, _ and -"
    ]


def test_a_missing_study_says_how_to_get_one(tmp_path):
    assert "`davinci-forces new` writes one from a log" in " ".join(call("all", tmp_path, code=1).split())


def test_every_missing_file_is_named(tmp_path):
    (tmp_path / "study.toml").write_text(GOOD.replace('file = "a.csv"', 'files = ["a.csv", "b.csv"]'))
    said = " ".join(call("ingest", tmp_path, code=1).split())
    assert "study.toml:5: file 'a.csv' is not in" in said
    assert "study.toml:5: file 'b.csv' is not in" in said


def test_overrides_change_one_robot_of_one_study(tmp_path):
    made = read(tmp_path, GOOD.replace("[[log]]", "[robot_overrides.hand_roll]\ngear_ratio = 198.5\n[[log]]"))
    assert made.robot.joint("hand_roll").gear_ratio == 198.5
    assert made.robot.joint("hand_pitch").gear_ratio == 200.0
    assert robots.load("davinci", tmp_path).joint("hand_roll").gear_ratio == 200.0


ARM = """name = "mine"
[[joint]]
name = "shoulder"
kind = "revolute"
terms = ["inertia", "offset", "viscous friction"]
gear_ratio = 50.0
limits = { q = [-1, 1] }
"""


def test_a_robot_may_be_described_beside_the_study(tmp_path):
    (tmp_path / "arm.toml").write_text(ARM)
    robot = robots.load("arm.toml", tmp_path)
    [joint] = robot.joints
    assert (joint.kind, joint.gear_ratio, joint.limits.q) == (Kind.REVOLUTE, 50.0, (-1.0, 1.0))
    assert [term.name for term in joint.terms] == ["inertia", "offset", "viscous friction"]
    with pytest.raises(BadRobot, match="robot mine has no joint 'elbow'; it has shoulder"):
        robot.joint("elbow")


ARM_URDF = """<robot name="mine"><link name="base"/><link name="upper"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1"/></joint></robot>"""
STUDY_OF_URDF = """robot = "arm.urdf"
[robot_overrides.shoulder]
effort = "A"
[[log]]
name = "run"
file = "run.csv"
role = "validation"
rate = 100.0
channels = { "shoulder.q" = 0, "shoulder.i" = 1 }
"""


def test_a_urdf_beside_the_study_describes_its_robot_and_counts_among_its_files(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM_URDF)
    (tmp_path / "run.csv").write_text("0,0\n")
    study = read(tmp_path, STUDY_OF_URDF)
    assert study_files(study) == ("study.toml", "arm.urdf")
    [joint] = study.robot.joints
    assert (joint.name, joint.limits.q, joint.unit("{effort}")) == ("shoulder", (-1.0, 1.0), "A")
    before = hash_of(study.robot)
    (tmp_path / "arm.urdf").write_text(ARM_URDF.replace('xyz="0 1 0"', 'xyz="1 1 0"'))
    assert hash_of(read(tmp_path, STUDY_OF_URDF).robot) != before


def test_what_is_wrong_with_a_urdf_is_said_together_with_what_is_wrong_with_the_study(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM_URDF.replace('type="revolute"', 'type="screw"'))
    (tmp_path / "run.csv").write_text("0,0\n")
    with pytest.raises(BadStudy) as caught:
        read(tmp_path, STUDY_OF_URDF.replace("rate = 100.0", "rat = 100.0"))
    said = str(caught.value)
    assert "study.toml:8: log 'run': unknown key 'rat'" in said
    assert "arm.urdf:2: <joint name='shoulder'>: type is 'screw'" in said


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            'kind = "revolute"',
            'kind = "screw"',
            "arm.toml:4: joint 1 (shoulder): kind must be one of revolute, prismatic, not 'screw'",
        ),
        ('"offset"', '"stiction"', "arm.toml:5: joint 1 (shoulder): terms must be a list of 'inertia'"),
        (
            "gear_ratio = 50.0",
            "gear = 50.0",
            "arm.toml:6: joint 1 (shoulder): unknown key 'gear'; known keys are name, kind, title, terms, limits, "
            "gear_ratio, torque_constant, effort, harmonics, q_tau; did you mean 'gear_ratio'?",
        ),
        ("q = [-1, 1]", "q = [1, -1]", "arm.toml:7: joint 1 (shoulder).limits: q must be [lower, upper], not [1, -1]"),
        (
            "[[joint]]",
            "[[joints]]",
            "arm.toml:2: unknown key 'joints'; known keys are name, title, joint, link; did you mean 'joint'?",
        ),
    ],
)
def test_what_is_wrong_with_a_robot_is_said(tmp_path, old, new, says):
    (tmp_path / "arm.toml").write_text(ARM.replace(old, new, 1))
    with pytest.raises(BadRobot) as caught:
        robots.load("arm.toml", tmp_path)
    assert says in str(caught.value)


def test_the_effort_that_is_sought_is_read_joint_by_joint(tmp_path):
    made = read(tmp_path, GOOD.replace("[[log]]", "[settings]\neffort = { hand_roll = 0.5 }\n[[log]]"))
    assert made.settings.effort == {"hand_roll": 0.5}
    assert read(tmp_path, GOOD).settings.effort == {}


HUNG = (
    GOOD.replace("identification", "weight")
    + """[[log]]
name = "empty"
file = "b.csv"
role = "validation"
[log.channels]
time = "Time"
hand_roll.q = "q"
hand_roll.i = "Current"
"""
)


def test_a_weight_log_without_a_weight_is_named_with_what_to_write(tmp_path):
    made = read(tmp_path, GOOD.replace("identification", "weight"))
    [remark] = made.remarks
    assert remark.startswith(f"{tmp_path / 'study.toml'}:6: log 'a' has the role weight, but ")
    assert "write weight = { mass = <kg, if known> } for a mass at the tip, " in remark
    for weight in ("weight = {}", "weight = { mass = 0.2 }", HANGS):
        assert not read(tmp_path, GOOD.replace('"identification"', f'"weight"\n{weight}')).remarks


@pytest.mark.parametrize(
    ("constants", "warns"),
    [("torque_constant = 1.9", True), ("torque_constant = 0.2", False),
     ("torque_constant = 1.9\ngear_ratio = 1.0", False), ("torque_constant = 1.9\ngear_ratio = 200.0", False),
     ("gear_ratio = 2000.0", False)],
)  # fmt: skip
def test_a_constant_of_the_joint_that_is_geared_again_is_remarked_on(tmp_path, constants, warns):
    made = read(tmp_path, f"{GOOD}[robot_overrides.hand_roll]\n{constants}\n")
    lines = [
        f"{tmp_path / 'study.toml'}:14: 1 A of hand_roll counts as 380 N m: its torque_constant is 43 times the "
        "robot's, its gear_ratio still 200; if the constant is at the joint, write gear_ratio = 1.0, too"
    ]
    assert made.remarks == tuple(lines * warns)


HANGS = 'weight = { moves_with = "5", position = [0, 0.1, 0.2] }'


def hung(tmp_path, says: str):
    """A study with a weight log that says so, on line 8."""
    return read(tmp_path, HUNG.replace("contact = [[1, 2]]", says).replace("period = 10", "skip = 0"))


def test_a_mass_may_be_left_out_and_move_with_a_link_or_a_joint(tmp_path):
    [weighing] = hung(tmp_path, HANGS + '\ntare = "empty"').weighings.each
    assert (weighing.log, weighing.tare) == ("a", "empty")
    assert (weighing.weight.mass, weighing.weight.moves_with, weighing.weight.position) == (None, "5", (0.0, 0.1, 0.2))
    said = HANGS.replace("moves_with", "mass = 0.2, moves_with").replace('"5"', '"hand_pitch"')
    [weighing] = hung(tmp_path, said).weighings.each
    assert (weighing.weight.mass, weighing.weight.moves_with, weighing.tare) == (0.2, "hand_pitch", "")
    assert hung(tmp_path, "weight = { mass = 0.2 }").weighings.each[0].weight == AttachedMass("", None, 0.2)


@pytest.mark.parametrize(
    ("written", "says"),
    [
        (HANGS.replace('"5"', '"elbow"'), "8: log 'a'.weight: moves_with must be one of hand_roll, hand_pitch, "),
        ('weight = { moves_with = "5" }', "8: log 'a'.weight: position is missing"),
        ("weight = { position = [0, 0, 0] }", "8: log 'a'.weight: moves_with is missing"),
        (
            "weight = { masss = 1 }",
            "unknown key 'masss'; known keys are mass, moves_with, position; did you mean 'mass'?",
        ),
        (HANGS.replace("0.2]", "200]"), "8: log 'a'.weight: each coordinate of position must lie within 3 m, not "),
        (HANGS.replace("0.2]", "0.2], mass = -1"), "8: log 'a'.weight: mass must be finite and greater than 0, not -1"),
        ('weight = { tare = "b" }', "8: log 'a'.weight: write tare = 'b' on a line of its own, below weight"),
        (
            HANGS.replace("0.2]", "0.2], masss = 1"),
            "unknown key 'masss'; known keys are mass, moves_with, position",
        ),
        (HANGS + '\ntare = "b"', "9: log 'a': tare = 'b' is not a log of this study; its logs are a, empty"),
        (HANGS + '\ntare = "a"', "9: log 'a': its tare 'a' has role weight; a tare must be free motion along the "),
        (HANGS + "\ntare = 3", "9: log 'a': tare must be text, not 3"),
    ],
)
def test_what_is_wrong_with_a_weight_is_said_with_its_line(tmp_path, written, says):
    with pytest.raises(BadStudy) as caught:
        hung(tmp_path, written)
    assert says in str(caught.value)


def test_only_weight_logs_have_a_tare(tmp_path):
    with pytest.raises(BadStudy, match="log 'a': tare = 'a' is only for logs of role weight, but this log has role i"):
        read(tmp_path, GOOD.replace("contact = [[1, 2]]", 'tare = "a"'))
