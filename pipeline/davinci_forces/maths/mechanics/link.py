"""The dynamics of one link, relative to its parent link; every number is a float or an array of samples.

Every link has a frame at its joint: the link turns about, or slides along, z of that frame.  `row` is the link's row of
`Tree.rows`: rotation matrix (by rows) and position of that frame in the parent's frame at q = 0, and the ten inertial
parameters.  `cos_sin` is (cos q, sin q).  Vectors are tuples of three, in the axes of a link.  A motion is (w, e, a):
angular velocity, angular acceleration and acceleration of the origin.  A wrench is (force, moment about the origin).

Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 2, 5 and 6.
"""

from collections.abc import Sequence
from typing import Any

Number = Any
Vector = tuple[Number, Number, Number]
Motion = tuple[Vector, Vector, Vector]
Wrench = tuple[Vector, Vector]
Velocity = tuple[Vector, Vector]  # angular velocity, and velocity of the origin
CosSin = tuple[Number, Number]
Inertia = tuple[Vector, Vector, Vector]  # first moment h; Ixx, Ixy, Ixz; Iyy, Iyz, Izz, about the origin
Row = Sequence[float]


def plus(a: Vector, b: Vector) -> Vector:
    """The sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """The cross product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def times(A: Sequence[Number], r: Vector) -> Vector:
    """A matrix, given by rows, times a vector."""
    return (
        A[0] * r[0] + A[1] * r[1] + A[2] * r[2],
        A[3] * r[0] + A[4] * r[1] + A[5] * r[2],
        A[6] * r[0] + A[7] * r[1] + A[8] * r[2],
    )


def place(row: Row) -> Vector:
    """The position of the joint in the parent's frame."""
    return row[9], row[10], row[11]


def to_joint_axes(row: Row, x: Vector) -> Vector:
    """Transform a vector from the parent's axes to the axes of the joint at q = 0."""
    return (
        row[0] * x[0] + row[3] * x[1] + row[6] * x[2],
        row[1] * x[0] + row[4] * x[1] + row[7] * x[2],
        row[2] * x[0] + row[5] * x[1] + row[8] * x[2],
    )


def to_link_axes(cos_sin: CosSin, x: Vector) -> Vector:
    """Transform a vector from the axes of a joint at q = 0 to the axes of its link."""
    return cos_sin[0] * x[0] + cos_sin[1] * x[1], cos_sin[0] * x[1] - cos_sin[1] * x[0], x[2]


def from_link_axes(cos_sin: CosSin, x: Vector) -> Vector:
    """Transform a vector from the axes of a link to the axes of its joint at q = 0."""
    return cos_sin[0] * x[0] - cos_sin[1] * x[1], cos_sin[1] * x[0] + cos_sin[0] * x[1], x[2]


def rates(w: Vector, e: Vector) -> tuple[Number, ...]:
    """[e]x + [w]x [w]x by rows: times the position of a point, it is the point's acceleration about the origin."""
    xy, xz, yz, xx, yy, zz = w[0] * w[1], w[0] * w[2], w[1] * w[2], w[0] * w[0], w[1] * w[1], w[2] * w[2]
    return -yy - zz, xy - e[2], xz + e[1], xy + e[2], -xx - zz, yz - e[0], xz - e[1], yz + e[0], -xx - yy


def link_motion(row: Row, slides: bool, cos_sin: CosSin, q: Number, dq: Number, ddq: Number, motion: Motion) -> Motion:
    """The motion of a link from the motion of its parent."""
    w, e, a = motion
    a = to_joint_axes(row, plus(a, times(rates(w, e), place(row))))
    w, e = to_joint_axes(row, w), to_joint_axes(row, e)
    if slides:
        x = a[0] + q * (w[0] * w[2] + e[1]) + 2.0 * dq * w[1]
        y = a[1] + q * (w[1] * w[2] - e[0]) - 2.0 * dq * w[0]
        return w, e, (x, y, a[2] - q * (w[0] * w[0] + w[1] * w[1]) + ddq)
    e = e[0] + w[1] * dq, e[1] - w[0] * dq, e[2] + ddq
    return to_link_axes(cos_sin, (w[0], w[1], w[2] + dq)), to_link_axes(cos_sin, e), to_link_axes(cos_sin, a)


def link_velocity(row: Row, slides: bool, cos_sin: CosSin, q: Number, dq: Number, velocity: Velocity) -> Velocity:
    """The velocity of a link from the velocity of its parent."""
    w, v = to_joint_axes(row, velocity[0]), to_joint_axes(row, plus(velocity[1], cross(velocity[0], place(row))))
    if slides:
        return w, (v[0] + w[1] * q, v[1] - w[0] * q, v[2] + dq)
    return to_link_axes(cos_sin, (w[0], w[1], w[2] + dq)), to_link_axes(cos_sin, v)


def wrench_of(row: Row, motion: Motion) -> Wrench:
    """The wrench that gives a link this motion: f = m a + (e x + w x w x) h, n = h x a + I e + w x I w.  (4.9)"""
    w, e, a = motion
    h = row[13], row[14], row[15]
    inertia = row[16], row[17], row[18], row[17], row[19], row[20], row[18], row[20], row[21]
    f = times(rates(w, e), h)
    f = f[0] + row[12] * a[0], f[1] + row[12] * a[1], f[2] + row[12] * a[2]
    return f, plus(cross(h, a), plus(times(inertia, e), cross(w, times(inertia, w))))


