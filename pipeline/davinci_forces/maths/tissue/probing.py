"""A log of pushes into tissue as arrays, and each push as depths and forces along the way that it goes.

Where the log says no depth but where the tip is, a push goes along the force that it meets, or where that is one number
only, from where it is least to where it is most.  Forces and depths are taken with the sign that makes depths grow into
the tissue, both alike: the slope of one over the other stays what the log says.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.signals.smoothing import segments
from davinci_forces.maths.tissue.indentation import into_tissue

RISES = 0.15  # of the range of what swings: a peak that stands out by less is none
AT_REST = 0.1  # of a usual speed
FEWEST = 4  # samples that say anything
ONE_SIDED = 2.0  # by how much further a force has to go to one side of its median to be pushing there


def between_troughs(x: Array, rises: float = RISES) -> list[slice]:
    """Each swing of a signal (N,) up and down again, from the lowest sample before its peak to the lowest after it.

    A peak is one that stands out by at least `rises` of the signal's range, but for the extreme 1 % of its samples; one
    at an end of the signal counts.
    """
    from scipy.signal import find_peaks

    low, high = np.quantile(x, [0.01, 0.99])
    if not high > low:
        return [slice(0, len(x))]
    padded = np.concatenate([[x.min()], x, [x.min()]])
    peaks = find_peaks(padded, prominence=rises * (high - low))[0] - 1
    troughs = [a + int(np.argmin(x[a : b + 1])) for a, b in pairwise(peaks)]
    return [slice(a, b) for a, b in pairwise([0, *troughs, len(x)]) if b > a]


class Probing(NamedTuple):
    """What a log of N samples says of pushes."""

    t: Array  # (N,) [s]; NaN without a clock
    push: Integers  # (N,) number of the push; one number throughout where they are not counted
    depth: Array  # (N, 1) [m], or (N, 3) the position of the tip
    force: Array  # (N, 1) [N], or (N, 3)
    place: Array  # (N, 3) [m] position of the tip; NaN where it is not known
    speed: Array  # (N,) of a joint whose effort is the force, which is not known at rest; NaN of a force sensor
    std: Array  # (N,) [N] standard deviation of the error that a model leaves in the force; 0 of a force sensor

    @property
    def size(self) -> Array:
        """How large the force is (N,): signed where it is one number."""
        return self.force[:, 0] if self.force.shape[1] == 1 else np.asarray(np.linalg.norm(self.force, axis=1))


def known(given: Probing) -> Probing:
    """The samples at which both depth and force are known."""
    whole = np.isfinite(given.depth).all(axis=1) & np.isfinite(given.force).all(axis=1)
    return given if whole.all() else Probing._make(column[whole] for column in given)


def moves(speed: Array, usual: float, reach: int) -> Booleans:
    """Whether the force is known at each sample (N,): a joint at rest meets any effort that friction can hold.

    It is at rest where it is slower than a tenth of its `usual` speed, and for the `reach` samples that a low-pass
    spreads that to either side.
    """
    from scipy.ndimage import maximum_filter1d

    rest = np.abs(speed) < AT_REST * usual
    return np.asarray(~maximum_filter1d(rest, 2 * reach + 1))


def turned(given: Probing) -> Probing:
    """The same with depths that grow into the tissue, where the log says them.

    Where it says where the tip is, a single force is taken with the sign that its larger excursions have.
    """
    counts = ~(np.abs(given.speed) < AT_REST * np.median(np.abs(given.speed)))
    if given.force.shape[1] > 1 or counts.sum() < FEWEST:
        return given
    depth, force = given.depth[counts], given.force[counts, 0]
    if depth.shape[1] > 1:
        low, middle, high = np.quantile(force, [0.01, 0.5, 0.99])
        return given._replace(force=-given.force) if middle - low > ONE_SIDED * (high - middle) else given
    sign = into_tissue(depth[:, 0], force)
    return given._replace(depth=sign * given.depth, force=sign * given.force)


def parts(given: Probing, windows: Sequence[tuple[float, float]]) -> list[slice]:
    """The pushes: those of the windows [s] where there are any, those that are counted, or those that are found."""
    if windows:
        bounds = [np.searchsorted(given.t, (start, np.nextafter(end, np.inf))) for start, end in sorted(windows)]
        return [slice(int(a), int(b)) for a, b in bounds if b > a]
    if np.any(given.push != given.push[0]):
        return list(segments(given.push))
    return between_troughs(given.depth[:, 0] if given.depth.shape[1] == 1 else given.size)


def ways(given: Probing, pushes: Sequence[slice]) -> list[tuple[Array, Array]]:
    """Depth [m] and force [N] of each push along the way that it goes, (n,) each.

    Whether a sensor gives the force on the tissue or that on the tool, the pushes of a log tell together.
    """
    gone = [_along(given, part) for part in pushes]
    if given.depth.shape[1] == 1 or given.force.shape[1] == 1:
        return gone
    rises = np.sum([np.sign(np.sum((d - d.mean()) * (f - f.mean()))) for d, f in gone])
    return gone if rises >= 0 else [(-d, f) for d, f in gone]


def _along(given: Probing, part: slice) -> tuple[Array, Array]:
    depth, force = given.depth[part], given.force[part]
    if force.shape[1] > 1:
        size = given.size[part]
        way = _unit((size - size.min()) @ force)
        return (depth - depth[0]) @ -way if depth.shape[1] > 1 else depth[:, 0], force @ way
    if depth.shape[1] > 1:
        least, most = int(np.argmin(force[:, 0])), int(np.argmax(force[:, 0]))
        return (depth - depth[0]) @ _unit(depth[most] - depth[least]), force[:, 0]
    return depth[:, 0], force[:, 0]


def _unit(vector: Array) -> Array:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0 else np.zeros_like(vector)
