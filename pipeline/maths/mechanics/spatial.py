"""Spatial vectors: motions [omega, v] and forces [moment, force], both about the base's origin in base axes.

Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 2.  Shapes: (..., 6) and (..., 6, 6).
"""

import numpy as np

from pipeline.maths.arrays import Array
from pipeline.maths.mechanics.bodies import Bodies


def contract(subscripts: str, *operands: Array) -> Array:
    """Einstein's sum, with the order of three or more operands chosen for speed."""
    return np.asarray(np.einsum(subscripts, *operands, optimize=len(operands) > 2))


def skew(x: Array) -> Array:
    """[x]x (..., 3, 3), with [x]x y = x x y."""
    X = np.zeros((*x.shape, 3))
    X[..., 0, 1], X[..., 0, 2], X[..., 1, 2] = -x[..., 2], x[..., 1], -x[..., 0]
    X[..., 1, 0], X[..., 2, 0], X[..., 2, 1] = x[..., 2], -x[..., 1], x[..., 0]
    return X


def motion_cross(v: Array) -> Array:
    """v x (..., 6, 6): the rate of a motion vector carried along by the velocity v."""
    w, zero = skew(v[..., :3]), np.zeros((*v.shape[:-1], 3, 3))
    return _blocks(w, zero, skew(v[..., 3:]), w)


def dual(cross: Array) -> Array:
    """v x* from v x: the rate of a force vector carried along, -(v x)'."""
    return np.asarray(-np.swapaxes(cross, -1, -2))


def momentum_cross(h: Array) -> Array:
    """h x~* (..., 6, 6), with (h x~*) v = v x* h."""
    n, f = -skew(h[..., :3]), -skew(h[..., 3:])
    return _blocks(n, f, f, np.zeros_like(n))


def spatial_inertias(bodies: Bodies, T: Array) -> Array:
    """The inertia of every link about the base's origin, in base axes (..., L, 6, 6); T (..., L + 1, 4, 4)."""
    R, origin = T[..., 1:, :3, :3], T[..., 1:, :3, 3]
    m = bodies.masses[:, None, None]
    c = skew(contract("...lij,lj->...li", R, bodies.centres) + origin)
    return _blocks(R @ bodies.inertias @ np.swapaxes(R, -1, -2) - m * c @ c, m * c, -m * c, m * np.eye(3))


def _blocks(a: Array, b: Array, c: Array, d: Array) -> Array:
    shape = np.broadcast_shapes(a.shape, b.shape, c.shape, d.shape)
    X = np.empty((*shape[:-2], 6, 6))
    X[..., :3, :3], X[..., :3, 3:], X[..., 3:, :3], X[..., 3:, 3:] = a, b, c, d
    return X
