"""Write a robot as URDF: its chain, the masses of its links, and the limits of its joints.

A link's frame is on its joint axis.  It is the named frame of the link if that frame is on the axis, else the frame of
the dynamics, with z along the axis.  Other frames of the chain become fixed links without mass.  If a coordinate moves
several links, the first joint is independent and the other joints mimic it.  URDF cannot express limits of
acceleration, missing limits or drives.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from davinci_forces.errors import BadRobot
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.bodies import Bodies
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.placed import roll_pitch_yaw
from davinci_forces.robots.robot import UNLIMITED, Kind, Limits, Robot
from davinci_forces.robots.urdf.tables import NO_LIMIT, TENSOR, TIP

UPPER = np.triu_indices(3)
FRAME_TOLERANCE = 1e-15  # largest rounding error of a frame that coincides with its link's frame


def text(robot: Robot, remarks: Sequence[str] = (), friction: Mapping[str, tuple[float, float]] | None = None) -> str:
    """The text of the robot's URDF, with remarks at its head, and viscous and Coulomb friction by coordinate.

    Raises BadRobot if the robot has no chain.
    """
    if robot.chain is None:
        raise BadRobot(f"robot {robot.name} has no chain: its geometry is not known, and a URDF needs it")
    title, *remarks = (re.sub("-(?=-|$)", "- ", x) for x in (robot.title, *remarks))  # an XML comment has no --
    weightless = "" if robot.bodies else "; the masses of its links are not known"
    lines = [
        '<?xml version="1.0" encoding="utf-8"?>',
        f"<!-- {title}, in m, rad and kg, z up{weightless} -->",
        *(f"<!-- {remark} -->" for remark in remarks),
        f"<robot name={quoteattr(robot.name)}>",
        f"  <link name={quoteattr(robot.chain.names[0])}/>",
        *(f"  {line}" for line in _body(_turned(robot, robot.chain, friction or {}), robot.chain)),
        "</robot>",
    ]
    return "\n".join(lines) + "\n"


class _Turned(NamedTuple):
    """A robot in the frames of URDF: each on its joint axis, in any orientation."""

    robot: Robot
    links: tuple[str, ...]  # names of the bodies, the base first (L + 1,)
    placement: Array  # (L, 4, 4)
    axis: Array  # (L, 3)
    bodies: Bodies | None
    offset: Array  # poses of the chain's frames in their bodies (F, 4, 4)
    friction: Mapping[str, tuple[float, float]]


def _turned(robot: Robot, chain: Chain, friction: Mapping[str, tuple[float, float]]) -> _Turned:
    """Express the robot in the named frames of its links, as far as these are on the joint axes."""
    frames = chain.of_links.copy()
    # Where the named frame is not at the joint, the frame of the dynamics is kept.
    frames[frames[:, :3, 3].any(axis=1)] = np.eye(4)
    by_body = np.concatenate([np.eye(4)[None], frames])
    back = np.linalg.inv(by_body)
    return _Turned(
        robot, (chain.names[0], *chain.links), back[chain.parent] @ chain.placement @ frames, back[1:, :3, 2],
        robot.bodies.in_frames(back[1:]) if robot.bodies else None, back[chain.body] @ chain.offset, friction,
    )  # fmt: skip


def _body(turned: _Turned, chain: Chain) -> Iterator[str]:
    """The lines of all links and joints, and of the frames that are fixed to links."""
    moved = set[int]()
    for i, coordinate in enumerate(chain.coordinate.tolist()):
        yield from _link(turned, i)
        yield from _joint(turned, chain, i, coordinate in moved)
        moved.add(coordinate)
    taken = set(turned.links)
    for name, body, offset in [*zip(chain.names, chain.body.tolist(), turned.offset, strict=True)][1:]:
        if name not in taken or not np.allclose(offset, np.eye(4), rtol=0, atol=FRAME_TOLERANCE):
            while name in taken:  # a suffix distinguishes a frame from a link of the same name
                name = f"{name}_frame"
            taken.add(name)
            yield from _fixed(name, turned.links[body], offset)
    if TIP not in taken:  # readers recognise the tip by this name
        at = chain.names.index(chain.tip)
        yield from _fixed(TIP, turned.links[chain.body[at]], turned.offset[at])


def _link(turned: _Turned, i: int) -> Iterator[str]:
    name, bodies = quoteattr(turned.links[i + 1]), turned.bodies
    if bodies is None:
        yield f"<link name={name}/>"
        return
    tensor = zip(TENSOR, bodies.inertias[i][UPPER].tolist(), strict=True)
    inertia = " ".join(f'{key}="{_number(value)}"' for key, value in tensor)
    yield f"<link name={name}>"
    yield "  <inertial>"
    yield f'    <origin xyz="{_numbers(bodies.centres[i])}" rpy="0 0 0"/>'
    yield f'    <mass value="{_number(bodies.masses[i])}"/>'
    yield f"    <inertia {inertia}/>"
    yield "  </inertial>"
    yield "</link>"


def _joint(turned: _Turned, chain: Chain, i: int, mimics: bool) -> Iterator[str]:
    """The lines of a link's joint: an independent joint, or a joint that mimics it."""
    robot, k = turned.robot, int(chain.coordinate[i])
    parent, child = turned.links[chain.parent[i]], turned.links[i + 1]
    coordinate = robot.coordinates[k]
    limits = robot.joints[k].limits if k < len(robot.joints) else UNLIMITED
    bounded = bool(np.isfinite(limits.q).all())
    kind = Kind.PRISMATIC.value if chain.slides[i] else Kind.REVOLUTE.value if bounded else "continuous"
    name = f"{coordinate} of {child}" if mimics else coordinate
    yield f'<joint name={quoteattr(name)} type="{kind}">'
    yield from _origin(parent, child, turned.placement[i])
    yield f'  <axis xyz="{_numbers(turned.axis[i])}"/>'
    yield f"  <limit {_limits(limits, bounded or bool(chain.slides[i]))}/>"
    if mimics:
        yield f'  <mimic joint={quoteattr(coordinate)} multiplier="1" offset="0"/>'
    elif coordinate in turned.friction:
        yield '  <dynamics damping="{}" friction="{}"/>'.format(*map(_number, turned.friction[coordinate]))
    yield "</joint>"


