"""The compiled recursions: for one sample, as a simulator needs, and for many samples in blocks of LANES.

The innermost loops run over LANES samples that are adjacent in memory, so that the compiler can use vector
instructions.  Import this module inside the function that uses it.  To compile it, or to load it from the disk cache,
takes longer than to compute thousands of samples with numpy.
"""

from inspect import isfunction
from math import cos, sin
from typing import Any

import numpy as np
from numba.extending import register_jitable

from davinci_forces.maths.compiled import compile_and_store
from davinci_forces.maths.mechanics import link, recursions

LANES = 32  # samples


for _function in {**vars(link), **vars(recursions)}.values():  # a call inside a loop prevents vector instructions
    if isfunction(_function) and _function.__module__ in (link.__name__, recursions.__name__):
        register_jitable(forceinline=True, no_cfunc_wrapper=True)(_function)


@register_jitable(forceinline=True, no_cfunc_wrapper=True)  # type: ignore[untyped-decorator]
def load(q: Any, dq: Any, ddq: Any, joints: Any) -> None:
    """Put up to S samples (K, n) into joints (n + 1, 5, S)."""
    for s in range(q.shape[0]):
        for k in range(q.shape[1]):
            joints[k, 0, s], joints[k, 1, s], joints[k, 2, s] = cos(q[s, k]), sin(q[s, k]), q[s, k]
            joints[k, 3, s], joints[k, 4, s] = dq[s, k], ddq[s, k]


@compile_and_store
def mass_and_bias(tree: Any, gravity: float, q: Any, dq: Any, M: Any, bias: Any) -> None:
    """Put M(q) (n, n) and the bias C dq + G (n,) of one sample into arrays.  (4.41)

    Column c of M is the effort of a unit acceleration at rest without gravity, since one recursion compiles faster.
    """
    n = tree.n
    joints, work, effort = np.zeros((n + 1, 5, 1)), np.zeros((len(tree.parent) + 1, 15, 1)), np.zeros((1, n, 1))[0]
    for c in range(n + 1):  # the last one is the bias
        for k in range(n):
            joints[k, 0, 0], joints[k, 1, 0], joints[k, 2, 0] = cos(q[k]), sin(q[k]), q[k]
            joints[k, 3, 0], joints[k, 4, 0] = dq[k] if c == n else 0.0, 1.0 if k == c else 0.0
        recursions.inverse_dynamics(tree, gravity if c == n else 0.0, joints, work, effort, range(1))
        for k in range(c + 1 if c < n else 0):  # a distal link's effort at earlier joints has the fewest lost digits
            M[k, c] = M[c, k] = effort[k, 0]
    for k in range(n):
        bias[k] = effort[k, 0]


@compile_and_store
def place_and_jacobian(tree: Any, body: Any, point: Any, q: Any, J: Any) -> Any:
    """Put J_v (3, n) of a point of a body into J, and return it in the base frame; `point` is in the body's frame.

    The loop goes from the body to the base.  Each joint's column is computed in the axes of its link, then turned.
    """
    J[:] = 0.0
    while body > 0:
        i = body - 1
        row, k = tree.rows[i], tree.coordinate[i]
        cos_sin = (1.0, 0.0) if tree.slides[i] else (cos(q[k]), sin(q[k]))
        x, y, z = point
        if tree.slides[i]:
            J[2, k] += 1.0
            point = x, y, z + q[k]
        else:
            J[0, k] -= y
            J[1, k] += x
            point = link.from_link_axes(cos_sin, point)
        point = link.plus(link.times(row, point), link.place(row))
        for o in range(tree.n):
            J[0, o], J[1, o], J[2, o] = link.times(row, link.from_link_axes(cos_sin, (J[0, o], J[1, o], J[2, o])))
        body = tree.parent[i]
    return point


@compile_and_store
def inverse_dynamics(tree: Any, gravity: Any, q: Any, dq: Any, ddq: Any, tau: Any) -> None:
    """Put the efforts of N samples into tau; all are (N, n)."""
    n, L = tree.n, len(tree.parent)
    joints, work, efforts = np.zeros((n + 1, 5, LANES)), np.zeros((L + 1, 15, LANES)), np.zeros((n, LANES))
    for first in range(0, len(q), LANES):
        last = min(first + LANES, len(q))
        load(q[first:last], dq[first:last], ddq[first:last], joints)
        recursions.inverse_dynamics(tree, gravity, joints, work, efforts, range(LANES))
        for s in range(last - first):
            for k in range(n):
                tau[first + s, k] = efforts[k, s]


@compile_and_store
def mass_matrices(tree: Any, q: Any, M: Any) -> None:
    """Put the mass matrices (N, n, n) of N poses (N, n) into M."""
    n, L = tree.n, len(tree.parent)
    joints, work, entries = np.zeros((n + 1, 5, LANES)), np.zeros((n * (L + 1) + 1, 6, LANES)), np.zeros((n, n, LANES))
    for first in range(0, len(q), LANES):
        last = min(first + LANES, len(q))
        load(q[first:last], q[first:last], q[first:last], joints)
        recursions.mass_matrix(tree, joints, work, entries, range(LANES))
        for s in range(last - first):
            for k in range(n):
                for o in range(n):
                    M[first + s, k, o] = entries[max(k, o), min(k, o), s]


@compile_and_store
def regressors(tree: Any, gravity: Any, q: Any, dq: Any, ddq: Any, Y: Any) -> None:
    """Put the regressors (N, n, 10 L) of N samples (N, n) into Y."""
    n, L = tree.n, len(tree.parent)
    joints, work = np.zeros((n + 1, 5, LANES)), np.zeros(((n + 1) * (L + 1), 9, LANES))
    entries = np.zeros((n, L, 10, LANES))
    for first in range(0, len(q), LANES):
        last = min(first + LANES, len(q))
        load(q[first:last], dq[first:last], ddq[first:last], joints)
        recursions.regressor(tree, gravity, joints, work, entries, range(LANES))
        for s in range(last - first):
            for k in range(n):
                for i in range(L):
                    for c in range(10):
                        Y[first + s, k, i, c] = entries[k, i, c, s]
