"""Write a robot as URDF: its chain, the masses of its links, and the limits of its joints.

A link's frame is at its joint.  It is the frame of the link's name where that is on the axis, else the frame with z
along the axis, as in the dynamics.  Other frames of the chain are fixed links without mass.  A coordinate that
moves several links moves the first, which the others mimic.  URDF cannot express limits of acceleration, missing limits
or drives.
"""

from collections.abc import Iterator
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
FRAME_TOLERANCE = 1e-15  # by which rounding moves a frame that coincides with its link's


def text(robot: Robot) -> str:
    """Write the text of its URDF.

    Raises
    ------
    BadRobot
        If the robot has no chain.
    """
    if robot.chain is None:
        raise BadRobot(f"robot {robot.name} has no chain: its geometry is not known, and a URDF needs it")
    title = robot.title.replace("--", "- -").rstrip("-")  # which a comment may not hold
    weightless = "" if robot.bodies else "; the masses of its links are not known"
    lines = [
        '<?xml version="1.0" encoding="utf-8"?>',
        f"<!-- {title}, in m, rad and kg, z up{weightless} -->",
        f"<robot name={quoteattr(robot.name)}>",
        f"  <link name={quoteattr(robot.chain.names[0])}/>",
        *(f"  {line}" for line in _body(_turned(robot, robot.chain), robot.chain)),
        "</robot>",
    ]
    return "\n".join(lines) + "\n"


class _Turned(NamedTuple):
    """A robot whose links have frames as in URDF: on their joint axes, in any orientation."""

    robot: Robot
    links: tuple[str, ...]  # by body, the base first (L + 1,)
    placement: Array  # (L, 4, 4)
    axis: Array  # (L, 3)
    bodies: Bodies | None
    offset: Array  # of the chain's frames (F, 4, 4)


def _turned(robot: Robot, chain: Chain) -> _Turned:
    """Express the robot in the links' frames of the chain's names, where these are on the joint axes."""
    frames = chain.of_links.copy()
    frames[frames[:, :3, 3].any(axis=1)] = np.eye(4)  # beside the axis, or further along
    by_body = np.concatenate([np.eye(4)[None], frames])
    back = np.linalg.inv(by_body)
    return _Turned(
        robot, (chain.names[0], *chain.links), back[chain.parent] @ chain.placement @ frames, back[1:, :3, 2],
        robot.bodies.in_frames(back[1:]) if robot.bodies else None, back[chain.body] @ chain.offset,
    )  # fmt: skip


def _body(turned: _Turned, chain: Chain) -> Iterator[str]:
    """Every link with the joint that carries it, and the frames that are fixed to them."""
    moved = set[int]()
    for i, coordinate in enumerate(chain.coordinate.tolist()):
        yield from _link(turned, i)
        yield from _joint(turned, chain, i, coordinate in moved)
        moved.add(coordinate)
    taken = set(turned.links)
    for name, body, offset in [*zip(chain.names, chain.body.tolist(), turned.offset, strict=True)][1:]:
        if name not in taken or not np.allclose(offset, np.eye(4), rtol=0, atol=FRAME_TOLERANCE):
            yield from _fixed(_unused(name, taken), turned.links[body], offset)
    if TIP not in taken:  # a file says by this name which of its frames is the tip
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
    """The joint at which a link moves: the coordinate's own, or one that mimics it."""
    robot, k = turned.robot, int(chain.coordinate[i])
    carrier, child = turned.links[chain.parent[i]], turned.links[i + 1]
    coordinate = robot.coordinates[k]
    limits = robot.joints[k].limits if k < len(robot.joints) else UNLIMITED
    bounded = bool(np.isfinite(limits.q).all())
    kind = Kind.PRISMATIC.value if chain.slides[i] else Kind.REVOLUTE.value if bounded else "continuous"
    name = f"{coordinate} of {child}" if mimics else coordinate
    yield f'<joint name={quoteattr(name)} type="{kind}">'
    yield from _carried(carrier, child, turned.placement[i])
    yield f'  <axis xyz="{_numbers(turned.axis[i])}"/>'
    yield f"  <limit {_limits(limits, bounded or bool(chain.slides[i]))}/>"
    if mimics:
        yield f'  <mimic joint={quoteattr(coordinate)} multiplier="1" offset="0"/>'
    yield "</joint>"


def _limits(limits: Limits, ends: bool) -> str:
    low, high = (min(max(end, -NO_LIMIT), NO_LIMIT) for end in limits.q)
    velocity, effort = min(limits.dq[1], -limits.dq[0], NO_LIMIT), min(limits.effort, NO_LIMIT)
    between = f'lower="{_number(low)}" upper="{_number(high)}" ' if ends else ""
    return f'{between}velocity="{_number(velocity)}" effort="{_number(effort)}"'


def _fixed(name: str, carrier: str, placement: Array) -> Iterator[str]:
    """A frame that is fixed to a link."""
    joint = f"{name} on {carrier}"
    yield f"<link name={quoteattr(name)}/>"
    yield f'<joint name={quoteattr(joint)} type="fixed">'
    yield from _carried(carrier, name, placement)
    yield "</joint>"


def _carried(carrier: str, child: str, placement: Array) -> Iterator[str]:
    yield f"  <parent link={quoteattr(carrier)}/>"
    yield f"  <child link={quoteattr(child)}/>"
    yield f'  <origin xyz="{_numbers(placement[:3, 3])}" rpy="{_numbers(roll_pitch_yaw(placement[:3, :3]))}"/>'


def _unused(name: str, taken: set[str]) -> str:
    """A name that no link has yet: a frame of a link's name that is elsewhere is called the link's frame."""
    while name in taken:
        name = f"{name}_frame"
    taken.add(name)
    return name


def _numbers(values: object) -> str:
    return " ".join(_number(value) for value in np.asarray(values, float).tolist())


def _number(value: float) -> str:
    """A number in as few digits as read back to it."""
    return repr(float(value) + 0.0).removesuffix(".0")
