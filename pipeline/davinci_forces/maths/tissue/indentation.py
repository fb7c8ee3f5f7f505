"""One push into tissue: which of its samples are of contact, where that begins and ends, and which are loading."""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.tissue.onset import FEWEST, Hinge, hinge, onset_std

STANDS_OUT = 4.0  # standard deviations of what it leaves that the force must rise by
BETTER = 1.05  # by how much a line must leave more squares than a hinge that is believed to bend
ENOUGH = 6  # samples that a hinge is found from

FOUND, WHOLE, NONE, TOO_EARLY = "found", "all", "no contact", "contact from the first sample"


class Indentation(NamedTuple):
    """A push of N samples."""

    state: str  # FOUND, WHOLE, NONE or TOO_EARLY
    inside: Booleans  # (N,) samples of contact
    loading: Booleans  # (N,) up to the deepest sample
    onset: float  # depth of first contact [m]; NaN where it is not known
    onset_std: float
    release: float  # depth of last contact [m]

    @property
    def touched(self) -> bool:
        """Whether there is any contact."""
        return self.state != NONE


def all_of(depth: Array, counted: Booleans, state: str = WHOLE) -> Indentation:
    """A push whose every sample is of contact, at depths (N,)."""
    return Indentation(state, counted, is_loading(depth), float("nan"), float("nan"), float("nan"))


def found(depth: Array, force: Array, counted: Booleans) -> Indentation:
    """The contact of one push, in order of time, from forces (N,) [N] at depths (N,) [m] that grow into the tissue.

    `counted` (N,) says at which samples the force is known.  Loading and unloading have a bend each: tissue that has
    been pressed comes back later than it gave way.
    """
    loading = is_loading(depth)
    into, out = loading & counted, ~loading & counted
    if into.sum() < ENOUGH:
        return all_of(depth, counted, NONE)
    first = hinge(depth[into], force[into])
    if not stands_out(first, depth[into]):
        return all_of(depth, counted, NONE)
    if not bends(first):
        return all_of(depth, counted, TOO_EARLY)
    last = hinge(depth[out], force[out]) if out.sum() >= ENOUGH else first
    release = last.onset if stands_out(last, depth[out]) and bends(last) else first.onset
    inside = np.where(loading, depth > first.onset, depth > release) & counted
    std = onset_std(depth[into], force[into], first)
    return Indentation(FOUND, inside, loading, first.onset, std, float(release))


def is_loading(depth: Array) -> Booleans:
    """Whether each sample (N,) comes before the deepest one, or is it."""
    return np.arange(len(depth)) <= int(np.argmax(depth))


def stands_out(bend: Hinge, depth: Array) -> bool:
    """Whether the force changes with depth (N,) by more than it scatters."""
    if len(depth) <= FEWEST:
        return False
    noise = np.sqrt(bend.squares / (len(depth) - FEWEST))
    return bool(abs(bend.rise) > STANDS_OUT * noise)


def bends(bend: Hinge) -> bool:
    """Whether there are samples before the bend, and a straight line is worse."""
    return bend.before >= FEWEST and bend.squares_line > BETTER * bend.squares


def into_tissue(depth: Array, force: Array) -> float:
    """-1 where the force clearly bends as depths (N,) shrink, so that they shrink into the tissue; else 1."""
    return -1.0 if hinge(-depth, force).squares * BETTER < hinge(depth, force).squares else 1.0
