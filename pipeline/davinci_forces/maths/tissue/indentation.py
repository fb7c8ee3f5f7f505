"""One push into tissue: its samples in contact, where contact begins and ends, and the stiffness of the tissue.

Contact begins at the depth d0 at which the force starts to rise.  It is estimated together with the slope:

    f = c + k max(d - d0, 0)^n

For a given d0 the model is linear in c and k, so the search is over d0 alone.  The force of tissue that stiffens under
pressure rises so gently that n = 1 detects contact late: n is larger if a larger n fits clearly better.
"""

from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, evenly
from davinci_forces.maths.estimation.correlation import correlated_variance

CANDIDATES = 41  # onsets tried in a round; the next round searches between the neighbours of the best
ROUNDS = 3
MAX_SAMPLES_SEARCH = 4000  # an onset is searched on at most this number of evenly spaced samples
CURVED_EXPONENTS = (1.5, 2.0)
MIN_RATIO_CURVE = 1.5  # a curve is chosen if a straight line leaves this many times its residual squares
MIN_SAMPLES_ONSET = 3  # fewest samples on either side of an onset
MIN_RISE_DEVIATIONS = 4.0  # smallest rise of the force, in standard deviations of the residual
MIN_RATIO_BEND = 1.05  # there is a bend if a line leaves this many times the residual squares of a hinge
MIN_SAMPLES_HINGE = 6
FOUND, ALL_CONTACT, NONE, TOO_EARLY = "found", "all", "no contact", "contact from the first sample"
MIN_SAMPLES_LINE = 5
# Range of the correlation length of a model's error, as shares of the range of depth, and number of lengths tried.
SHORTEST_LENGTH, LONGEST_LENGTH, LENGTHS = 0.05, 50.0, 25
MAX_SAMPLES_ERROR = 200  # the worst correlation length is searched on at most this number of samples


class Hinge(NamedTuple):
    """The force before and after contact, with its residual squares and those of a straight line."""

    onset: float  # d0
    slope: float  # k
    exponent: float  # n
    level: float  # c, the force before contact
    squares: float
    squares_line: float  # of a straight line throughout
    reach: float  # depth of the deepest sample below the onset
    before: int  # number of fitted samples before the onset depth


def hinge(depth: Array, force: Array) -> Hinge:
    """Fit a hinge to forces (N,) at depths (N,), N >= 4, and choose its exponent."""
    straight = hinge_of(depth, force, 1.0)
    curved = min((hinge_of(depth, force, n) for n in CURVED_EXPONENTS), key=lambda h: h.squares)
    return curved if curved.squares * MIN_RATIO_CURVE < straight.squares else straight


def hinge_of(depth: Array, force: Array, exponent: float) -> Hinge:
    """Fit a hinge of this exponent to forces (N,) at depths (N,) by least squares; it may rise or fall."""
    few = evenly(len(depth), MAX_SAMPLES_SEARCH)
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


def onset_std(depth: Array, force: Array, bend: Hinge) -> float:
    """Standard error of an onset with correlated residuals; depths and forces (N,) in order of time.

    It uses the derivatives of the hinge by c, k and d0: 1, (d - d0)^n, and beyond d0 -k n (d - d0)^(n - 1).
    """
    past, n = np.clip(depth - bend.onset, 0.0, None), bend.exponent
    F = np.column_stack([np.ones_like(past), past**n, np.where(past > 0, -bend.slope * n * past ** (n - 1), 0.0)])
    Q, R = np.linalg.qr(F)
    if np.abs(np.diag(R)).min() <= 1e-12 * np.abs(np.diag(R)).max() or len(depth) <= 4:
        return float("nan")
    residual = force - Q @ (Q.T @ force)
    variance, _ = correlated_variance(Q, residual, (0,), np.linalg.inv(R), len(depth) - 3)
    return float(np.sqrt(variance[2]))


def _profile(d: Array, f: Array, onsets: Array, exponent: float) -> tuple[Array, Array]:
    """Residual squares (G,) of the best hinge of each onset (G,), and its slope (G,)."""
    past = np.clip(d - onsets[:, None], 0.0, None) ** exponent
    past = past - past.mean(axis=1, keepdims=True)
    away = f - f.mean()
    size = np.maximum((past**2).sum(axis=1), np.finfo(float).tiny)
    slope = past @ away / size
    return np.asarray((away**2).sum() - slope**2 * size), np.asarray(slope)


class Indentation(NamedTuple):
    """A push of N samples."""

    state: str  # FOUND, ALL_CONTACT, NONE or TOO_EARLY
    inside: Booleans  # (N,) samples of contact
    loading: Booleans  # (N,) up to the deepest sample
    onset_depth: float  # of first contact [m]; NaN where it is not known
    onset_depth_std: float
    release_depth: float  # of last contact [m]


def all_of(depth: Array, counted: Booleans, state: str = ALL_CONTACT) -> Indentation:
    """A push at depths (N,) with contact at all counted samples; or a push in another state, without an onset."""
    return Indentation(state, counted, is_loading(depth), float("nan"), float("nan"), float("nan"))


