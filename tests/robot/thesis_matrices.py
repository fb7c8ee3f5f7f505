"""The thesis's own matrices (3.8), typed from the page, and its Lagrangian: independent of the pipeline's chain.

Everything runs on numpy arrays, complex numbers included, and on SymPy's symbols.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

NAMES = ("1", "2", "3", "4", "5", "6", "7", "8", "9L", "9R")


def links(q: Sequence[Any], c: Callable[[Any], Any], s: Callable[[Any], Any]) -> dict[str, list[list[Any]]]:
    """(3.8), each link in the frame that carries it; q are the seven coordinates."""
    q1, q2, q3, q4, q5, q6, q7 = q
    d1, d2, a3, a4, a5, a8, a9 = 0.161, -0.035, 0.190, 0.515, 0.040, 0.009, 0.009
    p = q2 + 0.03
    last = [0, 0, 0, 1]
    return {
        "1": [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, d1], last],
        "2": [[s(q1), 0, c(q1), 0], [-c(q1), 0, s(q1), 0], [0, -1, 0, d2], last],
        "3": [[c(p), s(p), 0, a3 * c(p)], [s(p), -c(p), 0, a3 * s(p)], [0, 0, -1, 0], last],
        "4": [[-s(p), c(p), 0, -a4 * s(p)], [c(p), s(p), 0, a4 * c(p)], [0, 0, -1, 0], last],
        "5": [[c(q2), 0, s(q2), a5 * c(q2)], [s(q2), 0, -c(q2), a5 * s(q2)], [0, 1, 0, 0], last],
        "6": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, q3 + 0.282], last],
        "7": [[c(q4), 0, s(q4), 0], [s(q4), 0, -c(q4), 0], [0, 1, 0, 0], last],
        "8": [[-s(q5), 0, c(q5), -a8 * s(q5)], [c(q5), 0, s(q5), a8 * c(q5)], [0, 1, 0, 0], last],
        "9L": [[c(q6), -s(q6), 0, a9 * c(q6)], [s(q6), c(q6), 0, a9 * s(q6)], [0, 0, 1, 0], last],
        "9R": [[c(q7), -s(q7), 0, a9 * c(q7)], [s(q7), c(q7), 0, a9 * s(q7)], [0, 0, 1, 0], last],
    }


# Mass, centre (4.17, with link 6's along -z) and (Ix, Iy, Iz) of the cylinders of Table 4.2.
def cylinder(m: float, h: float, r: float) -> tuple[float, float]:
    return m * h**2 / 12 + m * r**2 / 4, m * r**2 / 2


def bodies(jaws: int, lc5: float = 0.3) -> dict[str, tuple[float, tuple[float, ...], tuple[float, ...]]]:
    a2, x2 = cylinder(0.5, 0.22, 0.035)
    a3, x3 = cylinder(4, 0.19, 0.1)
    a4, x4 = cylinder(0.7, 0.515, 0.07)
    a5, x5 = cylinder(0.7, 0.26, 0.035)
    a6, x6 = cylinder(0.079, 0.1, 0.07)
    a7, x7 = cylinder(0.079, 0.4, 0.035)
    a8, x8 = cylinder(0.04, 0.009, 0.005)
    a9, x9 = cylinder(0.01, 0.009, 0.005)
    found = {
        "2": (0.5, (0, 0, 0), (a2, x2, a2)),
        "3": (4, (-0.34, 0, 0), (x3, a3, a3)),
        "4": (0.7, (-0.257, 0, 0), (x4, a4, a4)),
        "5": (0.7, (0, 0, -lc5), (a5, a5, x5)),
        "6": (0.079, (0, 0, -0.4), (a6, a6, x6)),
        "7": (0.079, (0, -0.252, 0), (a7, x7, a7)),
        "8": (0.04, (-0.0045, 0, 0), (x8, a8, a8)),
        "9L": (0.01, (-0.0045, 0, 0), (x9, a9, a9)),
    }
    return found | ({"9R": found["9L"]} if jaws == 2 else {})


def poses(q: np.ndarray) -> dict[str, np.ndarray]:
    """Every frame in the base frame (N, 4, 4), for q (N, n), complex or not.  (3.6)"""
    full = np.zeros((7, len(q)), q.dtype)
    full[: q.shape[1]] = q.T
    found = {}
    for name, rows in links(list(full), np.cos, np.sin).items():
        local = np.array([[np.broadcast_to(x, len(q)) for x in row] for row in rows]).transpose(2, 0, 1)
        carrier = {"9L": "8", "9R": "8"}.get(name, str(int(name[0]) - 1))
        found[name] = local if carrier == "0" else found[carrier] @ local
    return found


def velocities(q: np.ndarray, dq: np.ndarray) -> Iterator[tuple[float, np.ndarray, np.ndarray, np.ndarray]]:
    """Of each body its mass, the velocity of its centre, the rates about its axes (N, 3) and (Ix, Iy, Iz).

    By the complex step, which has no truncation error worth the name.  (4.12)
    """
    h = 1e-30
    moved = poses(q + 1j * h * dq)
    for name, (m, centre, inertia) in bodies(jaws=2 if q.shape[1] == 7 else 1).items():
        T, rate = moved[name].real, moved[name].imag / h
        v = rate[:, :3] @ np.array([*centre, 1.0])
        W = rate[:, :3, :3] @ T[:, :3, :3].transpose(0, 2, 1)
        w = np.stack([W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]], axis=1)
        yield m, v, np.einsum("nji,nj->ni", T[:, :3, :3], w), np.array(inertia)


def potential(q: np.ndarray) -> np.ndarray:
    """(4.36), with z0 up and g = 9.81; complex where q is."""
    found = poses(q)
    masses = bodies(jaws=2 if q.shape[1] == 7 else 1)
    return sum(
        9.81 * m * (found[name][:, 2, :3] @ np.array(c) + found[name][:, 2, 3]) for name, (m, c, _) in masses.items()
    )


def mass(q: np.ndarray) -> np.ndarray:
    """M (N, n, n) of twice the kinetic energy: products of the velocities that each coordinate makes.  (4.35)"""
    M = 0.0
    for of_each in zip(*(velocities(q, np.broadcast_to(e, q.shape)) for e in np.eye(q.shape[1])), strict=True):
        [m, *_], v, own, [inertia, *_] = map(np.array, zip(*of_each, strict=True))
        M = M + m * np.einsum("ink,jnk->nij", v, v) + np.einsum("ink,jnk,k->nij", own, own, inertia)
    return M


def gradient(f: Callable[[np.ndarray], np.ndarray], q: np.ndarray) -> np.ndarray:
    """df/dq (N, ..., n) by differences of the eighth order: 4e-3^8 is 1e-19 of the ninth derivative."""
    h, weights = 0.02, (4 / 5, -1 / 5, 4 / 105, -1 / 280)
    steps = h * np.eye(q.shape[1])
    return np.stack(
        [sum(w * (f(q + k * e) - f(q - k * e)) for k, w in enumerate(weights, start=1)) / h for e in steps], axis=-1
    )


def coriolis(q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """d/dt (dk/d dq) - dk/dq at ddq = 0.  (4.8)"""
    dM = gradient(mass, q)
    return np.einsum("nijk,nk,nj->ni", dM, dq, dq) - np.einsum("njki,nj,nk->ni", dM, dq, dq) / 2


def gravity(q: np.ndarray) -> np.ndarray:
    """dU/dq by the complex step."""
    h = 1e-30
    return np.stack([potential(q + 1j * h * e).imag / h for e in np.eye(q.shape[1])], axis=1)
