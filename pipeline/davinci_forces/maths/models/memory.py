"""Friction that the measured motion drives: with a memory of where it came from, or of a velocity's shape.

Long motions piece by piece: of a million samples, all joints' regressors at once would take gigabytes.

Friction that remembers where the motion came from is worked out along all of it first, so the pieces say what the whole
would.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.models.bias import deflect
from davinci_forces.maths.models.model import ArmMotion, Model
from davinci_forces.maths.models.terms import Term
from davinci_forces.maths.signals.smoothing import segments

RUN_IN = 3.0  # displacements of travel after which a deflection has forgotten how it started, to exp(-2 RUN_IN)
SAMPLES = 1 << 15  # of a piece


def driven(motion: ArmMotion, joint: int, term: Term) -> tuple[Array, Booleans]:
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


def deflection(motion: ArmMotion, joint: int, x_0: float) -> tuple[Array, Booleans]:
    """The deflection z (N,) of one joint, and where it is known (N,); `x_0` is in the joint's units.

    It starts relaxed after each gap, and is known once the joint has travelled `RUN_IN` displacements; a period is run
    twice, so that it starts where it ends.
    """
    dq = motion.dq[:, joint]
    z, known = np.empty(len(dq)), np.empty(len(dq), np.bool_)
    for part in segments(motion.segment):
        v, z_0 = np.ascontiguousarray(dq[part]), 0.0
        if motion.periodic:
            before = _run(v, motion.T_s, x_0, z_0)
            z_0 = float(deflect(before[-1], v[-1], motion.T_s, x_0))
        z[part] = _run(v, motion.T_s, x_0, z_0)
        travel = np.cumsum(np.abs(v)) * motion.T_s
        known[part] = motion.periodic or travel >= RUN_IN * x_0
    return z, known


def _run(dq: Array, T_s: float, x_0: float, z: float) -> Array:
    """The deflection at each sample (N,), from z at the first."""
    from davinci_forces.maths.models import kernels

    out = np.empty(len(dq))
    kernels.deflections(dq, T_s, x_0, z, out)
    return out


class Piece(NamedTuple):
    """A part of a motion, with some of what is beside it."""

    motion: ArmMotion  # of the part and what is beside it
    inside: slice  # where in that motion the part is
    place: slice  # where in the whole motion the part is


def pieces(model: Model, motion: ArmMotion, beside: int = 0) -> Iterator[Piece]:
    """A motion in parts, each with so many samples beside it on either side, as far as there are any."""
    N = len(motion.q)
    if N > SAMPLES:
        motion = motion._replace(memory={own: deflection(motion, *own) for own in model.displacements})
    for start in range(0, N, SAMPLES):
        stop, first = min(start + SAMPLES, N), max(start - beside, 0)
        inside = slice(start - first, stop - first)
        yield Piece(cut(motion, slice(first, min(stop + beside, N))), inside, slice(start, stop))


def cut(motion: ArmMotion, which: slice) -> ArmMotion:
    """A motion at some of its samples."""
    columns = {name: getattr(motion, name)[which] for name in ("q", "dq", "ddq", "segment")}
    memory = {own: (z[which], known[which]) for own, (z, known) in motion.memory.items()}
    return motion._replace(**columns, memory=memory)


def efforts(model: Model, theta: Array, motion: ArmMotion, which: Integers | None = None) -> Array:
    """Phi theta (N, m) of parameters (p,); of several (G, p), those that each sample names (N,)."""
    made = np.empty((len(motion.q), len(model.efforts)))
    for piece in pieces(model, motion):
        Phi = model.regressor(piece.motion).Phi
        made[piece.place] = Phi @ theta if which is None else np.einsum("nmp,np->nm", Phi, theta[which[piece.place]])
    return made
