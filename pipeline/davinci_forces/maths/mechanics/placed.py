"""Frames with any placement and any joint axis, as URDF describes them.

    frame = parent * placement * turn about, or shift along, axis by sign q + bias

The links of a `Chain` move about or along their z axis.  The frame of a link is therefore turned until z is along the
joint axis.  The frame of the description becomes a named frame of the link.
"""

from collections.abc import Sequence

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.bodies import of_pseudo_inertias, pseudo_inertias
from davinci_forces.maths.mechanics.chain import FIXED, ChainFrame


def placed_frame(
    name: str, before: int, placement: Array, axis: Array, coordinate: int, sign: int, bias: float, slides: bool,
    parameters: Array,
) -> ChainFrame:  # fmt: skip
    """The frame with a placement (4, 4) [m] in its parent frame, which moves along or about a unit `axis` (3,) of it.

    The sign is -1 if it moves opposite to the coordinate; the bias is its position [rad or m] at q = 0.  The inertial
    `parameters` (10,) are in its own axes.
    """
    turned = np.eye(4) if coordinate == FIXED else _z_along(sign * axis)
    in_joint_axes = of_pseudo_inertias(turned.T @ pseudo_inertias(parameters[None]) @ turned)[0]
    first = placement @ _shift_or_turn(axis, bias, slides) @ turned
    return ChainFrame(name, before, first, turned.T, coordinate, slides, in_joint_axes)


def transform(xyz: Sequence[float], rpy: Sequence[float]) -> Array:
    """The pose (4, 4) at a position [m], turned by R = Rz(yaw) Ry(pitch) Rx(roll) [rad] about fixed axes."""
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


def _shift_or_turn(axis: Array, position: float, slides: bool) -> Array:
    """The transform (4, 4) of a frame that moves to a position [rad or m] along or about an axis (3,)."""
    T = np.eye(4)
    if slides:
        T[:3, 3] = position * axis
    elif position:
        K = np.cross(np.eye(3), axis)  # K r = axis x r
        T[:3, :3] += np.sin(position) * K + (1.0 - np.cos(position)) * K @ K
    return T


def _z_along(axis: Array) -> Array:
    """A rotation (4, 4) whose z is an axis (3,) of length 1."""
    T = np.eye(4)
    x = np.eye(3)[int(np.abs(axis).argmin())]  # the coordinate axis that is most perpendicular to the joint axis
    x = x - (x @ axis) * axis
    x /= np.linalg.norm(x)
    T[:3, :3] = np.column_stack([x, np.cross(axis, x), axis])
    return T
