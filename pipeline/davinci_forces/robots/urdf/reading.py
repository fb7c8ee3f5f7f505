"""A robot from its URDF: chain, inertias, limits and joints that mimic others.

Logs need nothing but the effort at each joint, in N m or N; what turns a current into it is not in such a file, so a
study says it in [robot_overrides.<joint>]: gear_ratio and torque_constant, or effort = "A".
"""

import heapq
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.bodies import PARAMETERS
from davinci_forces.maths.mechanics.chain import FIXED, Chain
from davinci_forces.maths.mechanics.placed import PlacedLink, assembled
from davinci_forces.maths.mechanics.rigid_body import regressor
from davinci_forces.maths.models.terms import Term, coulomb, gravity_cos, gravity_sin, inertia, offset, viscous
from davinci_forces.robots.robot import ANYWHERE, MOST_JOINTS, Joint, Kind, Limits, Robot
from davinci_forces.robots.urdf import tables
from davinci_forces.robots.urdf.tables import MOVING, TIP, Element, Notes, UrdfJoint, inertial, joint
from davinci_forces.toml.file import TomlFile

HARMONICS = 10  # of an excitation that nobody has described: more than most have, and below most noise
TIPS = (TIP, "tcp", "tool0", "ee_link")  # what the frame at the tip is called, as far as there is a custom
POSES = 20  # random ones, at which a joint that feels gravity does so
FRICTION = (viscous, coulomb, offset)


class Mover(NamedTuple):
    """A joint at sign times the position of the joint `by`, plus a bias; `by` is "" of one that does not move."""

    by: str
    sign: int = 1
    bias: float = 0.0


def described(file: Path) -> tuple[Robot | None, TomlFile]:
    """A robot, None where it cannot be told which joints it has, and the problems of its file; raises BadRobot where
    that is not XML.
    """
    notes = TomlFile(str(file), {})
    return robot_of(tables.read(file), notes, file.stem), notes


def robot_of(outermost: Element, file: TomlFile, stem: str) -> Robot | None:
    """The robot that a <robot> describes, its problems noted; None where there are any."""
    if outermost.tag != "robot":
        Notes(file, outermost).problem("a URDF is one <robot name=...> with <link> and <joint> in it")
        return None
    for macro in (element for element in outermost.inner if element.tag.startswith("xacro:")):
        Notes(file, macro).problem("a macro; run xacro first, and name the .urdf that it writes")
    links = _named(outermost.all("link"), file)
    weights = {name: inertial(link, file) for name, link in links.items()}
    _named(outermost.all("joint"), file)
    joints = [joint(element, file) for element in outermost.all("joint")]
    root = _root(outermost, links, joints, file)
    by_name = {one.name: one for one in joints}
    moved = {one.name: _mover(one, by_name, file) for one in joints}
    ordered = _outwards(root, joints)
    coordinates = _coordinates(ordered, file)
    if (moving := sum(one.kind != "fixed" for one in joints)) > MOST_JOINTS:
        said = f"it has {moving} joints that move, and may have {MOST_JOINTS}"
        Notes(file, outermost).problem(f'{said}; write type="fixed" for those that do not matter')
    if not coordinates:
        Notes(file, outermost).problem(f"no joint moves; one must be {', '.join(MOVING)}")
    if file.problems():
        return None
    chain, bodies = assembled(root, _placed(root, ordered, moved, list(coordinates), weights), _tip(root, ordered))
    weighed = bodies if any(weight is not None for weight in weights.values()) else None
    own = [by_name[name] for name in coordinates]
    name = outermost.attributes.get("name", "") or stem
    feels = _feel_gravity(chain)
    made = (_joint(*each) for each in zip(own, coordinates.values(), feels, strict=True))
    return Robot(name, name, tuple(made), chain, weighed)


def _named(found: Sequence[Element], file: TomlFile) -> dict[str, Element]:
    """Elements by name, which no two share."""
    by_name = dict[str, Element]()
    for element in found:
        notes = Notes(file, element)
        name = notes.name(element, "name", "its name")
        if name in by_name:
            notes.problem(f"line {by_name[name].line} has another of this name; rename one of them")
        by_name.setdefault(name, element)
    return by_name


def _root(outermost: Element, links: dict[str, Element], joints: Sequence[UrdfJoint], file: TomlFile) -> str:
    """The link that nothing carries; "" where it cannot be told, which is noted."""
    carried = dict[str, UrdfJoint]()
    for one in joints:
        called = f"<joint name={one.name!r}>"
        for end, link in (("parent", one.parent), ("child", one.child)):
            if link not in links:
                file.note(one.line, f"{called} <{end}>: there is no <link name={link!r}>; add it, or correct the name")
        if one.child in carried:
            other = carried[one.child].name
            file.note(one.line, f"{called}: joint {other!r} carries link {one.child!r} already; a loop has to be cut")
        carried.setdefault(one.child, one)
    bases = [name for name in links if name not in carried]
    notes = Notes(file, outermost)
    if not links:
        notes.problem("it has no <link>")
    elif not bases:
        notes.problem("every link is carried by another, in a circle; one must be the base")
    elif len(bases) > 1:
        notes.problem(
            f"links {', '.join(map(repr, bases))} are carried by nothing; one must be the base, join the others"
        )
    elif not file.problems() and len(_outwards(bases[0], joints)) + 1 < len(links):
        notes.problem(f"some links hang on each other in a circle, and not on the base {bases[0]!r}; cut it")
    return bases[0] if len(bases) == 1 else ""


