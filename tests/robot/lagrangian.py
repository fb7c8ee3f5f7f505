"""The dynamics of any chain by its Lagrangian: from where its links are and how they move, with no recursion."""

import numpy as np

from davinci_forces.maths.mechanics import kinematics
from davinci_forces.maths.mechanics.bodies import Bodies
from davinci_forces.maths.mechanics.chain import Chain
from tests.robot.thesis_matrices import gradient

G = 9.81


def links(chain: Chain, q: np.ndarray) -> np.ndarray:
    """The links' own frames in the base frame (N, L, 4, 4)."""
    return kinematics.frames(chain, q)[:, [chain.names.index(link) for link in chain.links]] @ np.linalg.inv(
        chain.of_links
    )


def potential(chain: Chain, bodies: Bodies, q: np.ndarray) -> np.ndarray:
    there, T = bodies.with_coordinates(q.shape[1]), links(chain, q)
    heights = np.einsum("nli,li->nl", T[..., 2, :3], there.centres) + T[..., 2, 3]
    return G * heights @ there.masses


def mass(chain: Chain, bodies: Bodies, q: np.ndarray) -> np.ndarray:
    """The sum of m J_v' J_v + J_w' I J_w, with the Jacobians of the centres."""
    there, T, M = bodies.with_coordinates(q.shape[1]), links(chain, q), 0.0
    for i, (link, offset) in enumerate(zip(chain.links, chain.of_links, strict=True)):
        centre = np.linalg.inv(offset) @ np.append(there.centres[i], 1.0)
        J_v, J_w = kinematics.jacobian(chain, q, link, centre[:3])
        own = T[:, i, :3, :3].swapaxes(1, 2) @ J_w
        M = M + there.masses[i] * J_v.swapaxes(1, 2) @ J_v + own.swapaxes(1, 2) @ there.inertias[i] @ own
    return M


def kinetic(chain: Chain, bodies: Bodies, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    return np.einsum("ni,nij,nj->n", dq, mass(chain, bodies, q), dq) / 2


def coriolis(chain: Chain, bodies: Bodies, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """C dq (N, n) by Christoffel's symbols.  (4.8)"""
    dM = gradient(lambda at: mass(chain, bodies, at), q)
    return np.einsum("nijk,nk,nj->ni", dM, dq, dq) - np.einsum("njki,nj,nk->ni", dM, dq, dq) / 2


def gravity(chain: Chain, bodies: Bodies, q: np.ndarray) -> np.ndarray:
    return gradient(lambda at: potential(chain, bodies, at), q)


def from_parameters(parameters: np.ndarray) -> Bodies:
    """The bodies that have these inertial parameters (10 L,), each with a mass: the inverse of `Bodies.parameters`."""
    rows = np.reshape(parameters, (-1, 10))
    m, upper, none = rows[:, 0], np.triu_indices(3), np.zeros((len(rows), 3, 3))
    inertias = none.copy()
    inertias[:, *upper] = rows[:, 4:]
    inertias = inertias + np.triu(inertias, 1).swapaxes(1, 2)
    point_masses = Bodies(m, rows[:, 1:4] / m[:, None], none, np.zeros(len(rows), int))
    return Bodies(m, point_masses.centres, inertias - point_masses.about_frames(), point_masses.counts_from)


def random_bodies(links: int, seed: int = 0) -> Bodies:
    """Bodies that could be: ellipsoids of any orientation."""
    random = np.random.default_rng(seed)
    A = random.normal(size=(links, 3, 3))
    second = A @ A.swapaxes(1, 2) * 1e-3  # moments, of which an inertia is made
    inertias = np.trace(second, axis1=1, axis2=2)[:, None, None] * np.eye(3) - second
    return Bodies(random.uniform(0.1, 3, links), random.uniform(-0.3, 0.3, (links, 3)), inertias, np.zeros(links, int))
