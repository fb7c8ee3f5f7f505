"""The dynamics of one link on scalars, for the compiled kernels, which have them inlined.

Vectors are tuples of three; a `link` is a row of `lanes.PackedArm.links`; c, s and d are cos and sin of its theta
and its d as they are now.  w, e, a: angular velocity, angular acceleration and acceleration of a frame's origin.

Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 2, 5 and 6.
"""

from numba import njit


@njit(inline="always")
def cosine_sine(x):  # type: ignore[no-untyped-def]
    """cos x and sin x to 1e-15 for |x| < 1e5, without branches, which the catalogue's functions have.

    Reduced to |r| <= pi/4 in two parts of pi/2; polynomials of fdlibm's k_cos and k_sin (Sun Microsystems, 1993).
    """
    turns = (x * 0.6366197723675814 + 6755399441055744.0) - 6755399441055744.0  # rounded to the nearest integer
    r = (x - turns * 1.57079632673412561417) - turns * 6.07710050650619224932e-11
    z = r * r
    s = z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    s = z * (8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 + s)))
    s = r + r * z * (-1.66666666666666324348e-01 + s)
    c = z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11))
    c = z * z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + c)))
    c = 1.0 - 0.5 * z + c
    quarter = turns * 0.25
    quarter = quarter - ((quarter + 6755399441055744.0) - 6755399441055744.0)  # 0, 1/4, +-1/2, -1/4
    odd = abs(quarter) == 0.25
    cosine = s if odd else c
    sine = c if odd else s
    cosine = -cosine if (quarter > 0.1) or (quarter < -0.3) else cosine
    sine = -sine if (quarter < 0.0) or (quarter > 0.3) else sine
    return cosine, sine


@njit(inline="always")
def into_link(c, s, ca, sa, x, y, z):  # type: ignore[no-untyped-def]
    """A vector in the axes of the frame that carries a link, in the link's.  (3.7)"""
    across = c * y - s * x
    return c * x + s * y, ca * across + sa * z, ca * z - sa * across


@njit(inline="always")
def out_of_link(c, s, ca, sa, x, y, z):  # type: ignore[no-untyped-def]
    """A vector in a link's axes, in those of the frame that carries it."""
    across = ca * y - sa * z
    return c * x - s * across, s * x + c * across, sa * y + ca * z


@njit(inline="always")
def motion(w, e, a, c, s, d, dt, dd, ddt, ddd, link):  # type: ignore[no-untyped-def]
    """Angular velocity, angular acceleration and acceleration of a link's origin from those of its carrier.

    The link turns at dt, ddt about z of its carrier, or slides along it at dd, ddd.
    """
    ca, sa = link[2], link[3]
    w_ = into_link(c, s, ca, sa, w[0], w[1], w[2] + dt)
    e_ = into_link(c, s, ca, sa, e[0] + w[1] * dt, e[1] - w[0] * dt, e[2] + ddt)
    a_ = into_link(c, s, ca, sa, a[0] + 2.0 * dd * w[1], a[1] - 2.0 * dd * w[0], a[2] + ddd)
    A = turning(w_, e_)
    r = link[4], d * sa, d * ca
    return w_, e_, plus(a_, times(A, r))


@njit(inline="always")
def turning(w, e):  # type: ignore[no-untyped-def]
    """[e]x + [w]x [w]x by rows: what turns a point's place into its acceleration."""
    xy, xz, yz, xx, yy, zz = w[0] * w[1], w[0] * w[2], w[1] * w[2], w[0] * w[0], w[1] * w[1], w[2] * w[2]
    return -yy - zz, xy - e[2], xz + e[1], xy + e[2], -xx - zz, yz - e[0], xz - e[1], yz + e[0], -xx - yy


@njit(inline="always")
def times(A, r):  # type: ignore[no-untyped-def]
    """A matrix, given by rows, times a vector."""
    return (
        A[0] * r[0] + A[1] * r[1] + A[2] * r[2],
        A[3] * r[0] + A[4] * r[1] + A[5] * r[2],
        A[6] * r[0] + A[7] * r[1] + A[8] * r[2],
    )


@njit(inline="always")
def plus(a, b):  # type: ignore[no-untyped-def]
    """The sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@njit(inline="always")
def cross(a, b):  # type: ignore[no-untyped-def]
    """The cross product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(inline="always")
def wrench(w, e, a, link):  # type: ignore[no-untyped-def]
    """The force and the moment about its origin that give a link this motion: Newton and Euler."""
    h = link[7], link[8], link[9]
    inertia = link[10], link[11], link[12], link[11], link[13], link[14], link[12], link[14], link[15]
    f = times(turning(w, e), h)
    f = f[0] + link[6] * a[0], f[1] + link[6] * a[1], f[2] + link[6] * a[2]
    return f, plus(cross(h, a), plus(times(inertia, e), cross(w, times(inertia, w))))


@njit(inline="always")
def carried(c, s, d, link, f, n):  # type: ignore[no-untyped-def]
    """A force and a moment on a link, as its carrier feels them at its own origin."""
    ca, sa = link[2], link[3]
    n = plus(n, cross((link[4], d * sa, d * ca), f))
    return out_of_link(c, s, ca, sa, f[0], f[1], f[2]), out_of_link(c, s, ca, sa, n[0], n[1], n[2])


@njit(inline="always")
def composite(c, s, d, link, m, h, inertia):  # type: ignore[no-untyped-def]
    """First moment and inertia of what a link carries, itself included, about its carrier's origin in its axes.

    `inertia` is [Ixx, Ixy, Ixz, Iyy, Iyz, Izz]: shifted by r, then turned about x by alpha and about z by theta.
    """
    ca, sa = link[2], link[3]
    r = link[4], d * sa, d * ca
    g = h[0] + 0.5 * m * r[0], h[1] + 0.5 * m * r[1], h[2] + 0.5 * m * r[2]
    xx, yy, zz = g[0] * r[0], g[1] * r[1], g[2] * r[2]
    ixx, ixy, ixz = (
        inertia[0] + 2.0 * (yy + zz),
        inertia[1] - g[0] * r[1] - g[1] * r[0],
        inertia[2] - g[0] * r[2] - g[2] * r[0],
    )
    iyy, iyz, izz = inertia[3] + 2.0 * (xx + zz), inertia[4] - g[1] * r[2] - g[2] * r[1], inertia[5] + 2.0 * (xx + yy)
    ixy, ixz = ca * ixy - sa * ixz, sa * ixy + ca * ixz
    iyy, iyz, izz = turned(ca, sa, iyy, iyz, izz)
    ixz, iyz = c * ixz - s * iyz, s * ixz + c * iyz
    ixx, ixy, iyy = turned(c, s, ixx, ixy, iyy)
    h = out_of_link(c, s, ca, sa, h[0] + m * r[0], h[1] + m * r[1], h[2] + m * r[2])
    return h, (ixx, ixy, ixz, iyy, iyz, izz)


@njit(inline="always")
def turned(c, s, aa, ab, bb):  # type: ignore[no-untyped-def]
    """The part of an inertia in the plane of two axes, after a turn in that plane."""
    return (
        c * c * aa - 2.0 * c * s * ab + s * s * bb,
        c * s * (aa - bb) + (c * c - s * s) * ab,
        (s * s * aa + 2.0 * c * s * ab + c * c * bb),
    )
