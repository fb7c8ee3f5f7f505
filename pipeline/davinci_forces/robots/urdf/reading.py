"""Read a robot from its URDF: chain, inertias, limits and joints that mimic others.

A URDF states no gear ratio or torque constant.  If logs have motor currents instead of efforts in N m or N, the study
states gear_ratio and torque_constant, or effort = "A", in [robot_overrides.<joint>].
"""

import heapq
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.bodies import as_bodies
from davinci_forces.maths.mechanics.chain import FIXED, ChainFrame, chain_of
from davinci_forces.maths.mechanics.placed import placed_frame
from davinci_forces.maths.mechanics.rigid_body import loaded_by_gravity
from davinci_forces.maths.models.terms import Term, coulomb, gravity_cos, gravity_sin, inertia, offset, viscous
from davinci_forces.robots.from_toml import wrong_name
from davinci_forces.robots.robot import ANYWHERE, MOST_JOINTS, Joint, Kind, Limits, Robot
from davinci_forces.robots.urdf import tables
from davinci_forces.robots.urdf.tables import MOVING, TIP, Element, Notes, UrdfJoint, inertial_parameters, read_joint
from davinci_forces.toml import TomlFile

DEFAULT_HARMONICS = 10  # of an unknown excitation: more than most excitations have, and too few to fit noise
TIPS = (TIP, "tcp", "tool0", "ee_link")  # customary names of the frame at the tip
FRICTION = (viscous, coulomb, offset)


class Mover(NamedTuple):
    """A joint's position: sign times the position of joint `by`, plus a bias; `by` is "" if the joint does not move."""

    by: str
    sign: int = 1
    bias: float = 0.0


def read_with_problems(file: Path) -> tuple[Robot | None, TomlFile]:
    """Read a robot, None if its file has problems, and the file; raises BadRobot if it is not XML."""
    notes = TomlFile(str(file), {})
    return robot_of(tables.read(file), notes, file.stem), notes


def robot_of(outermost: Element, file: TomlFile, stem: str) -> Robot | None:
    """Build the robot of a <robot> element, with problems noted; None if there are any."""
    if outermost.tag != "robot":
        Notes(file, outermost).problem("a URDF must consist of one <robot name=...> with <link> and <joint> in it")
        return None
    for macro in (element for element in outermost.inner if element.tag.startswith("xacro:")):
        Notes(file, macro).problem("this is a xacro macro; run xacro first, and name the .urdf that it writes")
    links = _named(outermost.children("link"), file)
    weights = {name: inertial_parameters(link, file) for name, link in links.items()}
    _named(outermost.children("joint"), file)
    joints = [read_joint(element, file) for element in outermost.children("joint")]
    root = _root(outermost, links, joints, file)
    by_name = {joint.name: joint for joint in joints}
    moved = {joint.name: _mover(joint, by_name, file) for joint in joints}
    ordered = _outwards(root, joints)
    coordinates = _coordinates(ordered, file)
    if (moving := sum(joint.kind != "fixed" for joint in joints)) > MOST_JOINTS:
        excess = f"it has {moving} moving joints, more than the {MOST_JOINTS} allowed"
        Notes(file, outermost).problem(f'{excess}; write type="fixed" for those that do not matter')
    if not coordinates:
        Notes(file, outermost).problem(f"no joint moves; at least one must be {' or '.join(MOVING)}")
    if file.problems():
        return None
    frames = _frames(root, ordered, moved, list(coordinates), weights)
    chain, parameters = chain_of(root, frames, _tip(root, ordered))
    known_bodies = as_bodies(parameters) if any(link.child("inertial") for link in links.values()) else None
    name = outermost.attributes.get("name", "") or stem
    robot_joints = tuple(
        _joint(by_name[joint], called, moves)
        for (joint, called), moves in zip(coordinates.items(), loaded_by_gravity(chain), strict=True)
    )
    return Robot(name, name, robot_joints, chain, known_bodies)


def _named(elements: Sequence[Element], file: TomlFile) -> dict[str, Element]:
    """The elements by name; missing, invalid and repeated names are noted."""
    by_name = dict[str, Element]()
    for element in elements:
        notes = Notes(file, element)
        name = notes.name(element, "name", "its name")
        if name in by_name:
            notes.problem(f"the element in line {by_name[name].line} has the same name; rename one of them")
        by_name.setdefault(name, element)
    return by_name


def _root(outermost: Element, links: dict[str, Element], joints: Sequence[UrdfJoint], file: TomlFile) -> str:
    """The only link without a parent; "" if there is none or several, which is noted."""
    parent_joints = dict[str, UrdfJoint]()
    for joint in joints:
        called = f"<joint name={joint.name!r}>"
        for end, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                missing = f"there is no <link name={link!r}>; add it, or correct the name"
                file.note(joint.line, f"{called} <{end}>: {missing}")
        if joint.child in parent_joints:
            parent = parent_joints[joint.child].name
            loop = f"link {joint.child!r} already has the parent joint {parent!r}; cut the loop"
            file.note(joint.line, f"{called}: {loop}")
        parent_joints.setdefault(joint.child, joint)
    bases = [name for name in links if name not in parent_joints]
    notes = Notes(file, outermost)
    if not links:
        notes.problem("it has no <link>")
    elif not bases:
        notes.problem("every link is the child of another, in a loop; one must be the base")
    elif len(bases) > 1:
        remedy = "one must be the base, so add joints to the others"
        notes.problem(f"links {', '.join(map(repr, bases))} have no parent; {remedy}")
    elif not file.problems() and len(_outwards(bases[0], joints)) + 1 < len(links):
        notes.problem(f"some links form a loop that is not connected to the base {bases[0]!r}; cut the loop")
    return bases[0] if len(bases) == 1 else ""


