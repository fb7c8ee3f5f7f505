"""The dynamics of one link, relative to its parent link; every number is a float or an array of samples.

Every link has a frame at its joint: the link turns about, or slides along, z of that frame.  `row` is the link's row of
`Tree.rows`: rotation matrix (by rows) and position of that frame in the parent's frame at q = 0, and the ten inertial
parameters.  `cos_sin` is (cos q, sin q).  Vectors are tuples of three, in the axes of a link.  A motion is (w, e, a):
angular velocity, angular acceleration and acceleration of the origin.  A wrench is (force, moment about the origin).

Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 2 and 5.
"""

from collections.abc import Sequence
from typing import Any

Number = Any
Vector = tuple[Number, Number, Number]
Motion = tuple[Vector, Vector, Vector]
Wrench = tuple[Vector, Vector]
Velocity = tuple[Vector, Vector]  # angular velocity, and velocity of the origin
CosSin = tuple[Number, Number]
Row = Sequence[float]


def plus(a: Vector, b: Vector) -> Vector:
    """The sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def dot(a: Vector, b: Vector) -> Number:
    """The scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


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


def inertia_tensor(row: Row) -> tuple[Number, ...]:
    """The inertia about the link's origin, by rows."""
    return row[16], row[17], row[18], row[17], row[19], row[20], row[18], row[20], row[21]


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
    h, inertia = (row[13], row[14], row[15]), inertia_tensor(row)
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


def momentum(row: Row, velocity: Velocity) -> Velocity:
    """The angular momentum of a link about its origin, h x v + I w, and its momentum, m v + w x h."""
    (w, v), h = velocity, (row[13], row[14], row[15])
    m_v = row[12] * v[0], row[12] * v[1], row[12] * v[2]
    return plus(cross(h, v), times(inertia_tensor(row), w)), plus(m_v, cross(w, h))


def columns(motion: Motion, J: Velocity) -> tuple[Number, ...]:
    """The effort at a coordinate for a unit of each inertial parameter of a link (`bodies.PARAMETERS`).

    J is the velocity of the link at unit velocity of the coordinate.  The effort is `wrench_of` projected on J, where
    (w x u) . J = u . (J x w).
    """
    (w, e, a), (J_w, J_v) = motion, J
    w_w, w_J = dot(w, w), dot(w, J_v)
    h, g = plus(cross(J_v, e), cross(a, J_w)), cross(J_w, w)
    return (
        dot(a, J_v),
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
