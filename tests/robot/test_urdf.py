"""URDF: what is written reads back as the same arm, what others wrote means what it says, what is wrong is said."""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from davinci_forces import robots
from davinci_forces.errors import BadRobot
from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.mechanics import kinematics, rigid_body
from davinci_forces.maths.mechanics.placed import roll_pitch_yaw, transform
from davinci_forces.robots.davinci import ROBOT as DAVINCI
from davinci_forces.robots.urdf import reading, tables, writing
from davinci_forces.stages.tip import resolve
from davinci_forces.study import LogEntry
from davinci_forces.toml import TomlFile

POSES = 50
LINK = """<link name="{name}"><inertial><origin xyz="{centre}" rpy="0.3 -0.2 0.5"/><mass value="{mass}"/>
<inertia ixx="0.03" ixy="0.001" ixz="-0.002" iyy="0.02" iyz="0.003" izz="0.025"/></inertial></link>"""
JOINT = """<joint name="{name}" type="{kind}"><parent link="{on}"/><child link="{link}"/>
<origin xyz="{at}" rpy="{rpy}"/><axis xyz="{axis}"/>{more}</joint>"""
LIMIT = '<limit lower="-2" upper="2" velocity="3" effort="40"/>'
# Two fingers that share a coordinate against each other and from another start, weights fixed to links, and axes that
# point anywhere.
GRIPPER = f"""<robot name="gripper"><link name="base"/>
{LINK.format(name="upper", mass=2.0, centre="0 0.1 0.2")}{LINK.format(name="sensor", mass=0.3, centre="0.01 0 0.02")}
{LINK.format(name="fore", mass=1.0, centre="0.2 0 0")}{LINK.format(name="left", mass=0.2, centre="0.05 0 0")}
{LINK.format(name="right", mass=0.2, centre="0.05 0 0")}{LINK.format(name="ballast", mass=9.0, centre="1 1 1")}
{
    JOINT.format(
        name="Turn 1",
        kind="revolute",
        on="base",
        link="upper",
        at="0 0 0.3",
        rpy="0.1 0.2 0.3",
        axis="1 2 -0.5",
        more=LIMIT,
    )
}
{JOINT.format(name="a", kind="fixed", on="upper", link="sensor", at="0.1 0 0.2", rpy="1 0 0.4", axis="1 0 0", more="")}
{
    JOINT.format(
        name="b",
        kind="prismatic",
        on="sensor",
        link="fore",
        at="0 0 0.1",
        rpy="0 1.5707963267948966 0",
        axis="0 -1 0",
        more=LIMIT,
    )
}
{JOINT.format(name="c", kind="continuous", on="fore", link="left", at="0.4 0.02 0", rpy="0 0 0", axis="0 0 1", more="")}
{
    JOINT.format(
        name="d",
        kind="revolute",
        on="fore",
        link="right",
        at="0.4 -0.02 0",
        rpy="0 0 0",
        axis="0 1 1",
        more='<mimic joint="c" multiplier="-1" offset="0.25"/>' + LIMIT,
    )
}
{JOINT.format(name="e", kind="fixed", on="base", link="ballast", at="0 0 0", rpy="0 0 0", axis="1 0 0", more="")}
</robot>"""


def parsed(text: str):
    """The robot of a text, and what is wrong with it."""
    file = TomlFile("arm.urdf", {})
    return reading.robot_of(tables.parse(text.encode(), "arm.urdf"), file, "arm"), file.problems()


def robot(text: str):
    made, problems = parsed(text)
    assert problems == []
    return made


def motions(n: int):
    return np.random.default_rng(n).uniform(-1.5, 1.5, (3, POSES, n))


def same_dynamics(one, other, n: int, tolerance: float) -> None:
    q, dq, _ = motions(n)
    for made, expected in (
        (rigid_body.mass_matrix(one.chain, one.bodies, q), rigid_body.mass_matrix(other.chain, other.bodies, q)),
        (rigid_body.coriolis(one.chain, one.bodies, q, dq), rigid_body.coriolis(other.chain, other.bodies, q, dq)),
        (rigid_body.gravity(one.chain, one.bodies, q), rigid_body.gravity(other.chain, other.bodies, q)),
    ):
        assert abs(expected).max() > 0.01
        assert_allclose(made, expected, rtol=0, atol=tolerance)


@pytest.fixture
def ur10e(data) -> str:
    return (data / "ur10e" / "ur10e.urdf").read_text()


