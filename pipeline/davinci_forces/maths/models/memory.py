"""Friction with a state z that follows from the measured motion, and long motions in pieces.

A regressor of all joints for a million samples takes gigabytes, so it is computed in pieces.  The deflection of
presliding friction depends on the earlier motion, so it is computed along the whole motion first.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.models.model import ArmMotion, Model
from davinci_forces.maths.models.terms import Z_OF_MOTION, Term, deflect
from davinci_forces.maths.signals.smoothing import segments

RUN_IN = 3.0  # travel, in displacements, after which the initial deflection has decayed to exp(-2 RUN_IN)
PIECE_SAMPLES = 1 << 15  # samples of a piece


def friction_state(motion: ArmMotion, joint: int, term: Term) -> tuple[Array, Booleans]:
    """State z (N,) of a term of one joint, 0 for a term without, and at which samples it is known (N,)."""
    q, dq = motion.q[:, joint], motion.dq[:, joint]
    if term.displacement:
        return motion.memory.get((joint, term.displacement)) or deflection(motion, joint, term.displacement)
    valid = np.ones(len(dq), np.bool_)
    if term.width:
        return np.tanh(dq / term.width), valid
    if term.decay_velocity:
        return np.sign(dq) * np.exp(-((dq / term.decay_velocity) ** 2)), valid
    return Z_OF_MOTION[term.of_motion](q, dq) if term.of_motion else np.zeros(len(dq)), valid


def deflection(motion: ArmMotion, joint: int, x_0: float) -> tuple[Array, Booleans]:
    """Deflection z (N,) of one joint, and at which samples it is known (N,); `x_0` is in the joint's units.

    It is 0 after each gap, and known after a travel of `RUN_IN` displacements.  A period begins with its last one.
    """
    from davinci_forces.maths.models import kernels

    dq = motion.dq[:, joint]
    z, valid = np.empty(len(dq)), np.empty(len(dq), np.bool_)
    for samples in segments(motion.segment):
        v = np.ascontiguousarray(dq[samples])
        kernels.deflections(v, motion.T_s, x_0, 0.0, z[samples])
        if motion.periodic:
            last = float(deflect(z[samples][-1], v[-1], motion.T_s, x_0))
            kernels.deflections(v, motion.T_s, x_0, last, z[samples])
        travel = np.cumsum(np.abs(v)) * motion.T_s
        valid[samples] = motion.periodic or travel >= RUN_IN * x_0
    return z, valid


class Piece(NamedTuple):
    """A part of a motion, with neighbouring samples before and after."""

    motion: ArmMotion  # motion of the part and its neighbouring samples
    inside: slice  # samples of the part in this motion
    place: slice  # samples of the part in the whole motion


def pieces(model: Model, motion: ArmMotion, beside: int = 0, samples: int = 0) -> Iterator[Piece]:
    """Yield a motion in parts of `samples`, or of `PIECE_SAMPLES`, with up to `beside` more before and after each."""
    N, samples = len(motion.q), samples or PIECE_SAMPLES
    if samples < N:
        motion = motion._replace(memory={key: deflection(motion, *key) for key in model.displacements})
    for start in range(0, N, samples):
        stop, first = min(start + samples, N), max(start - beside, 0)
        which = slice(first, min(stop + beside, N))
        columns = {name: getattr(motion, name)[which] for name in ("q", "dq", "ddq", "segment")}
        memory = {key: (z[which], valid[which]) for key, (z, valid) in motion.memory.items()}
        part = motion._replace(**columns, memory=memory)
        yield Piece(part, slice(start - first, stop - first), slice(start, stop))


def efforts(model: Model, theta: Array, motion: ArmMotion, which: Integers | None = None) -> Array:
    """Efforts Phi theta (N, m) for theta (p,), or for theta (G, p) with the row `which` (N,) at each sample."""
    tau = np.empty((len(motion.q), len(model.efforts)))
    for piece in pieces(model, motion):
        Phi = model.regressor(piece.motion).Phi
        tau[piece.place] = Phi @ theta if which is None else np.einsum("nmp,np->nm", Phi, theta[which[piece.place]])
    return tau
