"""The recursions compiled: for one sample, as a simulator's step needs it, and for many, LANES of them at a time.

Import this module only where it is used: compiling it, or reading it back from the cache beside this file, takes longer
than thousands of samples of numpy.
"""

from collections.abc import Callable
from inspect import isfunction
from types import ModuleType
from typing import Any

import numpy as np
from numba.extending import register_jitable

from davinci_forces.maths.compiled import cached, compiled
from davinci_forces.maths.mechanics import link, recursions, vector
from davinci_forces.maths.mechanics.recursions import work_space
from davinci_forces.maths.mechanics.vector import LANES, gather, scatter


def _functions(module: ModuleType) -> list[Callable[..., object]]:
    return [f for f in vars(module).values() if isfunction(f) and f.__module__ == module.__name__]


for _function in (*_functions(link), *_functions(recursions)):
    register_jitable(_function)

_kernel = cached(link, recursions, vector)


@compiled
def quarter(turns: Any) -> Any:
    """sin(turns pi/2) of a whole number, exactly: f (1 - 4 f^2) 16/3 is -1, 0 or 1 where 4 f is one of -2 ... 2."""
    f = turns * 0.25
    f = f - ((f + 6755399441055744.0) - 6755399441055744.0)
    return f * (1.0 - 4.0 * f * f) * 5.333333333333333


@compiled
def cosine_sine(x: Any) -> Any:
    """cos x and sin x to 1e-15 for |x| < 1e5, by arithmetic that vectors have, too.

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
    sine, cosine = quarter(turns), quarter(turns + 1.0)
    return cosine * c - sine * s, cosine * s + sine * c


@_kernel
def mass_and_bias(tree: Any, gravity: Any, q: Any, dq: Any, ddq: Any, M: Any, bias: Any) -> None:
    """Put M(q) (n, n) and the effort (n,) of one sample into arrays; with ddq 0 this is C dq + G.  (4.41)"""
    turns = [(0.0, 0.0)] * len(q)
    turn(q, turns)
    work = work_space(tree, 0.0)
    recursions.inverse_dynamics(tree, gravity, turns, q, dq, ddq, work, bias)
    recursions.mass_matrix(tree, turns, q, work, M.reshape(-1))


@_kernel
def place_and_jacobian(tree: Any, body: Any, point: Any, q: Any, J: Any) -> Any:
    """Put J_v (3, n) of a point of a body into J, and give its place in the base frame; `point` is in the body's.

    From the body to the base: what a joint does to the point is known in the axes of its link, and turned from there.
    """
    J[:] = 0.0
    while body > 0:
        i = body - 1
        row, k = tree.rows[i], tree.coordinate[i]
        angle = cosine_sine(0.0 if tree.slides[i] else q[k])
        x, y, z = point
        if tree.slides[i]:
            J[2, k] += 1.0
            point = x, y, z + q[k]
        else:
            J[0, k] -= y
            J[1, k] += x
            point = link.turned_back(angle, point)
        point = link.plus(link.times(row, point), link.place(row))
        for o in range(tree.n):
            J[0, o], J[1, o], J[2, o] = link.times(row, link.turned_back(angle, (J[0, o], J[1, o], J[2, o])))
        body = tree.parent[i]
    return point


@compiled
def load(x: Any, start: Any, numbers: Any) -> None:
    """LANES samples of x (N, n) as one vector a coordinate."""
    flat, n = x.reshape(-1), x.shape[1]
    for k in range(n):
        numbers[k] = gather(flat, start * n + k, n)


@compiled
def turn(q: Any, turns: Any) -> None:
    """cos and sin of every coordinate."""
    for k in range(len(turns)):
        turns[k] = cosine_sine(q[k])


@_kernel
def inverse_dynamics(tree: Any, gravity: Any, q: Any, dq: Any, ddq: Any, tau: Any) -> None:
    """Put the efforts of N >= LANES samples into tau; all are (N, n)."""
    (N, n), zero, out = q.shape, gather(np.zeros(LANES), 0, 1), tau.reshape(-1)
    at, rates, accelerations, turns = [zero] * n, [zero] * n, [zero] * n, [(zero, zero)] * n
    work, efforts = work_space(tree, zero), [zero] * n
    for first in range(0, N, LANES):
        start = min(first, N - LANES)  # the last ones overlap those before them
        load(q, start, at)
        load(dq, start, rates)
        load(ddq, start, accelerations)
        turn(at, turns)
        recursions.inverse_dynamics(tree, gravity, turns, at, rates, accelerations, work, efforts)
        for k in range(n):
            scatter(out, start * n + k, n, efforts[k])


@_kernel
def mass_matrices(tree: Any, q: Any, M: Any) -> None:
    """Put the mass matrices (N, n, n) of N >= LANES poses (N, n) into M."""
    (N, n), zero, out = q.shape, gather(np.zeros(LANES), 0, 1), M.reshape(-1)
    at, turns = [zero] * n, [(zero, zero)] * n
    work, entries = work_space(tree, zero), [zero] * (n * n)
    for first in range(0, N, LANES):
        start = min(first, N - LANES)
        load(q, start, at)
        turn(at, turns)
        recursions.mass_matrix(tree, turns, at, work, entries)
        for k in range(n * n):
            scatter(out, start * n * n + k, n * n, entries[k])


@_kernel
def regressors(tree: Any, gravity: Any, q: Any, dq: Any, ddq: Any, Y: Any) -> None:
    """Put the regressors (N, n, 10 L) of N >= LANES samples (N, n) into Y, which is 0 before."""
    (N, n), L, zero, out = q.shape, len(tree.parent), gather(np.zeros(LANES), 0, 1), Y.reshape(-1)
    none = zero, zero, zero, zero, zero, zero, zero, zero, zero, zero
    # One more, for what never moves.
    at, rates, accelerations = [zero] * (n + 1), [zero] * (n + 1), [zero] * (n + 1)
    work, turns, entries = work_space(tree, zero, n + 1), [(zero, zero)] * (n + 1), [none] * (n * L)
    for first in range(0, N, LANES):
        start = min(first, N - LANES)
        load(q, start, at)
        load(dq, start, rates)
        load(ddq, start, accelerations)
        turn(at, turns)
        recursions.regressor(tree, gravity, turns, at, rates, accelerations, work, entries)
        for i in range(L):
            for k in range(n):
                if tree.moves[i, k]:
                    for column in range(10):
                        place = ((start * n + k) * L + i) * 10 + column
                        scatter(out, place, n * L * 10, entries[k * L + i][column])