def test_the_davinci_written_and_read_has_the_same_dynamics():
    back = robot(writing.text(DAVINCI))
    assert back.coordinates == DAVINCI.coordinates
    same_dynamics(back, DAVINCI, DAVINCI.chain.n, 1e-12)


def test_an_arm_with_fixed_weights_and_shared_coordinates_written_and_read_has_the_same_dynamics():
    arm = robot(GRIPPER)
    same_dynamics(robot(writing.text(arm)), arm, 3, 1e-12)


def test_a_real_arm_written_and_read_has_the_same_dynamics(ur10e):
    arm = robot(ur10e)
    same_dynamics(robot(writing.text(arm)), arm, 6, 1e-12)


@pytest.mark.parametrize("name", robots.ROBOTS)
def test_what_is_written_keeps_the_tip_the_names_and_the_limits(name):
    arm = robots.load(name, Path())
    back = robot(writing.text(arm))
    q = motions(arm.chain.n)[0]
    assert_allclose(kinematics.tip(back.chain, q), kinematics.tip(arm.chain, q), rtol=0, atol=1e-14)
    assert back.coordinates == arm.coordinates
    assert [j.limits.q for j in back.joints[:3]] == [j.limits.q for j in arm.joints]
    assert [j.limits.dq for j in back.joints[:3]] == [j.limits.dq for j in arm.joints]
    assert (back.bodies is None) == (arm.bodies is None)


@pytest.mark.parametrize("arm", [DAVINCI, robot(GRIPPER)], ids=["davinci", "gripper"])
def test_writing_what_was_read_adds_no_frames(arm):
    once = robot(writing.text(arm))
    assert set(robot(writing.text(once)).chain.names) == set(once.chain.names)
    assert set(once.chain.names) >= set(arm.chain.names)


def forward(text: str, q: dict[str, float]) -> dict[str, np.ndarray]:
    """The pose of every link, from the elements as they stand: rotations by Rodrigues' formula."""
    root = ElementTree.fromstring(text)
    T = {"base": np.eye(4)}
    for joint in root.findall("joint"):  # in these files after those that carry them
        origin, axis = joint.find("origin"), np.array([*map(float, joint.find("axis").get("xyz").split())])
        x, y, z = map(float, origin.get("rpy").split())
        at = np.eye(4)
        at[:3, :3] = rotation([0, 0, 1], z) @ rotation([0, 1, 0], y) @ rotation([1, 0, 0], x)
        at[:3, 3] = [*map(float, origin.get("xyz").split())]
        mimic, value, moved = joint.find("mimic"), q.get(joint.get("name"), 0.0), np.eye(4)
        if mimic is not None:
            value = float(mimic.get("multiplier")) * q[mimic.get("joint")] + float(mimic.get("offset"))
        axis /= np.linalg.norm(axis)
        if joint.get("type") == "prismatic":
            moved[:3, 3] = value * axis
        elif joint.get("type") != "fixed":
            moved[:3, :3] = rotation(axis, value)
        T[joint.find("child").get("link")] = T[joint.find("parent").get("link")] @ at @ moved
    return T


def rotation(axis, angle: float) -> np.ndarray:
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], float)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def test_every_frame_is_where_the_file_says():
    arm = robot(GRIPPER)
    assert arm.coordinates == ("turn_1", "b", "c")
    for q in motions(3)[0]:
        expected = forward(GRIPPER, dict(zip(("Turn 1", "b", "c"), q, strict=True)))
        for name, T in zip(arm.chain.names, kinematics.frames(arm.chain, q), strict=True):
            assert_allclose(T, expected[name], rtol=0, atol=1e-14)


def test_gravity_is_the_slope_of_the_energy_of_every_link_of_the_file():
    """Of those that are fixed to others, too; what is fixed to the base does not matter."""
    arm, root, h = robot(GRIPPER), ElementTree.fromstring(GRIPPER), 1e-6

    def energy(q):
        T = forward(GRIPPER, dict(zip(("Turn 1", "b", "c"), q, strict=True)))
        total = 0.0
        for link in root.findall("link"):
            if (inertial := link.find("inertial")) is not None:
                centre = [*map(float, inertial.find("origin").get("xyz").split()), 1.0]
                total += float(inertial.find("mass").get("value")) * GRAVITY * (T[link.get("name")] @ centre)[2]
        return total

    for q in motions(3)[0]:
        slope = [(energy(q + step) - energy(q - step)) / (2 * h) for step in h * np.eye(3)]
        # Energies of 100 J round at 1e-14, over h.
        assert_allclose(rigid_body.gravity(arm.chain, arm.bodies, q), slope, rtol=0, atol=1e-7)


