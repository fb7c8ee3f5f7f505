"""The dynamics of an arm's links for many samples, compiled.

Recursive Newton-Euler and composite rigid bodies over the chain, each link's quantities in its own axes about its own
origin (Featherstone 2008, chapters 5 and 6).  A coordinate that moves several links collects the effort of all.

The physics of one link is written once, on scalars: `motion`, `wrench`, `carried` and `composite`.  `inverse_dynamics`
and `mass_matrices` run them on LANES samples at a time, in loops that the compiler turns into vector instructions.  It
does so only for flat arrays, here called blocks, whose rows of LANES start at constant places, and only in the function
that made them: split, these two are three times slower.  `sample` runs one sample, for callers that are
compiled themselves.

Import this module only where it is used: compiling it (or reading it back from the cache beside this file) takes longer
than thousands of samples of `rigid_body`.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.maths.arrays import Array
from pipeline.maths.mechanics import link as of_one_link
from pipeline.maths.mechanics.bodies import Bodies, of_pseudo_inertias, pseudo_inertias
from pipeline.maths.mechanics.kinematics import FIXED, Chain, frames
from pipeline.maths.mechanics.link import carried, composite, cosine_sine, motion, plus, wrench

Indices = NDArray[np.uint64]  # unsigned, so that the compiled code need not look for negative ones

LANES = 16
ONE = np.uint64(1)


class PackedArm(NamedTuple):
    """A chain and its bodies as the kernels take them: `pack` makes it, compiled code reads it.

    Rows of `links` (L, 16): cos and sin of theta at q = 0, cos and sin of alpha, a, d, and the ten inertial parameters
    of `bodies.PARAMETERS`.  `turns` and `slides` (L,) give the coordinate that moves theta or d; n means none.
    """

    n: int
    parent: Indices
    turns: Indices
    slides: Indices
    links: Array


def forget_older(*kernels: Any) -> None:
    """Drop compiled code that is older than what it has inlined.

    The compiler's cache compares a kernel's own file only, and would go on with former physics of `link`.
    """
    newest = max(Path(module).stat().st_mtime for module in (of_one_link.__file__, __file__))
    for kernel in kernels:
        for index in Path(kernel.stats.cache_path).glob(f"*.{kernel.py_func.__name__}-*.nbi"):
            if index.stat().st_mtime < newest:
                index.unlink(missing_ok=True)


def pack(chain: Chain, bodies: Bodies, n: int, fold: bool = True) -> PackedArm:
    """The arm with its first n coordinates, the others held at 0.

    Links that nothing moves any more, nor anything beyond them, become part of those that carry them; without `fold`
    every link stays one.
    """
    chain = chain.reduced(n)
    pi, kept = bodies.parameters(n).reshape(-1, 10), np.ones(len(chain.parent), np.bool_)
    if fold:
        pi, kept = _folded(chain, pi)
    moved, number = chain.coordinate != FIXED, np.concatenate([[0], np.cumsum(kept)])
    turns = np.where(moved & ~chain.slides, chain.coordinate, n)
    slides = np.where(moved & chain.slides, chain.coordinate, n)
    shape = [np.cos(chain.theta), np.sin(chain.theta), np.cos(chain.alpha), np.sin(chain.alpha), chain.a, chain.d]
    links = np.ascontiguousarray(np.column_stack([*shape, pi])[kept])
    parent, turns, slides = (x[kept].astype(np.uint64) for x in (number[chain.parent], turns, slides))
    return PackedArm(n, parent, turns, slides, links)


def _folded(chain: Chain, pi: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Inertial parameters (L, 10) after the fold, and which links (L,) it keeps; those on the base move nothing."""
    pseudo, kept, T = pseudo_inertias(pi), np.ones(len(pi), np.bool_), frames(chain, np.zeros(chain.n))
    for link in reversed(range(len(pi))):
        carrier = chain.parent[link]
        if chain.coordinate[link] == FIXED and carrier > 0 and not (kept & (chain.parent == link + 1)).any():
            local = np.linalg.solve(T[carrier], T[link + 1])
            pseudo[carrier - 1] += local @ pseudo[link] @ local.T
            kept[link] = False
    return of_pseudo_inertias(pseudo), kept