def _outwards(root: str, joints: Sequence[UrdfJoint]) -> list[UrdfJoint]:
    """The joints connected to the base, parents first, otherwise in the order of the file."""
    by_parent = dict[str, list[int]]()
    for number, joint in enumerate(joints):
        by_parent.setdefault(joint.parent, []).append(number)
    ordered, queue = list[UrdfJoint](), by_parent.pop(root, [])
    while queue:
        ordered.append(joints[heapq.heappop(queue)])
        for number in by_parent.pop(ordered[-1].child, []):
            heapq.heappush(queue, number)
    return ordered


def _coordinates(ordered: Sequence[UrdfJoint], file: TomlFile) -> dict[str, str]:
    """The independent joints from the base outwards, each with its name in logs and records."""
    called = dict[str, str]()
    for joint in (joint for joint in ordered if joint.kind != "fixed" and not joint.mimic):
        name = re.sub(r"[^a-z0-9_-]", "_", joint.name.lower())
        if wrong := wrong_name(name):
            file.note(joint.line, f"<joint name={joint.name!r}>: {wrong}")
        for namesake in (namesake for namesake, taken in called.items() if taken == name):
            clash = f"it and joint {namesake!r} are both {name!r} in lower case, which files are named by"
            file.note(joint.line, f"<joint name={joint.name!r}>: {clash}; rename one of them")
        called[joint.name] = name
    return called


def _frames(
    root: str, ordered: Sequence[UrdfJoint], moved: dict[str, Mover], coordinates: list[str], weights: dict[str, Array]
) -> list[ChainFrame]:
    indices = {name: i for i, name in enumerate([root, *(joint.child for joint in ordered)])}
    frames = list[ChainFrame]()
    for joint in ordered:
        by, place = moved[joint.name], (indices[joint.parent], joint.placement, joint.axis)
        coordinate, slides = coordinates.index(by.by) if by.by else FIXED, joint.kind == "prismatic"
        frames.append(placed_frame(joint.child, *place, coordinate, by.sign, by.bias, slides, weights[joint.child]))
    return frames


def _tip(root: str, ordered: Sequence[UrdfJoint]) -> str:
    """The tip: a frame with a customary name, else the first end link with the most moving joints before it."""
    depth = {root: 0}
    for joint in ordered:
        depth[joint.child] = depth[joint.parent] + (joint.kind != "fixed")
    outermost = [link for link in depth if depth[link] == max(depth.values())]
    ends = [link for link in outermost if link not in {joint.parent for joint in ordered}]
    return next((name for name in TIPS if name in depth), (ends or outermost)[0])


def _joint(joint: UrdfJoint, name: str, has_gravity: bool) -> Joint:
    kind = Kind.PRISMATIC if joint.kind == "prismatic" else Kind.REVOLUTE
    turning: tuple[Term, ...] = (gravity_sin, gravity_cos) if has_gravity and kind is Kind.REVOLUTE else ()
    rates = (-joint.velocity, joint.velocity) if math.isfinite(joint.velocity) else ANYWHERE
    limits = Limits(joint.position, rates, ANYWHERE, joint.effort)
    return Joint(name, joint.name, kind, (inertia, *turning, *FRICTION), limits, harmonics=DEFAULT_HARMONICS)


def _mover(joint: UrdfJoint, joints: Mapping[str, UrdfJoint], file: TomlFile) -> Mover:
    """Follow <mimic> from a joint to the independent joint that moves it; problems of <mimic> are noted."""
    sign, bias, visited, driver = 1.0, 0.0, [joint.name], joint
    while driver.kind != "fixed" and driver.mimic:
        sign, bias = sign * driver.multiplier, bias + sign * driver.bias
        following = joints.get(driver.mimic)
        wrong = _wrong(driver, following, visited)
        if wrong:
            if driver is joint:
                file.note(driver.line, f"<joint name={driver.name!r}> <mimic>: {wrong}")
            return Mover("")
        assert following is not None
        driver = following
        visited.append(driver.name)
    return Mover("" if driver.kind == "fixed" or not sign else driver.name, 1 if sign >= 0 else -1, bias)


def _wrong(joint: UrdfJoint, following: UrdfJoint | None, visited: list[str]) -> str:
    """The problem of a joint's <mimic>, or ""."""
    if following is None:
        return f"there is no joint {joint.mimic!r}; correct the name"
    if following.name in visited:
        return f"{' mimics '.join([*visited, following.name])}: one of them must move by itself"
    if following.kind == "fixed":
        return f"joint {joint.mimic!r} is fixed; name a joint that moves, or make this one fixed, too"
    if joint.multiplier not in (-1.0, 0.0, 1.0):
        wrong = f"multiplier is {joint.multiplier:g}, but must be 1 or -1, as links that share a coordinate move by it"
        return f'{wrong}; if it carries little mass, write type="fixed" without mimic, or make it an independent joint'
    return ""