def find_contact(depth: Array, force: Array, counted: Booleans) -> Indentation:
    """Find the contact of one push, in order of time: forces (N,) [N] at depths (N,) [m] that grow into the tissue.

    The force is known at `counted` (N,) samples.  Tissue recovers slowly: loading and unloading have an onset each.
    """
    loading = is_loading(depth)
    into, out = loading & counted, ~loading & counted
    if into.sum() < MIN_SAMPLES_HINGE:
        return all_of(depth, counted, NONE)
    first = hinge(depth[into], force[into])
    if not stands_out(first, depth[into]):
        return all_of(depth, counted, NONE)
    if not bends(first):
        return all_of(depth, counted, TOO_EARLY)
    last = hinge(depth[out], force[out]) if out.sum() >= MIN_SAMPLES_HINGE else first
    release = last.onset if stands_out(last, depth[out]) and bends(last) else first.onset
    inside = np.where(loading, depth > first.onset, depth > release) & counted
    std = onset_std(depth[into], force[into], first)
    return Indentation(FOUND, inside, loading, first.onset, std, float(release))


def is_loading(depth: Array) -> Booleans:
    """Whether each sample (N,) is the deepest one or before it."""
    return np.arange(len(depth)) <= int(np.argmax(depth))


def stands_out(bend: Hinge, depth: Array) -> bool:
    """Whether the force changes with depth (N,) by more than its scatter."""
    if len(depth) <= MIN_SAMPLES_ONSET:
        return False
    noise, rise = np.sqrt(bend.squares / (len(depth) - MIN_SAMPLES_ONSET)), bend.slope * bend.reach**bend.exponent
    return bool(abs(rise) > MIN_RISE_DEVIATIONS * noise)


def bends(bend: Hinge) -> bool:
    """Whether there are samples before the onset, and a straight line fits worse than the hinge."""
    return bend.before >= MIN_SAMPLES_ONSET and bend.squares_line > MIN_RATIO_BEND * bend.squares


class StraightLine(NamedTuple):
    """f = c + k d, by least squares."""

    k: float  # [N/m]
    k_std: float  # [N/m] from the correlated residuals
    c: float  # [N]
    r2: float


def straight(depth: Array, force: Array) -> StraightLine | None:
    """Fit a straight line to forces (N,) [N] at depths (N,) [m] in order of time; None if too few or one depth.  (8.1)

    Its intercept is the force at no depth: the weight that a sensor carries, an error of the friction.
    """
    if len(depth) < MIN_SAMPLES_LINE or not np.ptp(depth) > 0:
        return None
    Q, R = np.linalg.qr(np.column_stack([np.ones_like(depth), depth - depth.mean()]))
    y = Q.T @ force
    residual = force - Q @ y
    c, k = np.linalg.solve(R, y)
    away = float(np.sum((force - force.mean()) ** 2))
    if not away > 0:
        return StraightLine(0.0, 0.0, float(c), 0.0)
    variance, _ = correlated_variance(Q, residual, (0,), np.linalg.inv(R), len(depth) - 2)
    r2 = 1.0 - float(residual @ residual) / away
    return StraightLine(float(k), float(np.sqrt(variance[1])), float(c - k * depth.mean()), r2)


def slope_with_std(depth: Array, force: Array, common: float) -> tuple[float, float]:
    """Slope of the straight line and its standard error [N/m], with a `common` error [N]; NaN if there is no line."""
    line = straight(depth, force)
    return (line.k, float(np.hypot(line.k_std, slope_error(depth, common)))) if line else (float("nan"), float("nan"))


def slope_error(depth: Array, std: float) -> float:
    """Standard deviation [N/m] of a line's slope by an error of the force that varies with depth (N,), of `std` [N].

    A constant error only moves the intercept, and white noise averages out; an error that varies slowly matters most.
    The correlation length l of a model's error is not known, so the worst of all exponential correlations is taken:

        k_std = std max over l of sqrt(a' C a),    C = exp(-|d_i - d_j| / l),    a = (d - mean(d)) / |d - mean(d)|^2
    """
    few = np.sort(depth)[evenly(len(depth), MAX_SAMPLES_ERROR)]
    away = few - few.mean()
    a = away / float(away @ away)
    apart = np.abs(few[:, None] - few)
    lengths = np.ptp(few) * np.geomspace(SHORTEST_LENGTH, LONGEST_LENGTH, LENGTHS)
    return std * float(np.sqrt(max(a @ np.exp(-apart / length) @ a for length in lengths)))


def median_std(k: Array, random: Array, common: float, factor: float = np.pi / 2) -> float:
    """Standard error of the median of stiffnesses (n,), each with an error (n,), and a `common` error.

    Differences beyond the errors are due to the tissue.  The variance of a median is pi/2 that of a mean, that of
    another quantile `factor` times: p (1 - p) over the square of the normal density there.
    """
    n = len(k)
    between = max(float(np.var(k, ddof=1)) - float(np.mean(random**2)), 0.0) if n > 1 else 0.0
    variance = (float(np.mean(random**2)) + between) / n * (factor if n > 2 else 1.0)
    return float(np.hypot(np.sqrt(variance), common))