@njit(inline="always")
def row(t, i):  # type: ignore[no-untyped-def]
    """Link i of `PackedArm.links` as scalars, which the loops over lanes need."""
    return (
        t[i, 0], t[i, 1], t[i, 2], t[i, 3], t[i, 4], t[i, 5], t[i, 6], t[i, 7],
        t[i, 8], t[i, 9], t[i, 10], t[i, 11], t[i, 12], t[i, 13], t[i, 14], t[i, 15],
    )  # fmt: skip


@njit(inline="always")
def three(block, row, s):  # type: ignore[no-untyped-def]
    """Three rows of a block in lane s."""
    return block[row * LANES + s], block[(row + 1) * LANES + s], block[(row + 2) * LANES + s]


@njit(inline="always")
def put(block, row, s, x):  # type: ignore[no-untyped-def]
    """Write three rows of a block in lane s."""
    block[row * LANES + s], block[(row + 1) * LANES + s], block[(row + 2) * LANES + s] = x


@njit
def load(q, dq, ddq, start, coordinates):  # type: ignore[no-untyped-def]
    """Put LANES samples from `start` on, and 0 after the last, into a coordinate's block: cos, sin, q, dq, ddq, 0."""
    count = min(LANES, q.shape[0] - start)
    T = np.zeros(6 * LANES)
    for k in range(q.shape[1]):
        for s in range(count):
            i = start + s
            put(T, 2, s, (q[i, k], dq[i, k], ddq[i, k]))
        for s in range(LANES):
            T[s], T[LANES + s] = cosine_sine(T[2 * LANES + s])
        coordinates[k] = T


@njit(cache=True)
def inverse_dynamics(arm, gravity, q, dq, ddq, tau):  # type: ignore[no-untyped-def]
    """Write the effort of N samples into tau; all (N, n).  With gravity 0, and ddq 0, it is C dq.

    Blocks of a coordinate: cos, sin, q, dq, ddq, tau.  Of a frame: w, e, a, force, moment, then cos, sin, d.
    """
    N, n, L = q.shape[0], arm.n, len(arm.parent)
    frames, coordinates = np.zeros((L + 1, 18 * LANES)), np.zeros((n + 1, 6 * LANES))
    P, B, T, S = np.empty(18 * LANES), np.empty(18 * LANES), np.empty(6 * LANES), np.empty(6 * LANES)
    coordinates[n, :LANES] = 1.0
    for start in range(0, N, LANES):
        count = min(LANES, N - start)
        load(q, dq, ddq, start, coordinates)
        frames[0] = 0.0
        frames[0, 8 * LANES : 9 * LANES] = gravity
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
                f, m = wrench(w, e, a, link)
                put(B, 0, s, w)
                put(B, 3, s, e)
                put(B, 6, s, a)
                put(B, 9, s, f)
                put(B, 12, s, m)
                put(B, 15, s, (c, z, d))
            frames[j + ONE] = B
        for i in range(L):
            j = np.uint64(L - 1 - i)
            P[:] = frames[arm.parent[j]]
            B[:] = frames[j + ONE]
            link = row(arm.links, j)
            for s in range(LANES):
                c, z, d = three(B, 15, s)
                f, m = carried(c, z, d, link, three(B, 9, s), three(B, 12, s))
                T[s], S[s] = m[2], f[2]
                put(P, 9, s, plus(three(P, 9, s), f))
                put(P, 12, s, plus(three(P, 12, s), m))
            frames[arm.parent[j]] = P
            turn, slide = arm.turns[j], arm.slides[j]
            for s in range(LANES):
                coordinates[turn, 5 * LANES + s] += T[s]
            for s in range(LANES):
                coordinates[slide, 5 * LANES + s] += S[s]
        for k in range(n):
            for s in range(count):
                tau[start + s, k] = coordinates[k, 5 * LANES + s]


