"""Friction that the measured motion drives: with a memory of where it came from, or of a velocity's shape."""

from itertools import pairwise

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.models.bias import deflect
from davinci_forces.maths.models.model import Motion
from davinci_forces.maths.models.terms import Term

RUN_IN = 3.0  # displacements of travel after which a deflection has forgotten how it started, to exp(-2 RUN_IN)


def driven(motion: Motion, joint: int, term: Term) -> tuple[Array, Booleans]:
    """z (N,) of a term of one joint, and where it is known (N,): a deflection, a smooth sign or Stribeck's peak.

    A term without z has 0, known everywhere.
    """
    dq = motion.dq[:, joint]
    if term.displacement:
        return motion.memory.get((joint, term.displacement)) or deflection(motion, joint, term.displacement)
    known = np.ones(len(dq), np.bool_)
    if term.width:
        return np.tanh(dq / term.width), known
    if term.faded:
        return np.sign(dq) * np.exp(-((dq / term.faded) ** 2)), known
    return np.zeros(len(dq)), known


def deflection(motion: Motion, joint: int, x_0: float) -> tuple[Array, Booleans]:
    """The deflection z (N,) of one joint, and where it is known (N,); `x_0` is in the joint's units.

    It starts relaxed after each gap, and is known once the joint has travelled `RUN_IN` displacements; a period is run
    twice, so that it starts where it ends.
    """
    dq = motion.dq[:, joint]
    z, known = np.empty(len(dq)), np.empty(len(dq), np.bool_)
    edges = [0, *(np.flatnonzero(np.diff(motion.segment)) + 1).tolist(), len(dq)]
    for start, stop in pairwise(edges):
        part = np.ascontiguousarray(dq[start:stop])
        z_0 = 0.0
        if motion.periodic:
            before = _run(part, motion.T_s, x_0, z_0)
            z_0 = float(deflect(before[-1], part[-1], motion.T_s, x_0))
        z[start:stop] = _run(part, motion.T_s, x_0, z_0)
        travel = np.cumsum(np.abs(part)) * motion.T_s
        known[start:stop] = motion.periodic or travel >= RUN_IN * x_0
    return z, known


def _run(dq: Array, T_s: float, x_0: float, z: float) -> Array:
    """The deflection at each sample (N,), from z at the first."""
    from davinci_forces.maths.models import kernels

    out = np.empty(len(dq))
    kernels.deflections(dq, T_s, x_0, z, out)
    return out