def _limits(limits: Limits, ends: bool) -> str:
    low, high = (min(max(end, -NO_LIMIT), NO_LIMIT) for end in limits.q)
    velocity, effort = min(limits.dq[1], -limits.dq[0], NO_LIMIT), min(limits.effort, NO_LIMIT)
    between = f'lower="{_number(low)}" upper="{_number(high)}" ' if ends else ""
    return f'{between}velocity="{_number(velocity)}" effort="{_number(effort)}"'


def _fixed(name: str, parent: str, placement: Array) -> Iterator[str]:
    """The lines of a frame that is fixed to a link."""
    joint = f"{name} on {parent}"
    yield f"<link name={quoteattr(name)}/>"
    yield f'<joint name={quoteattr(joint)} type="fixed">'
    yield from _origin(parent, name, placement)
    yield "</joint>"


def _origin(parent: str, child: str, placement: Array) -> Iterator[str]:
    yield f"  <parent link={quoteattr(parent)}/>"
    yield f"  <child link={quoteattr(child)}/>"
    yield f'  <origin xyz="{_numbers(placement[:3, 3])}" rpy="{_numbers(roll_pitch_yaw(placement[:3, :3]))}"/>'


def _numbers(values: object) -> str:
    return " ".join(_number(value) for value in np.asarray(values, float).tolist())


def _number(value: float) -> str:
    """A number with the fewest digits that read back as the same number."""
    return repr(float(value) + 0.0).removesuffix(".0")