@njit(cache=True)
def mass_matrices(arm, q, M):  # type: ignore[no-untyped-def]
    """Write the mass matrices (N, n, n) of N poses (N, n) into M.

    Blocks of a frame: h and I of all that it carries, then cos, sin, d of its link; of a pair of coordinates: M.
    """
    N, n, L = q.shape[0], arm.n, len(arm.parent)
    frames, coordinates = np.zeros((L + 1, 12 * LANES)), np.zeros((n + 1, 6 * LANES))
    P, B, T, F = np.empty(12 * LANES), np.empty(12 * LANES), np.empty(6 * LANES), np.empty(6 * LANES)
    total = np.zeros((n + 1, n + 1, LANES))
    coordinates[n, :LANES] = 1.0
    masses = carried_masses(arm)
    for start in range(0, N, LANES):
        count = min(LANES, N - start)
        load(q, q, q, start, coordinates)
        total[:] = 0.0
        for i in range(L):
            j = np.uint64(i)
            T[:] = coordinates[arm.turns[j]]
            F[:] = coordinates[arm.slides[j]]
            link = row(arm.links, j)
            for s in range(LANES):
                c = link[0] * T[s] - link[1] * T[LANES + s]
                z = link[1] * T[s] + link[0] * T[LANES + s]
                put(B, 0, s, link[7:10])
                put(B, 3, s, link[10:13])
                put(B, 6, s, link[13:16])
                put(B, 9, s, (c, z, link[5] + F[2 * LANES + s]))
            frames[j + ONE] = B
        for i in range(L):
            j = np.uint64(L - 1 - i)
            B[:] = frames[j + ONE]
            P[:] = frames[arm.parent[j]]
            link, m = row(arm.links, j), masses[j]
            turns, slides = arm.turns[j] < n, arm.slides[j] < n
            for s in range(LANES):
                c, z, d = three(B, 9, s)
                h, inertia = composite(c, z, d, link, m, three(B, 0, s), three(B, 3, s) + three(B, 6, s))
                put(P, 0, s, plus(three(P, 0, s), h))
                put(P, 3, s, plus(three(P, 3, s), inertia[:3]))
                put(P, 6, s, plus(three(P, 6, s), inertia[3:]))
                # What one unit of the link's own acceleration takes, at its carrier.
                put(F, 0, s, (-h[1], h[0], 0.0) if turns else (0.0, 0.0, m))
                put(F, 3, s, (inertia[2], inertia[4], inertia[5]) if turns else (h[1], -h[0], 0.0))
            frames[arm.parent[j]] = P
            if turns or slides:
                own = arm.turns[j] if turns else arm.slides[j]
                _add(total[own, own], F, 5 if turns else 2)
                frame = arm.parent[j]
                while frame > 0:
                    p = frame - ONE
                    B[:] = frames[frame]
                    link = row(arm.links, p)
                    for s in range(LANES):
                        c, z, d = three(B, 9, s)
                        f, t = carried(c, z, d, link, three(F, 0, s), three(F, 3, s))
                        put(F, 0, s, f)
                        put(F, 3, s, t)
                    for other, r in ((arm.turns[p], 5), (arm.slides[p], 2)):
                        _add(total[own, other], F, r)
                        _add(total[other, own], F, r)
                    frame = arm.parent[p]
        for s in range(count):
            for k in range(n):
                for o in range(n):
                    M[start + s, k, o] = total[k, o, s]


@njit(inline="always")
def _add(block, F, row):  # type: ignore[no-untyped-def]
    """Add a row of F to a block of one row."""
    for s in range(LANES):
        block[s] += F[row * LANES + s]


@njit(cache=True)
def carried_masses(arm):  # type: ignore[no-untyped-def]
    """The mass (L,) [kg] of every link and all that hangs on it."""
    L = len(arm.parent)
    masses = arm.links[:, 6].copy()
    for i in range(L):
        j = np.uint64(L - 1 - i)
        if arm.parent[j] > 0:
            masses[arm.parent[j] - ONE] += masses[j]
    return masses


forget_older(inverse_dynamics, mass_matrices, carried_masses)
