"""Write a robot as URDF: its chain, the masses of its links, and the limits of its joints.

A link's frame is on its joint axis.  It is the named frame of the link if that frame is on the axis, else the frame of
the dynamics, with z along the axis.  Other frames of the chain become fixed links without mass.  If a coordinate moves
several links, the first joint is independent and the other joints mimic it.  URDF cannot express limits of
acceleration, missing limits or drives.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
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
    """The URDF of a robot, with remarks at its head and friction by coordinate; raises BadRobot without a chain."""
    if robot.chain is None:
        raise BadRobot(f"robot {robot.name} has no chain: its geometry is not known, and a URDF needs it")
    chain, bodies, axes = _in_named_frames(robot.chain, robot.bodies)
    title, *remarks = (re.sub("-(?=-|$)", "- ", x) for x in (robot.title, *remarks))  # an XML comment has no --
    weightless = "" if robot.bodies else "; the masses of its links are not known"
    lines = [
        '<?xml version="1.0" encoding="utf-8"?>',
        f"<!-- {title}, in m, rad and kg, z up{weightless} -->",
        *(f"<!-- {remark} -->" for remark in remarks),
        f"<robot name={quoteattr(robot.name)}>",
        f"  <link name={quoteattr(chain.names[0])}/>",
    ]
    moved = set[int]()
    for i, coordinate in enumerate(chain.coordinate.tolist()):
        body = [*_link(chain, bodies, i), *_joint(robot, chain, i, axes[i], coordinate in moved, friction or {})]
        lines += [f"  {line}" for line in body]
        moved.add(coordinate)
    return "\n".join([*lines, *(f"  {line}" for line in _frames(chain)), "</robot>"]) + "\n"


def _in_named_frames(chain: Chain, bodies: Bodies | None) -> tuple[Chain, Bodies | None, Array]:
    """The chain and its bodies in the named frames of the links, as far as these are on joint axes; and the axes."""
    frames = chain.of_links
    # Where the named frame is not at the joint, the frame of the dynamics is kept.
    frames[frames[:, :3, 3].any(axis=1)] = np.eye(4)
    back = np.linalg.inv(np.concatenate([np.eye(4)[None], frames]))
    placement, offset = back[chain.parent] @ chain.placement @ frames, back[chain.body] @ chain.offset
    turned = bodies.in_frames(back[1:]) if bodies else None
    return replace(chain, placement=placement, offset=offset), turned, back[1:, :3, 2]


def _frames(chain: Chain) -> Iterator[str]:
    """The lines of the frames that are fixed to links."""
    bodies, taken = (chain.names[0], *chain.links), {chain.names[0], *chain.links}
    for name, body, offset in [*zip(chain.names, chain.body.tolist(), chain.offset, strict=True)][1:]:
        if name not in taken or not np.allclose(offset, np.eye(4), rtol=0, atol=FRAME_TOLERANCE):
            while name in taken:  # a suffix distinguishes a frame from a link of the same name
                name = f"{name}_frame"
            taken.add(name)
            yield from _fixed(name, bodies[body], offset)
    if TIP not in taken:  # readers recognise the tip by this name
        at = chain.names.index(chain.tip)
        yield from _fixed(TIP, bodies[chain.body[at]], chain.offset[at])


def _link(chain: Chain, bodies: Bodies | None, i: int) -> Iterator[str]:
    name = quoteattr(chain.links[i])
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


def _joint(
    robot: Robot, chain: Chain, i: int, axis: Array, mimics: bool, friction: Mapping[str, tuple[float, float]]
) -> Iterator[str]:
    """The lines of a link's joint: an independent joint, or a joint that mimics it."""
    k, parent, child = int(chain.coordinate[i]), (chain.names[0], *chain.links)[chain.parent[i]], chain.links[i]
    coordinate = robot.coordinates[k]
    limits = robot.joints[k].limits if k < len(robot.joints) else UNLIMITED
    bounded = bool(np.isfinite(limits.q).all())
    kind = Kind.PRISMATIC.value if chain.slides[i] else Kind.REVOLUTE.value if bounded else "continuous"
    name = f"{coordinate} of {child}" if mimics else coordinate
    yield f'<joint name={quoteattr(name)} type="{kind}">'
    yield from _origin(parent, child, chain.placement[i])
    yield f'  <axis xyz="{_numbers(axis)}"/>'
    yield f"  <limit {_limits(limits, bounded or bool(chain.slides[i]))}/>"
    if mimics:
        yield f'  <mimic joint={quoteattr(coordinate)} multiplier="1" offset="0"/>'
    elif coordinate in friction:
        yield '  <dynamics damping="{}" friction="{}"/>'.format(*map(_number, friction[coordinate]))
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
