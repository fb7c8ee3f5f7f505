"""Friction with a state z that follows from the measured motion, and regressors of long motions piece by piece.

The regressors of all joints for a million samples would take gigabytes, so they are computed in pieces.  The deflection
of presliding friction depends on the motion before, so it is computed along the whole motion first.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.models.bias import deflect
from davinci_forces.maths.models.model import ArmMotion, Model
from davinci_forces.maths.models.terms import Term
from davinci_forces.maths.signals.smoothing import segments

RUN_IN = 3.0  # displacements of travel after which the start of a deflection has decayed to exp(-2 RUN_IN)
PIECE_SAMPLES = 1 << 15  # of a piece


def friction_state(motion: ArmMotion, joint: int, term: Term) -> tuple[Array, Booleans]:
    """State z (N,) of a term of one joint, and where it is known (N,): a deflection, a smooth sign or Stribeck's peak.

    A term without z has the state 0, known everywhere.
    """
    dq = motion.dq[:, joint]
    if term.displacement:
        return motion.memory.get((joint, term.displacement)) or deflection(motion, joint, term.displacement)
    valid = np.ones(len(dq), np.bool_)
    if term.width:
        return np.tanh(dq / term.width), valid
    if term.decay_velocity:
        return np.sign(dq) * np.exp(-((dq / term.decay_velocity) ** 2)), valid
    return np.zeros(len(dq)), valid


def deflection(motion: ArmMotion, joint: int, x_0: float) -> tuple[Array, Booleans]:
    """Deflection z (N,) of one joint, and where it is known (N,); `x_0` is in the joint's units.

    It starts relaxed after each gap, and is known after a travel of `RUN_IN` displacements.  A period is run twice, so
    that it starts where it ends.
    """
    dq = motion.dq[:, joint]
    z, valid = np.empty(len(dq)), np.empty(len(dq), np.bool_)
    for part in segments(motion.segment):
        v, z_0 = np.ascontiguousarray(dq[part]), 0.0
        if motion.periodic:
            before = _run(v, motion.T_s, x_0, z_0)
            z_0 = float(deflect(before[-1], v[-1], motion.T_s, x_0))
        z[part] = _run(v, motion.T_s, x_0, z_0)
        travel = np.cumsum(np.abs(v)) * motion.T_s
        valid[part] = motion.periodic or travel >= RUN_IN * x_0
    return z, valid


def _run(dq: Array, T_s: float, x_0: float, z: float) -> Array:
    """Deflection at each sample (N,), from z at the first."""
    from davinci_forces.maths.models import kernels

    out = np.empty(len(dq))
    kernels.deflections(dq, T_s, x_0, z, out)
    return out


class Piece(NamedTuple):
    """A part of a motion, with some samples before and after."""

    motion: ArmMotion  # of the part and those samples
    inside: slice  # where in that motion the part is
    place: slice  # where in the whole motion the part is


def pieces(model: Model, motion: ArmMotion, beside: int = 0) -> Iterator[Piece]:
    """Yield a motion in parts, each with up to `beside` more samples before and after."""
    N = len(motion.q)
    if N > PIECE_SAMPLES:
        motion = motion._replace(memory={key: deflection(motion, *key) for key in model.displacements})
    for start in range(0, N, PIECE_SAMPLES):
        stop, first = min(start + PIECE_SAMPLES, N), max(start - beside, 0)
        inside = slice(start - first, stop - first)
        yield Piece(select_samples(motion, slice(first, min(stop + beside, N))), inside, slice(start, stop))


def select_samples(motion: ArmMotion, which: slice) -> ArmMotion:
    """Select samples of a motion."""
    columns = {name: getattr(motion, name)[which] for name in ("q", "dq", "ddq", "segment")}
    memory = {key: (z[which], valid[which]) for key, (z, valid) in motion.memory.items()}
    return motion._replace(**columns, memory=memory)


def efforts(model: Model, theta: Array, motion: ArmMotion, which: Integers | None = None) -> Array:
    """Efforts Phi theta (N, m) of parameters (p,), or of several (G, p) with the number `which` (N,) at each sample."""
    tau = np.empty((len(motion.q), len(model.efforts)))
    for piece in pieces(model, motion):
        Phi = model.regressor(piece.motion).Phi
        tau[piece.place] = Phi @ theta if which is None else np.einsum("nmp,np->nm", Phi, theta[which[piece.place]])
    return tau