@pytest.mark.parametrize("pitch", [0.3, np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, np.pi / 2 + 1e-12])
def test_angles_make_the_rotation_that_they_were_told_from_at_gimbal_lock_too(pitch):
    for roll, yaw in np.random.default_rng(0).uniform(-3, 3, (20, 2)):
        R = transform([0, 0, 0], [roll, pitch, yaw])[:3, :3]
        assert_allclose(transform([0, 0, 0], roll_pitch_yaw(R))[:3, :3], R, rtol=0, atol=1e-15)


def test_limits_kinds_and_terms_are_what_the_file_says():
    turn, slide, finger = robot(GRIPPER).joints
    assert turn.limits.q == (-2, 2)
    assert turn.limits.dq == (-3, 3)
    assert turn.limits.effort == 40
    assert [joint.kind.value for joint in (turn, slide, finger)] == ["revolute", "prismatic", "revolute"]
    assert finger.limits.q == (-np.inf, np.inf)
    friction = ["viscous friction", "Coulomb friction", "offset"]
    assert [term.name for term in slide.terms] == ["inertia", *friction]
    assert [term.name for term in turn.terms] == ["inertia", "gravity, sine", "gravity, cosine", *friction]


def test_a_joint_that_turns_about_a_vertical_axis_has_no_gravity_in_its_model(ur10e):
    gravity = [any("gravity" in term.name for term in joint.terms) for joint in robot(ur10e).joints]
    assert gravity == [False, *[True] * 5]


