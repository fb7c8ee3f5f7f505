"""One push into tissue: which of its samples are of contact, where that begins and ends, and how stiff the tissue is.

Where contact begins: the depth at which the force starts to rise, found together with how steeply it does.

    f = c + k max(d - d0, 0)^n

For a given d0 this is a straight line in the power, so d0 is searched for by itself, and c and k follow.  Tissue that
stiffens as it is pressed bends so gently that a straight line would find contact late: n is 1 unless more fits clearly.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, evenly
from davinci_forces.maths.estimation.correlation import correlated

CANDIDATES = 41  # onsets of a round; each further round looks between the neighbours of the best
ROUNDS = 3
MOST = 4000  # samples that a search goes through; of more, evenly spaced ones
EXPONENTS = (1.5, 2.0)
CURVED = 1.5  # by how much a straight line must leave more squares than a curve that is believed
FEWEST = 3  # samples on either side of an onset, below which it is not known
STANDS_OUT = 4.0  # standard deviations of what it leaves that the force must rise by
BETTER = 1.05  # by how much a line must leave more squares than a hinge that is believed to bend
ENOUGH = 6  # samples that a hinge is found from
FOUND, WHOLE, NONE, TOO_EARLY = "found", "all", "no contact", "contact from the first sample"
LINE_FEWEST = 5  # samples that a line is drawn through
SHORTEST, LONGEST, LENGTHS = 0.05, 50.0, 25  # correlation lengths of a model's error over the range of depth
ERROR_MOST = 200  # samples that the error of a model is followed through


class Hinge(NamedTuple):
    """The force before and after contact, with the squares that it leaves and those that a straight line does."""

    onset: float  # d0
    slope: float  # k
    exponent: float  # n
    level: float  # c, the force before contact
    squares: float
    squares_line: float  # of a straight line throughout
    reach: float  # depth of the deepest sample below the onset
    before: int  # samples, of those looked at, that are not as deep as the onset

    @property
    def rise(self) -> float:
        """By how much the force changes from first contact to the deepest sample."""
        return float(self.slope * self.reach**self.exponent)


def hinge(depth: Array, force: Array) -> Hinge:
    """The hinge through forces (N,) at depths (N,), N >= 4, in the exponent that they call for."""
    straight = hinge_of(depth, force, 1.0)
    curved = min((hinge_of(depth, force, n) for n in EXPONENTS), key=lambda h: h.squares)
    return curved if curved.squares * CURVED < straight.squares else straight


def hinge_of(depth: Array, force: Array, exponent: float) -> Hinge:
    """The hinge of least squares through forces (N,) at depths (N,), that rises or falls with depth."""
    few = evenly(len(depth), MOST)
    d, f = depth[few], force[few]
    low, high = float(d.min()), float(d.max())
    best = np.linspace(low, high, CANDIDATES + 1)[:-1]
    squares, slopes = _profile(d, f, best, exponent)
    for _ in range(ROUNDS - 1):
        i, step = int(np.argmin(squares)), best[1] - best[0]
        best = np.linspace(max(best[i] - step, low), min(best[i] + step, high - 1e-3 * step), CANDIDATES)
        squares, slopes = _profile(d, f, best, exponent)
    i = int(np.argmin(squares))
    onset, slope = float(best[i]), float(slopes[i])
    past = np.clip(d - onset, 0.0, None) ** exponent
    level = float(np.mean(f) - slope * np.mean(past))
    line = float(_profile(d, f, np.array([low]), 1.0)[0][0])
    return Hinge(onset, slope, exponent, level, float(squares[i]), line, high - onset, int((d < onset).sum()))


def onset_std(depth: Array, force: Array, found: Hinge) -> float:
    """The standard error of an onset, with residuals that are correlated; depths and forces (N,) in order of time.

    By the derivatives of the hinge by c, k and d0: 1, (d - d0)^n, and -k n (d - d0)^(n - 1), the latter beyond d0.
    """
    past, n = np.clip(depth - found.onset, 0.0, None), found.exponent
    residual = force - found.level - found.slope * past**n
    F = np.column_stack([np.ones_like(past), past**n, np.where(past > 0, -found.slope * n * past ** (n - 1), 0.0)])
    Q, R = np.linalg.qr(F)
    if np.abs(np.diag(R)).min() <= 1e-12 * np.abs(np.diag(R)).max() or len(depth) <= 4:
        return float("nan")
    residual = residual - Q @ (Q.T @ residual)
    variance = correlated(Q, residual, (0,), np.linalg.inv(R), len(depth) - 3).variance
    return float(np.sqrt(variance[2]))


def _profile(d: Array, f: Array, onsets: Array, exponent: float) -> tuple[Array, Array]:
    """The squares (G,) that the best hinge of each onset (G,) leaves, and its slope (G,)."""
    past = np.clip(d - onsets[:, None], 0.0, None) ** exponent
    past = past - past.mean(axis=1, keepdims=True)
    away = f - f.mean()
    size = np.maximum((past**2).sum(axis=1), np.finfo(float).tiny)
    slope = past @ away / size
    return np.asarray((away**2).sum() - slope**2 * size), np.asarray(slope)


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


class StraightLine(NamedTuple):
    """f = c + k d, by least squares."""

    k: float  # [N/m]
    k_std: float  # [N/m] by what the line leaves, correlated as it is
    c: float  # [N]
    r2: float


def straight(depth: Array, force: Array) -> StraightLine | None:
    """The ordinary line through forces (N,) [N] at depths (N,) [m], in order of time; None where there is none.  (8.1)

    Its intercept is what the force is at no depth: the weight that a sensor carries, what friction is taken wrongly.
    """
    if len(depth) < LINE_FEWEST or not np.ptp(depth) > 0:
        return None
    Q, R = np.linalg.qr(np.column_stack([np.ones_like(depth), depth - depth.mean()]))
    y = Q.T @ force
    residual = force - Q @ y
    c, k = np.linalg.solve(R, y)
    away = float(np.sum((force - force.mean()) ** 2))
    if not away > 0:
        return StraightLine(0.0, 0.0, float(c), 0.0)
    variance = correlated(Q, residual, (0,), np.linalg.inv(R), len(depth) - 2).variance
    return StraightLine(
        float(k), float(np.sqrt(variance[1])), float(c - k * depth.mean()), 1.0 - float(residual @ residual) / away
    )


def slope(depth: Array, force: Array) -> float:
    """The slope [N/m] of the ordinary line alone; NaN where there is none."""
    if len(depth) < LINE_FEWEST or not np.ptp(depth) > 0:
        return float("nan")
    away = depth - depth.mean()
    return float(away @ force / (away @ away))


def slope_error(depth: Array, std: float) -> float:
    """Standard deviation [N/m] of a line's slope by an error of the force that varies with depth (N,), of `std` [N].

    A constant error is the intercept's, and one that changes from sample to sample averages out; one in between does
    most.  How fast a model's error changes with depth is not known, so the worst is taken, over correlations that fall
    off exponentially, with a the weights of a slope:

        k_std = std max over l of sqrt(a' C a),    C = exp(-|d_i - d_j| / l),    a = (d - mean(d)) / |d - mean(d)|^2
    """
    few = np.sort(depth)[evenly(len(depth), ERROR_MOST)]
    away = few - few.mean()
    a = away / float(away @ away)
    apart = np.abs(few[:, None] - few)
    lengths = np.ptp(few) * np.geomspace(SHORTEST, LONGEST, LENGTHS)
    return std * float(np.sqrt(max(a @ np.exp(-apart / length) @ a for length in lengths)))


def work(depth: Array, force: Array) -> float:
    """The work [J] that a force (N,) does along depths (N,), in order of time: the integral of f over d."""
    return float(np.sum(np.diff(depth) * (force[1:] + force[:-1]) / 2))


def median_std(k: Array, random: Array, common: float) -> float:
    """Standard error of the median of stiffnesses (n,), each with its own error (n,) and all with a `common` one.

    What they differ by beyond their errors is the tissue's.  The variance of a median is pi/2 that of a mean.
    """
    n = len(k)
    between = max(float(np.var(k, ddof=1)) - float(np.mean(random**2)), 0.0) if n > 1 else 0.0
    own = (float(np.mean(random**2)) + between) / n * (np.pi / 2 if n > 2 else 1.0)
    return float(np.hypot(np.sqrt(own), common))