def wrench_in_parent_frame(row: Row, slides: bool, cos_sin: CosSin, q: Number, wrench: Wrench) -> Wrench:
    """Transform a wrench on a link to the origin and the axes of its parent."""
    f, n = wrench
    if slides:
        n = n[0] - q * f[1], n[1] + q * f[0], n[2]
    else:
        f, n = from_link_axes(cos_sin, f), from_link_axes(cos_sin, n)
    f, n = times(row, f), times(row, n)
    return f, plus(n, cross(place(row), f))


def unit_wrench(slides: bool, m: float, inertia: Inertia) -> Wrench:
    """The wrench that accelerates a body of mass m at rest by 1 rad/s^2, or 1 m/s^2, along its joint."""
    h, (_, _, xz), (_, yz, zz) = inertia
    zero = 0.0 * zz
    if slides:
        return (zero, zero, zero + m), (h[1], -h[0], zero)
    return (-h[1], h[0], zero), (xz, yz, zz)


def turned_inertia(cos_sin: CosSin, inertia: Inertia) -> Inertia:
    """Transform the inertia of a link that turns to the axes of its joint at q = 0."""
    (c, s), (h, (xx, xy, xz), (yy, yz, zz)) = cos_sin, inertia
    cc, cs, ss, cs_xy = c * c, c * s, s * s, 2.0 * c * s * xy
    xx_xy_xz = cc * xx - cs_xy + ss * yy, cs * (xx - yy) + (cc - ss) * xy, c * xz - s * yz
    return from_link_axes(cos_sin, h), xx_xy_xz, (ss * xx + cs_xy + cc * yy, s * xz + c * yz, zz)


def shifted_inertia(m: float, r: Vector, inertia: Inertia) -> Inertia:
    """Transform the inertia of a body of mass m to a new origin; r is the position of the old origin from there."""
    h, (xx, xy, xz), (yy, yz, zz) = inertia
    g = h[0] + 0.5 * m * r[0], h[1] + 0.5 * m * r[1], h[2] + 0.5 * m * r[2]
    x, y, z = 2.0 * g[0] * r[0], 2.0 * g[1] * r[1], 2.0 * g[2] * r[2]
    xx_xy_xz = xx + y + z, xy - g[0] * r[1] - g[1] * r[0], xz - g[0] * r[2] - g[2] * r[0]
    yy_yz_zz = yy + x + z, yz - g[1] * r[2] - g[2] * r[1], zz + x + y
    return (h[0] + m * r[0], h[1] + m * r[1], h[2] + m * r[2]), xx_xy_xz, yy_yz_zz


def inertia_in_joint_frame(slides: bool, cos_sin: CosSin, q: Number, m: float, inertia: Inertia) -> Inertia:
    """Transform the inertia of a link and all its descendants to the frame of its joint at q = 0."""
    return shifted_inertia(m, (0.0 * q, 0.0 * q, q), inertia) if slides else turned_inertia(cos_sin, inertia)


def inertia_in_parent_frame(row: Row, m: float, inertia: Inertia) -> Inertia:
    """Transform an inertia of mass m from the frame of a joint at q = 0 to the frame of the parent link."""
    h, (xx, xy, xz), (yy, yz, zz) = inertia
    x, y, z = times(row, (xx, xy, xz)), times(row, (xy, yy, yz)), times(row, (xz, yz, zz))  # columns of R I
    a, b, c = times(row, (x[0], y[0], z[0])), times(row, (x[1], y[1], z[1])), times(row, (x[2], y[2], z[2]))
    return shifted_inertia(m, place(row), (times(row, h), a, (b[1], b[2], c[2])))


def columns(motion: Motion, J: Velocity) -> tuple[Number, ...]:
    """The effort at a coordinate for a unit of each inertial parameter of a link (`bodies.PARAMETERS`).

    J is the velocity of the link at unit velocity of the coordinate.  The effort is `wrench_of` projected on J, where
    (w x u) . J = u . (J x w).
    """
    (w, e, a), (J_w, J_v) = motion, J
    w_w, w_J = w[0] * w[0] + w[1] * w[1] + w[2] * w[2], w[0] * J_v[0] + w[1] * J_v[1] + w[2] * J_v[2]
    h, g = plus(cross(J_v, e), cross(a, J_w)), cross(J_w, w)
    return (
        a[0] * J_v[0] + a[1] * J_v[1] + a[2] * J_v[2],
        h[0] + w[0] * w_J - w_w * J_v[0],
        h[1] + w[1] * w_J - w_w * J_v[1],
        h[2] + w[2] * w_J - w_w * J_v[2],
        e[0] * J_w[0] + w[0] * g[0],
        e[1] * J_w[0] + e[0] * J_w[1] + w[1] * g[0] + w[0] * g[1],
        e[2] * J_w[0] + e[0] * J_w[2] + w[2] * g[0] + w[0] * g[2],
        e[1] * J_w[1] + w[1] * g[1],
        e[2] * J_w[1] + e[1] * J_w[2] + w[2] * g[1] + w[1] * g[2],
        e[2] * J_w[2] + w[2] * g[2],
    )
