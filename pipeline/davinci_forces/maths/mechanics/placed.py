"""Build a chain from frames with any placement and any joint axis, as URDF describes them.

    frame = parent * placement * turn about, or shift along, axis by sign q + bias

The links of a `Chain` move about or along their z axis.  The frame of a link is therefore turned until z is along the
joint axis.  The frame of the description becomes a named frame of the link.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.bodies import PARAMETERS, Bodies, as_bodies, of_pseudo_inertias, pseudo_inertias
from davinci_forces.maths.mechanics.chain import FIXED, Chain

Z = np.array([0.0, 0.0, 1.0])


class PlacedLink(NamedTuple):
    """The frame of one link, and its inertial parameters; without a coordinate, it is fixed to its parent frame."""

    name: str
    before: int  # index of the parent frame: the base is 0, and link i has frame i + 1
    placement: Array  # pose in the parent frame at q = 0, without bias (4, 4) [m]
    axis: Array = Z  # (3,) joint axis in the link's frame, of length 1
    coordinate: int = FIXED
    sign: int = 1  # -1 if it moves opposite to the coordinate
    bias: float = 0.0  # joint position at q = 0 [rad or m]
    slides: bool = False
    parameters: Array = np.zeros(len(PARAMETERS))  # (10,), in the order of PARAMETERS


def assemble_chain(base: str, links: Sequence[PlacedLink], tip: str) -> tuple[Chain, Bodies]:
    """The chain of these links and its bodies; fixed links add their inertia to their parent, except on the base."""
    body, offset, moving = [0], [np.eye(4)], list[PlacedLink]()
    parent, placement, pseudo = list[int](), list[Array](), list[Array]()
    inertias = pseudo_inertias(np.array([link.parameters for link in links]).reshape(-1, len(PARAMETERS)))
    for link, J in zip(links, inertias, strict=True):
        pose = offset[link.before] @ link.placement @ _bias_transform(link)
        if link.coordinate == FIXED:
            body.append(body[link.before])
        else:
            turned = _z_along(link.sign * link.axis)
            parent.append(body[link.before])
            placement.append(pose @ turned)
            pseudo.append(np.zeros((4, 4)))
            moving.append(link)
            body.append(len(moving))
            pose = turned.T
        offset.append(pose)
        if body[-1]:
            pseudo[body[-1] - 1] = pseudo[body[-1] - 1] + pose @ J @ pose.T
    chain = Chain(
        links=tuple(link.name for link in moving), parent=np.array(parent), placement=np.array(placement),
        slides=np.array([link.slides for link in moving]), coordinate=np.array([link.coordinate for link in moving]),
        names=(base, *(link.name for link in links)), body=np.array(body), offset=np.array(offset),
        before=np.array([0, *(link.before for link in links)]), tip=tip,
        n=max(link.coordinate for link in moving) + 1,
    )  # fmt: skip
    return chain, as_bodies(of_pseudo_inertias(np.array(pseudo)))


def transform(xyz: Sequence[float], rpy: Sequence[float]) -> Array:
    """The pose (4, 4) with this position [m] and this roll, pitch and yaw [rad] about fixed axes.

    R = Rz(yaw) Ry(pitch) Rx(roll)
    """
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    T = np.eye(4)
    T[:3, 3] = xyz
    T[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return T


def roll_pitch_yaw(R: Array) -> tuple[float, float, float]:
    """The angles of `transform` [rad] for a rotation (3, 3), exact to rounding for any rotation.

    At a pitch of a quarter turn, only the sum or difference of roll and yaw is determined: the yaw is chosen.
    """
    yaw = float(np.arctan2(R[1, 0], R[0, 0]))
    c, s = np.cos(yaw), np.sin(yaw)
    pitch = float(np.arctan2(-R[2, 0], c * R[0, 0] + s * R[1, 0]))
    roll = float(np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1]))
    return roll, pitch, yaw


def _bias_transform(link: PlacedLink) -> Array:
    """The transform (4, 4) of a link's frame by its bias."""
    T = np.eye(4)
    if link.slides:
        T[:3, 3] = link.bias * link.axis
    elif link.bias:
        K = np.cross(np.eye(3), link.axis)  # K r = axis x r
        T[:3, :3] += np.sin(link.bias) * K + (1.0 - np.cos(link.bias)) * K @ K
    return T


def _z_along(axis: Array) -> Array:
    """A rotation (4, 4) whose z is an axis (3,) of length 1."""
    T = np.eye(4)
    if np.array_equal(axis, Z):
        return T
    x = np.eye(3)[int(np.abs(axis).argmin())]  # the coordinate axis that is most perpendicular to the joint axis
    x = x - (x @ axis) * axis
    x /= np.linalg.norm(x)
    T[:3, :3] = np.column_stack([x, np.cross(axis, x), axis])
    return T