def test_an_arm_of_forty_joints_is_read():
    links = "".join(LINK.format(name=f"l{i}", mass=1.0, centre="0.1 0 0") for i in range(41))
    joints = "".join(
        JOINT.format(
            name=f"j{i}",
            kind="revolute",
            on=f"l{i}",
            link=f"l{i + 1}",
            at="0.1 0 0",
            rpy="1 0 0",
            axis="0 0 1",
            more="",
        )
        for i in range(40)
    )
    arm = robot(f"<robot>{joints}{links}</robot>")
    assert arm.coordinates == tuple(f"j{i}" for i in range(40))
    assert arm.chain.tip == "l40"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('type="prismatic"', 'type="planar"', "arm.urdf:15: <joint name='b'>: type is 'planar', but must be revolute"),
        ('<mass value="0.3"/>', '<mass value="-0.3"/>', "arm.urdf:3: <link name='sensor'> <mass>: the mass is -0.3 kg"),
        ('<mass value="0.3"/>', "", "<link name='sensor'> <inertial>: its inertial has no mass; write <mass"),
        ('ixx="0.03"', 'ixx="-0.03"', "arm.urdf:3: <link name='upper'> <inertia>: the smallest principal moment"),
        (
            'xyz="1 2 -0.5"',
            'xyz="0 0 0"',
            "<joint name='Turn 1'> <axis>: xyz is 0 0 0, but an axis needs a direction",
        ),
        ('xyz="1 2 -0.5"', 'xyz="1 2"', "xyz must be 3 finite numbers with spaces between them, not '1 2'"),
        ('xyz="1 2 -0.5"', 'xyz="1 nan 2"', "xyz must be 3 finite numbers with spaces between them, not '1 nan 2'"),
        ('lower="-2"', 'lower="2"', "<joint name='Turn 1'> <limit>: lower is 2 and upper is 2, but lower must"),
        ('effort="40"', 'effort="-4"', "<joint name='Turn 1'> <limit>: effort is -4, but must be 0 or more"),
        ('<parent link="fore"/>', '<parent link="for"/>', "<joint name='c'> <parent>: there is no <link name='for'>"),
        (
            '<child link="right"/>',
            '<child link="left"/>',
            "link 'left' already has the parent joint 'c'; cut the loop",
        ),
        ('joint="c"', 'joint="z"', "<joint name='d'> <mimic>: there is no joint 'z'; correct the name"),
        ('joint="c"', 'joint="d"', "<joint name='d'> <mimic>: d mimics d: one of them must move by itself"),
        ('joint="c"', 'joint="a"', "<joint name='d'> <mimic>: joint 'a' is fixed; name a joint that moves"),
        ('multiplier="-1"', 'multiplier="0.5"', "multiplier is 0.5, but must be 1 or -1, as links"),
        ('name="Turn 1"', 'name="B"', "are both 'b' in lower case, which files are named by; rename one of them"),
        ('name="Turn 1"', 'name="con"', "<joint name='con'>: 'con' is reserved on Windows"),
        ('name="Turn 1"', 'name="a&quot;b"', "its name is 'a\"b', but may have only letters, digits, spaces"),
        ('<link name="base"/>', '<link name="base"/><link name="left"/>', "has the same name; rename one of them"),
        ('<link name="base"/>', '<link name="base"/><link name="x"/>', "links 'base', 'x' have no parent"),
        ('<link name="base"/>', '<link name="base"/><xacro:macro name="x"/>', "a xacro macro; run xacro first"),
        ('<robot name="gripper">', '<sdf name="gripper">', "a URDF must consist of one <robot name=...>"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_with_its_element_its_line_and_a_remedy(old, new, says):
    text = GRIPPER.replace(old, new, 1)
    assert text != GRIPPER
    if "sdf" in new:
        text = text.replace("</robot>", "</sdf>")
    made, problems = parsed(text)
    assert made is None
    assert says in "\n".join(problems)


def test_a_base_turned_in_the_study_is_a_base_turned_in_the_file():
    """Efforts are those of the same arm on a joint that turns it, up to the axes of the base."""
    rpy = (0.7, -0.4, 1.1)
    on_slope = JOINT.format(
        name="s", kind="fixed", on="world", link="base", at="0 0 0", rpy="0.7 -0.4 1.1", axis="0 0 1", more=""
    )
    turned = robot(GRIPPER.replace('<link name="base"/>', f'<link name="world"/><link name="base"/>{on_slope}'))
    stated = robot(GRIPPER).with_base(rpy)
    same_dynamics(turned, stated, 3, 1e-12)
    upright, (q, dq, ddq) = robot(GRIPPER), motions(3)
    assert abs(upright_effort(upright, q) - upright_effort(stated, q)).max() > 1.0
    many = np.tile(q[:10], (2001, 1)), np.tile(dq[:10], (2001, 1)), np.tile(ddq[:10], (2001, 1))  # compiled
    few = rigid_body.inverse_dynamics(stated.chain, stated.bodies, q[:10], dq[:10], ddq[:10])
    assert_allclose(rigid_body.inverse_dynamics(stated.chain, stated.bodies, *many)[:10], few, rtol=0, atol=1e-12)
    R = transform((0, 0, 0), rpy)[:3, :3]
    assert_allclose(kinematics.tip(turned.chain, q), kinematics.tip(stated.chain, q) @ R.T, rtol=0, atol=1e-12)


def upright_effort(arm, q):
    return rigid_body.gravity(arm.chain, arm.bodies, q)


def test_a_joint_has_the_gravity_terms_that_its_base_gives_it():
    """A gantry of a slide and a turn about the vertical has no gravity upright, and all of it on a wall."""
    arm = f"""<robot name="gantry"><link name="base"/>{LINK.format(name="a", mass=2.0, centre="0.1 0 0.2")}
    {LINK.format(name="b", mass=1.0, centre="0.1 0 0.2")}
    {JOINT.format(name="slide", kind="prismatic", on="base", link="a", at="0 0 0", rpy="0 0 0", axis="1 0 0", more="")}
    {JOINT.format(name="turn", kind="continuous", on="a", link="b", at="0 0 0", rpy="0 0 0", axis="0 0 1", more="")}
    </robot>"""
    upright, wall = robot(arm), robot(arm).with_base((0.0, np.pi / 2, 0.0))
    names = [[term.name for term in joint.terms] for joint in (*upright.joints, *wall.joints)]
    assert not any("gravity" in name for name in names[0] + names[1])
    assert "offset" in names[2]
    assert {"gravity, sine", "gravity, cosine"} <= set(names[3])


def test_limits_of_nothing_but_zeros_and_noise_for_an_inertia_are_none():
    """As several public descriptions have them: `lower="0" upper="0"`, and products of 1e-35 with no moments."""
    zeros = robot(GRIPPER.replace('lower="-2" upper="2" velocity="3" effort="40"', 'lower="0" upper="0"', 1))
    assert zeros.joints[0].limits.q == (-np.inf, np.inf)
    noise = GRIPPER.replace('ixx="0.03" ixy="0.001" ixz="-0.002" iyy="0.02" iyz="0.003" izz="0.025"', 'ixz="2e-35"', 1)
    assert robot(noise).bodies is not None


@pytest.mark.parametrize("axis", ["0 0 0", "0 0", "nan 0 0", "1e400 0 0"])
def test_the_axis_of_a_fixed_joint_is_ignored_whatever_it_says(axis):
    start = GRIPPER.index('<joint name="a"')
    text = GRIPPER[:start] + GRIPPER[start:].replace('xyz="1 0 0"', f'xyz="{axis}"', 1)
    assert text != GRIPPER
    arm, plain = robot(text), robot(GRIPPER)
    assert np.array_equal(arm.chain.placement, plain.chain.placement)
    assert np.array_equal(arm.bodies.masses, plain.bodies.masses)


def test_every_problem_of_a_file_is_in_one_message(tmp_path):
    broken = GRIPPER.replace('value="0.3"', 'value="x"').replace('joint="c"', 'joint="z"').replace("1 2 -0.5", "0 0 0")
    (tmp_path / "arm.urdf").write_text(broken)
    with pytest.raises(BadRobot) as caught:
        robots.load("arm.urdf", tmp_path)
    said = str(caught.value).splitlines()
    assert len(said) == 3
    assert all(line.startswith(f"{tmp_path / 'arm.urdf'}:") for line in said)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><robot name="&b;"/>',
            "arm.urdf:1: a URDF",
        ),
        ('<!DOCTYPE r SYSTEM "file:///etc/passwd"><robot/>', "needs no document type; delete <!DOCTYPE ...>"),
        ("<robot>\n<link></robot>", "arm.urdf:2: not XML: mismatched tag"),
        ("<robot>\n<xacro:a></robot>", "run xacro first, and name the .urdf that it writes"),
        ("", "not XML: no element found"),
        ('<?xml version="1.0" encoding="klingon"?><robot/>', "not XML: "),
        ("<robot/>", "it has no <link>"),
        ('<robot><link name="a"/></robot>', "no joint moves; at least one must be revolute or continuous or prismatic"),
    ],
)
def test_what_is_no_description_of_a_robot_is_refused(tmp_path, text, says):
    (tmp_path / "arm.urdf").write_text(text)
    with pytest.raises(BadRobot) as caught:
        robots.load("arm.urdf", tmp_path)
    assert says in str(caught.value)


