"""The regressors of many samples, compiled.  Import it only where it is used, as with `rigid_body_kernels`."""

import numpy as np
from numba import njit

from pipeline.maths.mechanics.lanes import LANES, ONE, forget_older, load, put, row, three
from pipeline.maths.mechanics.link import cross, into_link, motion, plus


@njit(cache=True)
def regressors(arm, gravity, q, dq, ddq, Y):  # type: ignore[no-untyped-def]
    """Write the regressors (N, n, 10 L) of N samples (N, n) into Y.

    A link's Jacobian in its own axes follows from its carrier's; its ten columns are that Jacobian times the force and
    the moment by each of its parameters.  Blocks of a frame: w, e, a; of a frame and a coordinate: J_omega, J_v.
    """
    N, n, L = q.shape[0], arm.n, len(arm.parent)
    frames, coordinates = np.zeros((L + 1, 9 * LANES)), np.zeros((n + 1, 6 * LANES))
    P, B, T, S = np.empty(9 * LANES), np.empty(9 * LANES), np.empty(6 * LANES), np.empty(6 * LANES)
    J, J_p, J_b, y = np.zeros((L + 1, n, 6 * LANES)), np.empty(6 * LANES), np.empty(6 * LANES), np.empty(10 * LANES)
    place = np.empty(3 * LANES)
    coordinates[n, :LANES] = 1.0
    frames[0, 8 * LANES :] = gravity
    reached = _reached(arm)
    Y[:] = 0.0
    for start in range(0, N, LANES):
        count = min(LANES, N - start)
        load(q, dq, ddq, start, coordinates)
        for i in range(L):
            j = np.uint64(i)
            P[:] = frames[arm.parent[j]]
            T[:] = coordinates[arm.turns[j]]
            S[:] = coordinates[arm.slides[j]]
            link = row(arm.links, j)
            for s in range(LANES):
                c = link[0] * T[s] - link[1] * T[LANES + s]
                z = link[1] * T[s] + link[0] * T[LANES + s]
                d = link[5] + S[2 * LANES + s]
                w, e, a = motion(
                    three(P, 0, s), three(P, 3, s), three(P, 6, s), c, z, d,
                    T[3 * LANES + s], S[3 * LANES + s], T[4 * LANES + s], S[4 * LANES + s], link,
                )  # fmt: skip
                put(B, 0, s, w)
                put(B, 3, s, e)
                put(B, 6, s, a)
                put(place, 0, s, (c, z, d))
            frames[j + ONE] = B
            for k in range(n):
                if not reached[j + ONE, k]:
                    continue
                J_p[:] = J[arm.parent[j], k]
                turns, slides = (1.0 if arm.turns[j] == k else 0.0), (1.0 if arm.slides[j] == k else 0.0)
                ca, sa, r = link[2], link[3], link[4]
                for s in range(LANES):
                    c, z, d = three(place, 0, s)
                    J_w, J_v = three(J_p, 0, s), three(J_p, 3, s)
                    J_w = into_link(c, z, ca, sa, J_w[0], J_w[1], J_w[2] + turns)
                    J_v = into_link(c, z, ca, sa, J_v[0], J_v[1], J_v[2] + slides)
                    J_v = plus(J_v, cross(J_w, (r, d * sa, d * ca)))
                    put(J_b, 0, s, J_w)
                    put(J_b, 3, s, J_v)
                    found = _columns(three(B, 0, s), three(B, 3, s), three(B, 6, s), J_w, J_v)
                    put(y, 0, s, found[:3])
                    put(y, 3, s, found[3:6])
                    put(y, 6, s, found[6:9])
                    y[9 * LANES + s] = found[9]
                J[j + ONE, k] = J_b
                for s in range(count):
                    for column in range(10):
                        Y[start + s, k, 10 * i + column] = y[column * LANES + s]


@njit(inline="always")
def _reached(arm):  # type: ignore[no-untyped-def]
    """Which coordinates move each frame (L + 1, n)."""
    L = len(arm.parent)
    reached = np.zeros((L + 1, arm.n), np.bool_)
    for i in range(L):
        j = np.uint64(i)
        for k in range(arm.n):
            reached[j + ONE, k] = reached[arm.parent[j], k] or arm.turns[j] == k or arm.slides[j] == k
    return reached


@njit(inline="always")
def _columns(w, e, a, Jw, Jv):  # type: ignore[no-untyped-def]
    """The effort by each of a link's parameters: m; mx, my, mz; Ixx, Ixy, Ixz, Iyy, Iyz, Izz.

    f = m a + e x h + w x (w x h) and n = h x a + I e + w x I w, projected: (w x u) . J = u . (J x w).
    """
    along, wJ = w[0] * w[0] + w[1] * w[1] + w[2] * w[2], w[0] * Jv[0] + w[1] * Jv[1] + w[2] * Jv[2]
    h = plus(cross(Jv, e), cross(a, Jw))
    g = cross(Jw, w)
    return (
        a[0] * Jv[0] + a[1] * Jv[1] + a[2] * Jv[2],
        h[0] + w[0] * wJ - along * Jv[0],
        h[1] + w[1] * wJ - along * Jv[1],
        h[2] + w[2] * wJ - along * Jv[2],
        e[0] * Jw[0] + w[0] * g[0],
        e[1] * Jw[0] + e[0] * Jw[1] + w[1] * g[0] + w[0] * g[1],
        e[2] * Jw[0] + e[0] * Jw[2] + w[2] * g[0] + w[0] * g[2],
        e[1] * Jw[1] + w[1] * g[1],
        e[2] * Jw[1] + e[1] * Jw[2] + w[2] * g[1] + w[1] * g[2],
        e[2] * Jw[2] + w[2] * g[2],
    )


forget_older(regressors)