def _outwards(root: str, joints: Sequence[UrdfJoint]) -> list[UrdfJoint]:
    """The joints that hang on the base, each after the one that carries it, else in the order of the file."""
    on = dict[str, list[int]]()
    for number, one in enumerate(joints):
        on.setdefault(one.parent, []).append(number)
    ordered, ahead = list[UrdfJoint](), on.pop(root, [])
    while ahead:
        ordered.append(joints[heapq.heappop(ahead)])
        for number in on.pop(ordered[-1].child, []):
            heapq.heappush(ahead, number)
    return ordered


def _coordinates(ordered: Sequence[UrdfJoint], file: TomlFile) -> dict[str, str]:
    """The joints that move by themselves, outwards, and the names that logs and records call them by."""
    from davinci_forces.robots.from_toml import wrong_name

    called = dict[str, str]()
    for one in ordered:
        if one.kind == "fixed" or one.mimic:
            continue
        name = re.sub(r"[^a-z0-9_-]", "_", one.name.lower())
        if wrong := wrong_name(name):
            file.note(one.line, f"<joint name={one.name!r}>: {wrong}")
        for other in (other for other, taken in called.items() if taken == name):
            said = f"it and joint {other!r} are both called {name!r} in lower case, as files are named"
            file.note(one.line, f"<joint name={one.name!r}>: {said}; rename one of them")
        called[one.name] = name
    return called


def _placed(
    root: str, ordered: Sequence[UrdfJoint], moved: dict[str, Mover], coordinates: list[str],
    weights: dict[str, Array | None],
) -> list[PlacedLink]:  # fmt: skip
    frames, placed = {root: 0}, list[PlacedLink]()
    for one in ordered:
        by, weight = moved[one.name], weights[one.child]
        frames[one.child] = len(placed) + 1
        placed.append(
            PlacedLink(
                one.child, frames[one.parent], one.placement, one.axis,
                coordinate=coordinates.index(by.by) if by.by else FIXED, sign=by.sign, bias=by.bias,
                slides=one.kind == "prismatic", parameters=np.zeros(len(PARAMETERS)) if weight is None else weight,
            )
        )  # fmt: skip
    return placed


def _tip(root: str, ordered: Sequence[UrdfJoint]) -> str:
    """The frame at the tip: by its name, or else the first of those that the most joints carry."""
    depth = {root: 0}
    for one in ordered:
        depth[one.child] = depth[one.parent] + (one.kind != "fixed")
    outermost = [link for link in depth if depth[link] == max(depth.values())]
    ends = [link for link in outermost if link not in {one.parent for one in ordered}]
    return next((name for name in TIPS if name in depth), (ends or outermost)[0])


def _feel_gravity(chain: Chain) -> list[bool]:
    """Whether gravity asks anything of each coordinate in any pose: not where it turns about a vertical axis."""
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (POSES, chain.n))
    Y = regressor(chain, q, np.zeros_like(q), np.zeros_like(q))
    # Of lengths of metres, products of which round at 1e-15; files state angles to eleven digits.
    return [bool(x) for x in abs(Y).max(axis=(0, 2)) > 1e-6]


def _joint(own: UrdfJoint, name: str, feels_gravity: bool) -> Joint:
    kind = Kind.PRISMATIC if own.kind == "prismatic" else Kind.REVOLUTE
    turning: tuple[Term, ...] = (gravity_sin, gravity_cos) if feels_gravity and kind is Kind.REVOLUTE else ()
    rates = (-own.velocity, own.velocity) if math.isfinite(own.velocity) else ANYWHERE
    limits = Limits(own.position, rates, ANYWHERE, own.effort)
    return Joint(name, own.name, kind, (inertia, *turning, *FRICTION), limits, harmonics=HARMONICS)


def _mover(joint: UrdfJoint, joints: Mapping[str, UrdfJoint], file: TomlFile) -> Mover:
    """How a joint is moved: along those that mimic each other, to the one that moves by itself.

    What is wrong with its mimic is noted.
    """
    sign, bias, seen, one = 1.0, 0.0, [joint.name], joint
    while one.kind != "fixed" and one.mimic:
        sign, bias = sign * one.multiplier, bias + sign * one.bias
        following = joints.get(one.mimic)
        wrong = _wrong(one, following, seen)
        if wrong:
            if one is joint:
                file.note(one.line, f"<joint name={one.name!r}> <mimic>: {wrong}")
            return Mover("")
        assert following is not None
        one = following
        seen.append(one.name)
    return Mover("" if one.kind == "fixed" or not sign else one.name, 1 if sign >= 0 else -1, bias)


def _wrong(joint: UrdfJoint, following: UrdfJoint | None, seen: list[str]) -> str:
    """What is wrong with what a joint mimics, or ""."""
    if following is None:
        return f"there is no joint {joint.mimic!r}; correct the name"
    if following.name in seen:
        return f"{' mimics '.join([*seen, following.name])}: one of them must move by itself"
    if following.kind == "fixed":
        return f"joint {joint.mimic!r} is fixed; name one that moves, or make this one fixed, too"
    if joint.multiplier not in (-1.0, 0.0, 1.0):
        said = f"multiplier is {joint.multiplier:g}, and links that share a coordinate go by 1 or -1 times it"
        return f'{said}; where it carries little, write type="fixed" and no mimic, or describe it as a joint of its own'
    return ""
