"""Long motions piece by piece: of a million samples, all joints' regressors at once would take gigabytes.

Friction that remembers where the motion came from is worked out along all of it first, so the pieces say what the whole
would.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Integers
from davinci_forces.maths.models.memory import deflection
from davinci_forces.maths.models.model import Model, Motion

SAMPLES = 1 << 15  # of a piece


class Piece(NamedTuple):
    """A part of a motion, with some of what is beside it."""

    motion: Motion  # of the part and what is beside it
    inside: slice  # where in that motion the part is
    place: slice  # where in the whole motion the part is


def pieces(model: Model, motion: Motion, beside: int = 0) -> Iterator[Piece]:
    """A motion in parts, each with so many samples beside it on either side, as far as there are any."""
    N = len(motion.q)
    if N > SAMPLES:
        motion = motion._replace(memory={own: deflection(motion, *own) for own in model.displacements})
    for start in range(0, N, SAMPLES):
        stop, first = min(start + SAMPLES, N), max(start - beside, 0)
        inside = slice(start - first, stop - first)
        yield Piece(cut(motion, slice(first, min(stop + beside, N))), inside, slice(start, stop))


def cut(motion: Motion, which: slice) -> Motion:
    """A motion at some of its samples."""
    columns = {name: getattr(motion, name)[which] for name in ("q", "dq", "ddq", "segment")}
    memory = {own: (z[which], known[which]) for own, (z, known) in motion.memory.items()}
    return motion._replace(**columns, memory=memory)


def efforts(model: Model, theta: Array, motion: Motion, which: Integers | None = None) -> Array:
    """Phi theta (N, m) of parameters (p,); of several (G, p), those that each sample names (N,)."""
    made = np.empty((len(motion.q), len(model.efforts)))
    for piece in pieces(model, motion):
        Phi = model.regressor(piece.motion).Phi
        made[piece.place] = Phi @ theta if which is None else np.einsum("nmp,np->nm", Phi, theta[which[piece.place]])
    return made