def test_a_file_of_many_megabytes_is_refused_unread(tmp_path):
    (tmp_path / "arm.urdf").write_text(" " * (tables.MAX_BYTES + 1))
    with pytest.raises(BadRobot, match=r"arm\.urdf: it has 4\.0 MB, more than the 4 MB that are read"):
        robots.load("arm.urdf", tmp_path)


def test_a_file_that_is_not_there_is_said(tmp_path):
    with pytest.raises(BadRobot, match=r"arm\.urdf: there is no such robot file"):
        robots.load("arm.urdf", tmp_path)


def test_a_description_as_deep_as_it_is_long_is_refused():
    with pytest.raises(BadRobot, match=r"arm\.urdf:1: it has more than 30 nested elements"):
        parsed("<robot>" + "<link>" * 50_000 + "</link>" * 50_000 + "</robot>")


@given(data=st.data())
def test_no_description_however_odd_ends_in_anything_but_a_robot_or_problems(data):
    """Any attribute of a good one replaced by anything, any element left out."""
    root = ElementTree.fromstring(GRIPPER)
    every = [*root.iter()]
    holder = data.draw(st.sampled_from([element for element in every if len(element)]))
    if data.draw(st.booleans()):
        holder.remove(data.draw(st.sampled_from([*holder])))
    element = data.draw(st.sampled_from([element for element in every if element.attrib]))
    key = data.draw(st.sampled_from(sorted(element.attrib)))
    odd = st.text(st.characters(min_codepoint=32, max_codepoint=0x2FF), max_size=8)
    value = data.draw(odd | st.sampled_from(["1e400", "1e200 0 1e200", "-1", "left", "base", "0 0 0", "c", "fixed"]))
    element.set(key, value)
    text = ElementTree.tostring(root, encoding="unicode")
    with np.errstate(all="ignore"):
        made, problems = parsed(text)
    assert problems or made.joints


def test_of_an_arm_of_more_than_three_joints_no_force_at_the_tip_is_made_up():
    """The chain would be taken to stand still beyond the third."""
    arm = replace(DAVINCI, joints=robot(writing.text(DAVINCI)).joints)
    touched = LogEntry(name="touch", files=("a.csv",), role="contact", channels=())
    [said] = resolve.apply([], [], [], touched, arm)
    assert (
        "touch: no force at the tip: davinci has 7 joints, and the efforts of more than 3 also hold a moment"
        in said.text[0]
    )
